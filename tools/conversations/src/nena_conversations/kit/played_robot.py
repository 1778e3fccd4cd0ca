"""A robot that a test plays at the broker: honest, unless a clause makes it slow, deaf or refusing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from time import monotonic
from typing import Any, Final

from pydantic_core import from_json, to_json

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.action import Action, ActionStatus, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType, error
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import EmergencyStop, OperatingMode, State
from nena_shared.vda5050.topics import Topic, TopicScheme

SILENT_FOR: Final = 10.0
"""Longest time between two states of a robot at rest, seconds."""
FACTSHEET_REQUEST: Final = "factsheetRequest"


class PlayedRobot:
    """Connects an :class:`HonestRobot` to the broker, and moves it on."""

    def __init__(
        self, settings: MqttSettings, topics: TopicScheme, robot: HonestRobot, codec: Codec, *, pace: float
    ) -> None:
        self.robot, self.codec, self.topics = robot, codec, topics
        robot.version = codec.version
        robot.reports_instants_apart = codec.major_version != "v2"
        self.orders: list[tuple[float, Order]] = []
        """All readable orders and updates that arrived, with the time (monotonic, s); also unheard ones."""
        self.instants: list[tuple[float, Action]] = []
        self.sent: dict[Topic, bytes] = {}
        """What it sent last on each topic."""
        self.away = False
        """Whether it has left the fleet."""
        self._pace = pace
        self._last: tuple[int, State] | None = None
        """The last state, and the number of the connection in which it was sent."""
        self._reported_at = 0.0
        self._tasks: set[asyncio.Task[None]] = set()
        self.behave()
        self.link = MqttLink(
            settings.model_copy(update={"reconnect_min": 0.1, "reconnect_max": 0.3}),
            client_id=f"nena-test-{robot.key.manufacturer}-{robot.key.serial_number}",
            hooks=LinkHooks(
                will=lambda: self._connection(ConnectionState.CONNECTION_BROKEN), on_connected=self._greeting
            ),
        )
        self.link.subscribe(topics.of(robot.key, Topic.ORDER), self._on_order)
        self.link.subscribe(topics.of(robot.key, Topic.INSTANT_ACTIONS), self._on_actions)

    def behave(self) -> None:
        """Be honest and quick again."""
        self.deaf = False
        """Whether what is sent to it is lost."""
        self.slow = 0.0
        """Seconds until it looks at a message."""
        self.holds = False
        """Whether it stands still."""
        self.refuses: ErrorType | None = None
        """Why it takes no order."""
        self.dialect: Callable[[dict[str, Any]], object] = lambda _: None
        """Changes its states before they are sent."""
        self.robot.refuses_updates = False
        self.robot.emergency_stop = EmergencyStop.NONE

    async def run(self) -> None:
        """Move on until cancelled; the connection then breaks."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.link.run())
            tasks.create_task(self._drive())

    async def _drive(self) -> None:
        while True:
            await asyncio.sleep(self._pace)
            if not self.holds and self.robot.emergency_stop is EmergencyStop.NONE:
                self.robot.step()
            self.report()

    def report(self, *, again: bool = False) -> None:
        """Send a state if something has changed, or none was sent for long; ``again``: in any case."""
        if self.away or not self.link.state.connected:
            return
        state = self.robot.state(0.0)
        content = self.link.state.connects, state.model_copy(update={"header_id": 0})
        if content == self._last and not again and monotonic() - self._reported_at < SILENT_FOR:
            self.robot.header_id -= 1  # not sent
            return
        self._last, self._reported_at = content, monotonic()
        written = from_json(self._written(state))
        self.dialect(written)
        self.sent[Topic.STATE] = to_json(written)
        self.link.publish(Outbound(self._topic(Topic.STATE), self.sent[Topic.STATE], qos=0, keep=False))

    def set_mode(self, mode: OperatingMode) -> None:
        """Switch the mode, as a person does."""
        self.robot.set_mode(mode)
        self.report()

    def has_error(self, kind: str, level: ErrorLevel) -> None:
        """Have an error of one's own."""
        self.robot.errors.append(error(kind, "a defect").model_copy(update={"error_level": level}))

    def press_stop(self) -> None:
        """Have the emergency stop pressed."""
        self.robot.emergency_stop = EmergencyStop.MANUAL

    def restart(self) -> None:
        """Lose the order and all else, as in a restart, where it stands."""
        self.robot.restart(journal=False)
        self.robot.errors.clear()
        self.link.cut(self._pace)

    def leave(self) -> None:
        """Leave the fleet: OFFLINE, and no states."""
        self.away = self.deaf = True
        message = self._connection(ConnectionState.OFFLINE)
        self.sent[Topic.CONNECTION] = message.payload
        self.link.publish(message)

    def come_back(self) -> None:
        """Return to the fleet, if it has left."""
        if self.away:
            self.away = self.deaf = False
            self._last = None
            for message in self._greeting():
                self.link.publish(message)

    def lose_link(self, seconds: float) -> None:
        """Lose the connection for some time; the broker sends the will."""
        self.link.cut(seconds)

    def cleared(self, topic: Topic) -> Outbound:
        """Return the message that removes the retained one of a topic."""
        return Outbound(self._topic(topic), b"", retain=True)

    def _topic(self, topic: Topic) -> str:
        return self.topics.of(self.robot.key, topic)

    def _written(self, message: Header) -> bytes:
        return self.codec.encode(message.model_copy(update={"timestamp": datetime.now(UTC)}))

    def _connection(self, state: ConnectionState) -> Outbound:
        payload = self._written(self.robot.connection(state))
        return Outbound(self._topic(Topic.CONNECTION), payload, retain=True)

    def _factsheet(self) -> Outbound:
        return Outbound(self._topic(Topic.FACTSHEET), self._written(self.robot.factsheet()), retain=True)

    def _greeting(self) -> Iterator[Outbound]:
        state = ConnectionState.OFFLINE if self.away else ConnectionState.ONLINE
        message = self._connection(state)
        self.sent[Topic.CONNECTION] = message.payload
        yield message
        yield self._factsheet()

    def _on_order(self, inbound: Inbound) -> None:
        if inbound.retained:
            return
        with suppress(MalformedMessageError):
            order = self.codec.decode(Order, inbound.payload)
            self.orders.append((monotonic(), order))
            self._later(lambda: self._take_order(order))
            return
        self.robot.errors[:] = [error(ErrorType.VALIDATION_FAILURE, "the order cannot be read")]

    def _take_order(self, order: Order) -> None:
        if self.refuses and order.order_id != self.robot.order_id:
            self.robot.refuse(order, self.refuses)
        else:
            self.robot.take_order(order)
        self.report()

    def _on_actions(self, inbound: Inbound) -> None:
        with suppress(MalformedMessageError):
            message = self.codec.decode(InstantActions, inbound.payload)
            self.instants += [(monotonic(), action) for action in message.actions]
            self._later(lambda: self._take_actions(message))

    def _take_actions(self, message: InstantActions) -> None:
        new = {each.action_id for each in message.actions} - set(self.robot.instants)
        self.robot.take_instant_actions(message)
        for action_id in new:
            action, status = self.robot.instants[action_id]
            if action.action_type == FACTSHEET_REQUEST and status is ActionStatus.FINISHED:
                self.link.publish(self._factsheet())
        self.report()

    def _later(self, take: Callable[[], None]) -> None:
        if self.deaf:
            return
        if not self.slow:
            take()
            return

        async def wait() -> None:
            await asyncio.sleep(self.slow)
            take()

        task = asyncio.create_task(wait())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
