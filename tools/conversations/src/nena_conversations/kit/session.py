"""A conversation with one robot, as its fleet control: send orders and actions, and wait for its states."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, Final
from uuid import uuid4

from pydantic_core import to_json

from nena_conversations.checker import Checker
from nena_conversations.kit.clause import ClauseFailedError, NotApplicableError
from nena_conversations.message import ReceivedMessage, parse
from nena_conversations.recording import Entry
from nena_conversations.rules import Finding
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, BlockingType, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Edge, Node, NodePosition, Order
from nena_shared.vda5050.state import MobileRobotPosition, State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

ANSWER_WITHIN: Final = 10.0
"""Time in which a robot answers an order or an action, seconds. VDA 5050 names none."""
DRIVES: Final = 6
"""How many times longer than an answer a drive may take."""
KEPT: Final = 6
"""Messages that a verdict shows."""
RECORDED: Final = 100_000
"""Maximum number of messages in a report."""

Place = tuple[float, float]
"""A place of the plan that the robot may use, m in its map."""


Person = Callable[[str], Awaitable[None]]
"""Asks a person to do something at the robot, and returns when it is done."""


@dataclass(slots=True)
class Heard:
    """What the robot has sent."""

    state: State | None = None
    connection: Connection | None = None
    retained: set[Topic] = field(default_factory=set)
    """Topics of which the broker held a message."""
    factsheet: Factsheet | None = None
    counts: Counter[Topic] = field(default_factory=Counter)


class Listener:
    """Hears a conversation in a test, which also passes the checker of conversations."""

    answer_within = ANSWER_WITHIN
    """Time in which the tested side answers, seconds."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self.recording: list[Entry] = []
        self.checker = Checker()
        self._news = asyncio.Event()
        """Set at the next message, then replaced."""
        self._number = 0

    def hear(self, inbound: Inbound) -> tuple[ReceivedMessage | None, list[Finding]]:
        """Record and check a message; return it, if it is one of VDA 5050, and what is wrong with it."""
        entry = Entry(datetime.now(UTC), inbound.topic, inbound.payload, inbound.qos, inbound.retained)
        if len(self.recording) < RECORDED:  # the first ones: findings name messages by their number
            self.recording.append(entry)
        self._number += 1
        return parse(entry, self._number), list(self.checker.add(entry))

    def wake(self) -> None:
        """Let :meth:`until` look again."""
        self._news.set()
        self._news = asyncio.Event()

    def describe(self) -> str:
        """Return what was heard last, for the reason of a verdict."""
        raise NotImplementedError

    def shown(self, first: int) -> list[Entry]:
        """Return the messages that show a violation, of those from the ``first`` on."""
        telling = [each for each in self.recording[first:] if not each.topic.endswith(Topic.VISUALIZATION)]
        return telling[-KEPT:]

    async def prepare(self, *, moves: bool) -> None:
        """Get ready for a clause; raises NotApplicableError."""

    async def clear(self) -> None:
        """Tidy up after a clause; raises ClauseFailedError."""

    async def until(self, condition: Callable[[], Any], what: str, within: float | None = None) -> None:
        """Wait for a condition on what was heard.

        Raises:
            ClauseFailedError: it did not come true in time.
        """
        seconds = self.answer_within if within is None else within
        if not await self.came_true(condition, seconds):
            raise ClauseFailedError(f"{what} was expected within {seconds:g} s; {self.describe()}")

    async def came_true(self, condition: Callable[[], Any], within: float) -> bool:
        """Return whether a condition on what was heard comes true in time."""
        try:
            async with asyncio.timeout(within):
                while not condition():
                    await self._news.wait()
        except TimeoutError:
            return False
        return True


