"""The MQTT messages of one robot: outgoing ones with header and topic, and incoming ones (section 6)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, TypeVar

from nena_edge_agent.driver.port import DriveLimits
from nena_edge_agent.factsheet import make_factsheet
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.declaration import INITIALIZE_POSITION, ActionDeclaration
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import (
    Event,
    InstantActionsReceived,
    MessageRefused,
    OrderReceived,
    ResponsesReceived,
    ZoneSetReceived,
)
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.mqtt.identity import private_client_id
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.action import Action, ActionParameter, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS, MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.deviations import Deviations
from nena_shared.vda5050.error import ErrorReference, ErrorType, error
from nena_shared.vda5050.malformed import TWICE, MalformedMessageError, quoted, repeated_key
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.repair import FULL_TURN, Repair, RepairKind, meant_map
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import topics_for
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.zone_set import ZoneSetTransfer

WRAP = 2**32
# A record per message would cost more; a reader may drop a message whose headerId is not newer (0018).
RESERVE = 100
"""Number of headerIds reserved at once; a restart skips at most as many."""
TOPICS = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
"""Topics that a robot publishes."""

Reserved = tuple[tuple[Topic, int], ...]
"""The first unreserved headerId of each topic."""


class HeaderMaker:
    """Counts the messages of each topic, from 0 or after those of an earlier run (section 7.2).

    HeaderIds are reserved on disk before they are used, so that none is used twice. A robot whose disk fails
    continues to count, because fleet control must accept a counter that restarts.
    """

    def __init__(self, robot: RobotKey, *, version: str, clock: Clock, reserved: Reserved = ()) -> None:
        self._robot = robot
        self._version = version
        self._clock = clock
        self._counts: Counter[Topic] = Counter(dict(reserved))
        self._reserved: dict[Topic, int] = {}

    def reserve(self) -> Reserved:
        """Return the first unreserved headerId of each topic (VDA 5050 3.0 section 7.2).

        More headerIds are reserved once half of them are used.
        """
        for topic in TOPICS:
            # Modulo 2^32, as headerIds count (7.2).
            left = (self._reserved.get(topic, 0) - self._counts[topic]) % WRAP
            if not RESERVE // 2 <= left <= RESERVE:
                self._reserved[topic] = (self._counts[topic] + RESERVE) % WRAP
        return tuple(self._reserved.items())

    def make(self, topic: Topic) -> dict[str, Any]:
        """Return the header of the next message on ``topic``, by its neutral names (section 7.2)."""
        number = self._counts[topic]
        self._counts[topic] = (number + 1) % WRAP
        return self.form(number)

    def form(self, number: int) -> dict[str, Any]:
        """Return a header with this headerId, without counting it."""
        return {
            "header_id": number,
            "timestamp": self._clock.now(),
            "version": self._version,
            "manufacturer": self._robot.manufacturer,
            "serial_number": self._robot.serial_number,
        }

    def last_id(self, topic: Topic) -> int:
        """Return the headerId of the last message on ``topic``; 0 before the first."""
        return max(0, self._counts[topic] - 1)


def client_id_of(robot: RobotKey, topics: TopicScheme, settings: MqttSettings) -> str:
    """Return the robot's MQTT client ID, unless the settings name one.

    It contains the interface name, because robots of two fleets at one broker may have the same name.

    Raises:
        ConfigurationError: a file with the robot's secret cannot be read.
    """
    fleet = topics.interface_name.replace("/", "-")
    return private_client_id(f"nena-edge-agent-{fleet}-{robot.manufacturer}-{robot.serial_number}", settings)


class RobotMessages:
    """Builds the robot's outgoing messages; each gets the next headerId of its topic."""

    def __init__(
        self,
        settings: EdgeAgentSettings,
        robot: RobotKey,
        capabilities: Capabilities,
        *,
        codec: Codec,
        clock: Clock,
        reserved: Reserved = (),
    ) -> None:
        self._settings = settings
        self._robot = robot
        self._capabilities = capabilities
        self.codec = codec
        self.topics = topics_for(settings.version, settings.interface_name)
        self.headers = HeaderMaker(robot, version=settings.version, clock=clock, reserved=reserved)

    def make_inbox(
        self, put: Callable[[Event], None], clock: Clock, map_ids: Callable[[], frozenset[str]]
    ) -> Inbox:
        """Return the reader of the robot's incoming messages; ``map_ids`` returns those of its maps."""
        return Inbox(
            self.codec,
            self._robot,
            put,
            clock,
            map_ids=map_ids,
            actions=self._capabilities.actions,
            strict=self._settings.strict,
        )

    def topic(self, topic: Topic) -> str:
        """Return the robot's MQTT topic (VDA 5050 3.0 section 4.2)."""
        return self.topics.of(self._robot, topic)

    def connection(self, state: ConnectionState) -> Outbound:
        """Return the connection message (section 6.5), retained.

        It is queued while the link connects: an agent that stops between its ONLINE message and the end of
        the connect must not remain ONLINE.
        """
        message = Connection(**self.headers.make(Topic.CONNECTION), connection_state=state)
        # The only topic that the standard wants with QoS 1 (4.1; 2.1: 6.2), whatever the setting `qos` says.
        return self._outbound_message(Topic.CONNECTION, message, qos=1, retain=True, keep=True)

    def factsheet(self, limits: DriveLimits | None = None) -> Outbound:
        """Return the factsheet message (section 6.10), retained; ``limits`` are those of navigation."""
        header = self.headers.make(Topic.FACTSHEET)
        message = make_factsheet(header, self._settings, self._capabilities, limits)
        return self._outbound_message(Topic.FACTSHEET, message, qos=self._settings.qos, retain=True)

    def state(self, message: State, *, keep: bool) -> Outbound:
        """Return the state message (section 6.6); ``keep``: queue it until the link can send it."""
        return self._outbound_message(Topic.STATE, message, qos=self._settings.qos, keep=keep)

    def visualization(self, message: Visualization) -> Outbound:
        """Return the visualization message (section 6.7), which is dropped if the link is down."""
        # QoS 0 as in the standard (4.1; 2.1: 6.2): the next message makes up for a lost one.
        return self._outbound_message(Topic.VISUALIZATION, message, qos=0)

    def _outbound_message(
        self, topic: Topic, message: Header, *, qos: int, retain: bool = False, keep: bool = False
    ) -> Outbound:
        return Outbound(self.topic(topic), self.codec.encode(message), qos=qos, retain=retain, keep=keep)


