"""A conversation with a fleet control, as its robots: ask for orders, misbehave, and watch what it sends."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from enum import StrEnum
from time import monotonic
from typing import Any, Final

from nena_conversations.kit.clause import ClauseFailedError, NotApplicableError
from nena_conversations.kit.played_robot import PlayedRobot
from nena_conversations.kit.session import KEPT, Listener
from nena_conversations.message import Sender, sender_of
from nena_conversations.orders import HEADER
from nena_conversations.recording import Entry
from nena_conversations.rules import Rule
from nena_shared.mqtt import Inbound, MqttLink
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.topics import RobotKey, Topic

RACED: Final = frozenset({Rule.MODE, Rule.OFFLINE})
"""Rules that a message may break because it crossed the robot's message of a change."""
ATTEMPTS: Final = 3
"""How often an order with a drive is asked for: one to where the robot stands has none."""
OBSERVED_QOS: Final = 2
"""Subscription QoS: each message arrives with the QoS of its sender."""


class Wanted(StrEnum):
    """What a test asks the user of the fleet control for."""

    ORDER = "order"
    CANCEL = "cancel"
    RELEASE = "release"
    """Trust a robot again that has refused orders."""


Ask = Callable[[Wanted, RobotKey], Awaitable[None]]
"""Asks the fleet control for something for a robot; it may return before it is done."""


def content_of(order: Order) -> str:
    """Return an order without its header, to compare it."""
    return order.model_dump_json(exclude=set(HEADER), exclude_none=True)