class RobotSession(Listener):
    """Talks to a robot."""

    def __init__(
        self,
        link: MqttLink,
        topics: TopicScheme,
        robot: RobotKey,
        codec: Codec,
        *,
        plan: Sequence[Place] = (),
        action: str = "",
        answer_within: float = ANSWER_WITHIN,
        person: Person | None = None,
    ) -> None:
        super().__init__()
        self.codec = codec
        self.robot = robot
        self.plan = plan
        """Places to which the robot may drive; the first is nearest to it."""
        self.action = action
        """Type of an action for nodes that somebody has chosen, or empty."""
        self.answer_within = answer_within
        self.drive_within = DRIVES * answer_within
        """Time for a drive between two places of the plan, seconds."""
        self.heard = Heard()
        self._person = person
        self._waits_for_factsheet = True
        self._link, self._topics = link, topics
        self._headers: Counter[Topic] = Counter()
        for topic in codec.kinds:
            link.subscribe(topics.of(robot, topic), self._receive)

    def _receive(self, inbound: Inbound) -> None:
        received, findings = self.hear(inbound)
        self.findings += findings
        if received is None:
            return
        heard = self.heard
        heard.counts[received.topic] += 1
        if inbound.retained:
            heard.retained.add(received.topic)
        match received.message:
            case State() as state:
                heard.state = state
            case Connection() as connection:
                heard.connection = connection
            case Factsheet() as factsheet:
                heard.factsheet = factsheet
        self.wake()

    async def prepare(self, *, moves: bool) -> None:
        """Check that there is a plan for a clause that moves the robot."""
        if moves:
            self.require_plan(2)

    async def state(self, accept: Callable[[State], Any], what: str, within: float | None = None) -> State:
        """Wait for a state, also the last one; raises ClauseFailedError."""
        found: list[State] = []

        def look() -> bool:
            state = self.heard.state
            if state and accept(state):
                found.append(state)
            return bool(found)

        await self.until(look, what, within)
        return found[0]

    async def factsheet(self) -> Factsheet:
        """Wait for the factsheet, once; raises NotApplicableError without one."""
        if self._waits_for_factsheet:
            await self.came_true(lambda: self.heard.factsheet, self.answer_within)
            self._waits_for_factsheet = False
        if self.heard.factsheet is None:
            raise NotApplicableError("the robot has sent no readable factsheet")
        return self.heard.factsheet

    async def never(self, condition: Callable[[State], Any], what: str, seconds: float) -> None:
        """Fail if a state meets a condition within some seconds; raises ClauseFailedError."""
        if await self.came_true(lambda: self.heard.state and condition(self.heard.state), seconds):
            raise ClauseFailedError(f"{what}; {self.describe()}")

    def describe(self) -> str:
        """Return the robot's last state in words."""
        state = self.heard.state
        if state is None:
            return "the robot has sent no readable state"
        errors = ", ".join(map(_in_words, state.errors)) or "none"
        nodes = ", ".join(node.node_id for node in state.node_states) or "none"
        order = f"orderId {state.order_id!r}, orderUpdateId {state.order_update_id}"
        drive = f"lastNodeId {state.last_node_id!r}, nodeStates {nodes}, driving {str(state.driving).lower()}"
        return f"the last state has {order}, {drive}, errors {errors}"

    def require_plan(self, places: int) -> None:
        """Raise NotApplicableError if the plan has fewer places."""
        if len(self.plan) < places:
            raise NotApplicableError(
                f"the robot drives to {places} places; pass --place x,y for each that it may drive to"
            )

    def send(self, topic: Topic, message: Header) -> None:
        """Send a message with a header of the robot's version."""
        header = {
            "header_id": self._headers[topic],
            "timestamp": datetime.now(UTC),
            "version": self.codec.version,
            "manufacturer": self.robot.manufacturer,
            "serial_number": self.robot.serial_number,
        }
        self._headers[topic] += 1
        self.send_bytes(topic, self.codec.encode(message.model_copy(update=header)))

    def send_bytes(self, topic: Topic, payload: bytes) -> None:
        """Send any payload."""
        self._link.publish(Outbound(self._topics.of(self.robot, topic), payload, qos=1))

    def send_json(self, topic: Topic, content: dict[str, Any]) -> None:
        """Send a message that no codec would write; the header is added."""
        header = {
            "headerId": self._headers[topic],
            "timestamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "version": self.codec.version,
            "manufacturer": self.robot.manufacturer,
            "serialNumber": self.robot.serial_number,
        }
        self._headers[topic] += 1
        self.send_bytes(topic, to_json({**header, **content}))

    async def instant(self, action_type: str, **parameters: object) -> ActionState:
        """Send an instant action and wait for its end.

        Raises:
            ClauseFailedError: the robot shows no state of it, or it does not end.
        """
        action_id = self.send_instant(action_type, **parameters)
        found: list[ActionState] = []

        def look() -> bool:
            state = self.instant_state(action_id)
            if state and state.action_status.ended:
                found.append(state)
            return bool(found)

        await self.until(look, f"the end of {action_type}")
        return found[0]

    def require_end(self, found: ActionState, wanted: ActionStatus) -> None:
        """Raise ClauseFailedError with the robot's own words unless an action has ended as it should."""
        if found.action_status is not wanted:
            result = f" ({found.action_result})" if found.action_result else ""
            raise ClauseFailedError(
                f"{found.action_type} ended {found.action_status}{result}, not {wanted}; {self.describe()}"
            )

    def send_instant(self, action_type: str, **parameters: object) -> str:
        """Send an instant action; return its ID."""
        pairs = tuple({"key": key, "value": value} for key, value in parameters.items())
        action = Action.model_validate(
            {
                "action_type": action_type,
                "action_id": uuid4().hex,
                "blocking_type": BlockingType.NONE,
                "action_parameters": pairs,
            }
        )
        self.send(Topic.INSTANT_ACTIONS, InstantActions(**NO_HEADER, actions=(action,)))
        return action.action_id

    def instant_state(self, action_id: str) -> ActionState | None:
        """Return the state of an action, if the robot shows it."""
        state = self.heard.state
        # 2.x has one list for all actions, 3.0 one for instant actions.
        states = (*state.instant_action_states, *state.action_states) if state else ()
        return next((each for each in states if each.action_id == action_id), None)

    def order(self, order_id: str, update: int, nodes: Sequence[Node], first_sequence: int = 0) -> Order:
        """Return an order along nodes, whose edges are released with the node behind them."""
        numbered = [
            node.model_copy(update={"sequence_id": first_sequence + 2 * at}) for at, node in enumerate(nodes)
        ]
        edges = tuple(
            Edge(
                edge_id=f"{start.node_id}-{end.node_id}",
                sequence_id=start.sequence_id + 1,
                released=end.released,
                actions=(),
            )
            for start, end in pairwise(numbered)
        )
        return Order(
            **NO_HEADER, order_id=order_id, order_update_id=update, nodes=tuple(numbered), edges=edges
        )

    @property
    def _position(self) -> MobileRobotPosition | None:
        return self.heard.state.mobile_robot_position if self.heard.state else None

    @property
    def map_id(self) -> str:
        """Map on which the robot stands."""
        return self._position.map_id if self._position else "map"

    @property
    def stand(self) -> Place:
        """Where the robot stands; raises ClauseFailedError if it has not said so."""
        if self._position is None:
            raise ClauseFailedError("the robot has reported no position")
        return self._position.x, self._position.y

    def here(self, *, actions: tuple[Action, ...] = ()) -> Node:
        """Return a node where the robot stands: the last one of an earlier order, or a new one."""
        last = self.heard.state.last_node_id if self.heard.state else ""
        return self._node_at(last or "here", self.stand, actions=actions)

    def node(self, place: int, *, released: bool = True) -> Node:
        """Return a node at a place of the plan."""
        return self._node_at(f"place-{place}", self.plan[place], released=released)

    def _node_at(
        self, name: str, at: Place, *, released: bool = True, actions: tuple[Action, ...] = ()
    ) -> Node:
        position = NodePosition(x=at[0], y=at[1], map_id=self.map_id)
        return Node(node_id=name, sequence_id=0, released=released, node_position=position, actions=actions)

    async def accepted(self, order: Order) -> State:
        """Send an order and wait until the robot shows it; raises ClauseFailedError."""
        self.send(Topic.ORDER, order)
        return await self.state(
            lambda state: (state.order_id, state.order_update_id) == (order.order_id, order.order_update_id),
            f"order {order.order_id!r}, update {order.order_update_id} in the state",
        )

    async def ask(self, what: str) -> None:
        """Wait until a person at the robot has done something; raises NotApplicableError without one."""
        if self._person is None:
            raise NotApplicableError(f"pass --person if somebody at the robot can {what}")
        await self._person(what)

    async def refused(self, order_id: str, errors: Errors, what: str) -> State:
        """Wait for a new error, and check that the order was not taken; raises ClauseFailedError."""
        state = await self.state(lambda state: new_errors(state, errors), f"an error about {what}")
        if state.order_id == order_id:
            raise ClauseFailedError(f"the robot took {what}; {self.describe()}")
        return state

    async def done(self, order_id: str, within: float | None = None) -> State:
        """Wait until the robot has finished an order; raises ClauseFailedError."""
        return await self.state(
            lambda state: state.order_id == order_id and not state.node_states and not state.driving,
            f"the end of order {order_id!r}",
            within,
        )

    @property
    def errors(self) -> Errors:
        """Return the errors of the last state."""
        return self.heard.state.errors if self.heard.state else ()

    async def clear(self) -> None:
        """Cancel what is left of an order, so that the next clause begins with a robot that stands."""
        state = self.heard.state
        if state is None:
            return
        if state.paused:
            await self.instant("stopPause")
        if state.node_states or state.driving:
            await self.instant("cancelOrder")
            await self.state(lambda now: not now.driving and not now.node_states, "a robot that stands")


def _in_words(error: ErrorEntry) -> str:
    return f"{error.error_type} ({error.error_description})" if error.error_description else error.error_type


Errors = tuple[ErrorEntry, ...]


def new_errors(state: State, before: Errors) -> Errors:
    """Return the errors of a state that were not there before."""
    return tuple(each for each in state.errors if each not in before)


NO_HEADER: Final[dict[str, Any]] = {
    "header_id": 0,
    "timestamp": datetime(2000, 1, 1, tzinfo=UTC),
    "version": "2.1.0",
    "manufacturer": "-",
    "serial_number": "-",
}
"""Replaced when a message is sent."""


def new_id() -> str:
    """Return an ID for an order."""
    return f"test-{uuid4().hex[:12]}"