log = get_logger(__name__)
M = TypeVar("M", bound=Header)


# The standard ends such an error by the next accepted order (6.6.5.4), which does not concern these topics.
_UNTIL = {
    Topic.INSTANT_ACTIONS: Until.INSTANT_ACTION_ACCEPTED,
    Topic.ZONE_SET: Until.ZONE_SET_ACCEPTED,
}
"""What ends the error of a refused message; by default, the next accepted order."""


@dataclass(slots=True)
class InboxCounts:
    """Numbers of received messages."""

    taken: int = 0
    malformed: int = 0
    repaired: int = 0
    """Messages that violated the standard but whose meaning was clear."""
    misdirected: int = 0
    retained: int = 0


COMMANDS: Final = (Topic.ORDER, Topic.INSTANT_ACTIONS)
"""Topics on which every robot receives messages."""
OF_ZONES: Final = (Topic.ZONE_SET, Topic.RESPONSES)
"""Those of a robot with zones."""

NO_ACTIONS: Final[Mapping[str, ActionDeclaration]] = MappingProxyType({})


class Inbox:
    """Reads fleet control's messages to one robot; ``actions`` are the declarations of its actions."""

    def __init__(
        self,
        codec: Codec,
        robot: RobotKey,
        put: Callable[[Event], None],
        clock: Clock,
        *,
        map_ids: Callable[[], frozenset[str]] = frozenset,
        actions: Mapping[str, ActionDeclaration] = NO_ACTIONS,
        strict: bool = False,
    ) -> None:
        self._codec = codec
        self._actions = actions
        self._robot = robot
        self._put = put
        self._clock = clock
        self._map_ids = map_ids
        self._strict = strict
        self._deviations = Deviations(clock)
        self._log = log.bind(robot=str(robot))
        self._dated = True
        """Whether the timestamp of the current message is readable."""
        self.counts = InboxCounts()

    def take_message(self, topic: Topic, message: Inbound) -> None:
        """Read a message of this topic (VDA 5050 3.0 section 4.3)."""
        now = self._clock.now()
        match self._read_message(KINDS[topic], message, topic):
            case Order() as order:
                self._log.info("order received", order=order.order_id, update=order.order_update_id)
                self._put(OrderReceived(order, now, dated=self._dated))
            case InstantActions() as actions:
                self._put(InstantActionsReceived(actions, now))
            case ZoneSetTransfer() as transfer:
                self._put(ZoneSetReceived(transfer))
            case Responses() as responses:
                self._put(ResponsesReceived(responses, now))

    def _read_message(self, kind: type[M], message: Inbound, topic: Topic) -> M | None:
        # An empty retained message deletes the retained one (MQTT 3.1.1, 3.3.1.3).
        if not message.payload:
            self._log.debug("empty message ignored: it clears a retained one", topic=topic)
            return None
        # A retained command would be executed again after each reconnect (4.1 forbids it).
        if message.retained:
            self.counts.retained += 1
            self._log.warning("retained command ignored; it may be old", topic=message.topic)
            return None
        try:
            command = self._decode_message(kind, message.payload, topic)
        except MalformedMessageError as malformed:
            self.counts.malformed += 1
            problem = f"not a valid {malformed.kind}: {'; '.join(malformed.quoted_problems)}"
            self._refuse_message(problem, topic, malformed.references)
            return None
        addressee = RobotKey(command.manufacturer, command.serial_number)
        # The header names the robot in both directions (7.2; 2.1: 6.4): another name means a wrong topic.
        if addressee != self._robot:
            self.counts.misdirected += 1
            references = {"headerId": str(command.header_id)}
            self._refuse_message(f"the header names the robot {addressee}", topic, references)
            return None
        self.counts.taken += 1
        return command

    def _decode_message(self, kind: type[M], payload: bytes, topic: Topic) -> M:
        self._dated = True
        if len(payload) <= MAXIMUM_PAYLOAD and (key := repeated_key(payload)):
            raise MalformedMessageError(kind.__name__, [f"{key}: {TWICE}"], payload)
        # A strict robot refuses what violates the standard; others repair what has only one meaning.
        if self._strict:
            return self._codec.decode(kind, payload)
        maps, now = self._map_ids(), self._clock.now()
        command, repairs = read_command(kind, self._codec, payload, now=now, robot=self._robot, maps=maps)
        # The type of a parameter's value is in the robot's factsheet (7.10), not in the message's schema.
        command, texts = self._with_values(command)
        repairs += texts
        if repairs:
            self.counts.repaired += 1
            self._dated = not any(repair.kind is RepairKind.TIME_OF_ARRIVAL for repair in repairs)
            self._deviations.note(self._robot, topic.value, repairs)
        return command

    def _with_values(self, message: M) -> tuple[M, tuple[Repair, ...]]:
        """Return the message with action parameters converted to their types if they were sent as strings."""
        repairs: list[Repair] = []
        changes: dict[str, object] = {}

        def read(actions: tuple[Action, ...], at: str) -> tuple[Action, ...]:
            return tuple(
                self._read_action(action, f"{at}actions.actionParameters.value", repairs)
                for action in actions
            )

        if isinstance(message, InstantActions):
            changes = {"actions": read(message.actions, "")}
        elif isinstance(message, Order):
            changes = {
                name: tuple(
                    part.model_copy(update={"actions": read(part.actions, f"{name}.")})
                    if part.actions
                    else part
                    for part in parts
                )
                for name, parts in (("nodes", message.nodes), ("edges", message.edges))
            }
        return message.model_copy(update=changes), tuple(dict.fromkeys(repairs))

    def _read_action(self, action: Action, at: str, repairs: list[Repair]) -> Action:
        declared = self._actions.get(action.action_type)
        if action.action_type == INITIALIZE_POSITION:
            action = self._complete_position(action, at, repairs)
        changed = declared.read(action) if declared else action
        for old, new in zip(action.action_parameters, changed.action_parameters, strict=True):
            if new.value is not old.value:
                if isinstance(old.value, str):
                    boolean = isinstance(new.value, bool)
                    kind = RepairKind.TEXT_AS_BOOLEAN if boolean else RepairKind.TEXT_AS_NUMBER
                else:
                    beyond = isinstance(old.value, int | float) and abs(old.value) > FULL_TURN
                    kind = RepairKind.DEGREES if beyond else RepairKind.ANGLE_WRAPPED
                repairs.append(Repair(at, kind, quoted(old.value)))
        return changed

    def _complete_position(self, action: Action, at: str, repairs: list[Repair]) -> Action:
        node, map_id = action.parameter("lastNodeId"), action.parameter("mapId")
        meant = (
            ("lastNodeId", node, None if node else ""),
            ("mapId", map_id, meant_map(map_id, self._map_ids())),
        )
        for key, sent, value in meant:
            if value is not None and sent != value:
                others = [each for each in action.action_parameters if each.key != key]
                others.append(ActionParameter(key=key, value=value))
                action = action.model_copy(update={"action_parameters": tuple(others)})
                received = "missing" if sent is None else quoted(sent)
                kind = RepairKind.LETTER_CASE if sent else RepairKind.REPLACED
                repairs.append(Repair(at, kind, f"{key} {received}"))
        return action

    def _refuse_message(self, problem: str, topic: Topic, references: dict[str, str]) -> None:
        self._log.warning("message refused", topic=topic.value, problem=problem, **references)
        entry = error(
            ErrorType.VALIDATION_FAILURE,
            problem,
            hint="correct the message and send it again; nothing was changed",
            topic=topic.value,
        )
        named = tuple(
            ErrorReference(reference_key=key, reference_value=value) for key, value in references.items()
        )
        entry = entry.model_copy(update={"error_references": (*entry.error_references, *named)})
        self._put(MessageRefused(entry, _UNTIL.get(topic, Until.ORDER_ACCEPTED)))