class FleetSession(Listener):
    """Plays robots; all messages of theirs and of fleet control also pass the checker of conversations."""

    def __init__(
        self, link: MqttLink, players: Sequence[PlayedRobot], ask: Ask, *, answer_within: float, watch: float
    ) -> None:
        super().__init__()
        self.answer_within = answer_within
        self.watch = watch
        """Time for which a fleet control is watched that must not send something, seconds."""
        self.reaction = watch / 3
        """Time in which a message may have crossed a change of its robot, seconds."""
        self.owed = False
        """Whether an order was asked for that may still come."""
        self.players = {player.robot.key: player for player in players}
        self.player = players[0]
        """The robot of the clause."""
        self.counts: Counter[tuple[RobotKey, Topic]] = Counter()
        self.updates: Counter[RobotKey] = Counter()
        self.highest_qos: dict[tuple[RobotKey, Topic], int] = {}
        self._heard: dict[tuple[RobotKey, Topic], bytes] = {}
        """What came last from the broker."""
        self._situations: dict[tuple[RobotKey, Topic], OperatingMode | ConnectionState] = {}
        self._changed_at: dict[RobotKey, float] = {}
        """When a robot's mode or connection was last heard to have changed, monotonic, s."""
        self._ask = ask
        for player in players:
            for topic in player.codec.kinds:
                name = player.topics.of(player.robot.key, topic)
                link.subscribe(name, self.receive, qos=OBSERVED_QOS)

    def receive(self, inbound: Inbound) -> None:
        """Record, check and count a message."""
        received, findings = self.hear(inbound)
        now = monotonic()
        for each in findings:
            changed_at = self._changed_at.get(each.robot)
            if each.rule not in RACED or changed_at is None or now - changed_at > self.reaction:
                self.findings.append(each)
        if received is None:
            return
        of = received.robot, received.topic
        self.counts[of] += 1
        self._heard[of] = inbound.payload
        match received.message:
            case State(operating_mode=now_in) | Connection(connection_state=now_in):
                if self._situations.get(of) is not now_in:
                    self._situations[of], self._changed_at[received.robot] = now_in, now
        if not inbound.retained:
            self.highest_qos[of] = max(self.highest_qos.get(of, 0), inbound.qos)
        if isinstance(received.message, Order) and received.message.order_update_id:
            self.updates[received.robot] += 1
        self.wake()

    def describe(self) -> str:
        """Return the last order to the robot, and the robot's order, in words."""
        robot = self.player.robot
        sent = [order for _, order in self.player.orders[-1:]]
        last = f"orderId {sent[0].order_id!r}, update {sent[0].order_update_id}" if sent else "none"
        nodes = ", ".join(node.node_id for node in robot.nodes) or "none"
        return (
            f"the last order to {robot.key} was {last}; the robot has {robot.order_id!r}, nodes left {nodes}"
        )

    def shown(self, first: int) -> list[Entry]:
        """Return what fleet control sent, and the robot's states beside it."""
        level = f"/{self.player.robot.key}/"
        entries = [each for each in self.recording[first:] if level in each.topic]
        sent = [each for each in entries if sender_of(each.topic) is Sender.FLEET]
        return (sent or entries)[-KEPT:]

    async def ask(self, wanted: Wanted) -> None:
        """Ask for something for the robot."""
        await self._ask(wanted, self.player.robot.key)

    async def ordered(self, *, accept: Callable[[Order], Any] = bool, ask: bool = True) -> Order:
        """Wait for an order to the robot, after asking for one; return it.

        The last one that comes again, late, is not taken for it.

        Raises:
            NotApplicableError: none came.
        """
        first = len(self.player.orders)
        last = [content_of(order) for _, order in self.player.orders[-1:]]
        if ask:
            await self.ask(Wanted.ORDER)
        found: list[Order] = []

        def look() -> bool:
            new = (each for each in self.sent_since(first) if content_of(each) not in last)
            found.extend(each for each in new if accept(each))
            return bool(found)

        if not await self.came_true(look, self.answer_within):
            raise NotApplicableError(f"no order came within {self.answer_within:g} s; {self.describe()}")
        return found[0]

    async def asked(self, what: str) -> Order:
        """Ask for an order, and wait for one; raises ClauseFailedError."""
        count = len(self.player.orders)
        await self.ask(Wanted.ORDER)
        await self.until(lambda: len(self.player.orders) > count, what)
        return self.player.orders[count][1]

    async def taken(self, order: Order) -> None:
        """Wait until the robot has an order; raises ClauseFailedError."""
        await self.until(
            lambda: self.player.robot.order_id == order.order_id, "an order that a robot can take"
        )

    async def driving(self) -> Order:
        """Return an order with a drive that the robot has taken, and stands in.

        Raises:
            NotApplicableError: none came.
            ClauseFailedError: one came, and the robot could not take it.
        """
        self.player.holds = True
        for _ in range(ATTEMPTS):
            order = await self.ordered()
            await self.taken(order)
            if len(order.nodes) > 1:
                return order
        raise NotApplicableError("only orders with one node came, and none with a drive")

    async def done(self, what: str) -> None:
        """Wait until the robot has done its order, horizon included; raises ClauseFailedError."""
        self.player.holds = False
        await self.until(lambda: self.player.robot.idle, what)

    async def never(self, condition: Callable[[], Any], what: str) -> None:
        """Fail if a condition comes true while the fleet control is watched; raises ClauseFailedError."""
        if await self.came_true(condition, self.watch):
            raise ClauseFailedError(f"{what}; {self.describe()}")

    async def settle(self) -> None:
        """Give fleet control the time to notice a change."""
        await self.delivered()
        await asyncio.sleep(self.watch / 2)

    async def delivered(self) -> None:
        """Wait until the broker delivers a state that the robot sends now, and thus what it held back."""
        self.player.report(again=True)
        sent, robot = self.player.sent, self.player.robot.key
        await self.came_true(
            lambda: all(self._heard.get((robot, topic)) == payload for topic, payload in sent.items()),
            self.answer_within,
        )

    def sent_since(self, first: int) -> list[Order]:
        """Return the orders and updates to the robot after the first so many."""
        return [order for _, order in self.player.orders[first:]]

    def actions_since(self, first: int, action_type: str) -> list[Action]:
        """Return the instant actions of a type to the robot after the first so many instant actions."""
        return [each for _, each in self.player.instants[first:] if each.action_type == action_type]

    async def clear(self) -> None:
        """Be an honest robot again, and get rid of the order."""
        player = self.player
        if player.refuses or player.robot.refuses_updates:
            await self.ask(Wanted.RELEASE)
        if player.robot.refuses_updates:
            await self.ask(Wanted.CANCEL)
        player.behave()
        player.come_back()
        player.robot.errors.clear()
        player.robot.paused = False
        if player.robot.mode is not OperatingMode.AUTOMATIC:
            player.set_mode(OperatingMode.AUTOMATIC)
        player.report()
        await self.came_true(lambda: player.link.state.connected, self.answer_within)
        if self.owed:
            self.owed = False
            await self.more_orders(len(player.orders), 3 * self.watch)
        if not await self._rests():
            await self.ask(Wanted.CANCEL)
            if not await self._rests():
                player.restart()  # as a person would do
        self.wake()

    async def _rests(self) -> bool:
        """Return whether the robot has no order left, and gets none for a moment."""
        player = self.player
        while await self.came_true(lambda: player.robot.idle, self.answer_within):
            if not await self.more_orders(len(player.orders), self.watch / 2):
                return True
        return False

    async def more_orders(self, count: int, within: float) -> bool:
        """Return whether the robot gets an order after the first ``count`` that is sent in time."""
        if not await self.came_true(lambda: len(self.player.orders) > count, within):
            await self.delivered()
        return len(self.player.orders) > count
