"""Fleet control over MQTT: read robots' messages of any version, and publish what the core decides."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from math import pi, remainder, tau
from typing import Any, Final, Protocol, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json, to_json

from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outputs import (
    FleetOutput,
    Outputs,
    Publish,
    PublishInstantActions,
    PublishOrder,
    PublishResponses,
    PublishZoneSet,
)
from nena_order_service.fleet.robot import NO_TIME, LinkStatus, MessageOrder, RobotView, header_text
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.statistics import FleetStatistics
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.clock import Clock
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.stops import DIRECT_ACTION
from nena_shared.fleet_api.topics import suits_all_brokers
from nena_shared.log import get_logger
from nena_shared.mqtt import BrokerLink, Inbound, Outbound
from nena_shared.plant import Vehicle
from nena_shared.plant.driver_properties import TOPIC_PREFIX
from nena_shared.plant.fleet_checks import KEY_LENGTH
from nena_shared.plant.property_keys import VDA5050_INTERFACE_NAME
from nena_shared.rate_limit import MessageRate
from nena_shared.settings import ConfigurationError, TopicPrefix
from nena_shared.tasks import forever
from nena_shared.vda5050.action import Action, InstantActions, text_of
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.deviations import Deviations
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError, quoted
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.records import changed
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.robot_sources import Dated, RobotSources
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1.parameter import neutral_path
from nena_shared.vda5050.versions import CODECS, UnknownVersionError, codec_named
from nena_shared.vda5050.zone_set import ZoneSet, ZoneSetTransfer

R = ReasonCode

log = get_logger(__name__)

_TOPIC_PREFIX: Final[TypeAdapter[str | None]] = TypeAdapter(TopicPrefix | None)


Message = Order | InstantActions | Responses | ZoneSetTransfer


@dataclass(frozen=True, slots=True)
class RobotAddress:
    """A robot's version of VDA 5050, and its topics."""

    codec: Codec
    scheme: TopicScheme


TURNED_WITHIN: Final = pi / 4
"""Default accepted deviation from the heading at the last node, rad."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """Deviations of a robot from the standard that must be configured in the plant model."""

    parameters_as_text: bool = False
    instant_actions_key: str = ""
    keeps_last_node_states: bool = False
    omitted_fields: tuple[str, ...] = ()
    """Paths of fields that its orders must not have."""

    @classmethod
    def from_vehicle(cls, vehicle: Vehicle) -> Dialect:
        """Read the properties of a vehicle."""
        key = vehicle.instant_actions_key or ""
        # properties name fields as 2.x does, and 3.0 has other names
        omitted = {name for field in vehicle.omitted_fields for name in (field, neutral_path(field))}
        return cls(vehicle.parameters_as_text, key, vehicle.keeps_last_node_states, tuple(sorted(omitted)))

    def to_readable(self, message: Message) -> Message:
        """Return a message in the form that the robot can read."""
        if not self.parameters_as_text:
            return message
        if isinstance(message, InstantActions):
            return message.model_copy(update={"actions": _as_text(message.actions)})
        if isinstance(message, Order):
            changes = {
                name: tuple(part.model_copy(update={"actions": _as_text(part.actions)}) for part in parts)
                for name, parts in (("nodes", message.nodes), ("edges", message.edges))
            }
            return message.model_copy(update=changes)
        return message

    def rename_keys(self, topic: Topic, payload: bytes) -> bytes:
        """Return an encoded message with the keys that the robot expects, and without those it refuses."""
        if topic is Topic.ORDER and self.omitted_fields:
            order = from_json(payload)
            for path in self.omitted_fields:
                _omit(order, path.split("."))
            return to_json(order)
        if topic is not Topic.INSTANT_ACTIONS or not self.instant_actions_key:
            return payload
        content = from_json(payload)
        content[self.instant_actions_key] = content.pop("actions")
        return to_json(content)

    def to_standard(self, state: State, *, outdated: bool = False) -> State:
        """Return a state as the standard requires it: without nodeStates at the last node.

        ``outdated``: its last node may belong to the previous order, and the robot may still have to turn.
        """
        if not self.keeps_last_node_states or not state.node_states or state.driving:
            return state
        last = state.node_states[-1]
        if (last.node_id, last.sequence_id) != (state.last_node_id, state.last_node_sequence_id):
            return state
        # An order that ends where the robot stands may still ask it to turn: then it has not begun.
        pose, place = state.mobile_robot_position, last.node_position
        if outdated and pose and place and place.theta is not None:
            allowed = place.allowed_deviation_theta or TURNED_WITHIN
            if abs(remainder(pose.theta - place.theta, tau)) > allowed:
                return state
        return changed(state, node_states=(), edge_states=())


class LastNodes:
    """Detects last nodes that may belong to the previous order, because some robots reset them late."""

    def __init__(self) -> None:
        self._current: dict[RobotKey, str] = {}
        """By robot, the order during which it has reported a last node other than the order's last one."""

    def may_be_outdated(self, robot: RobotKey, state: State, vda_order: VdaOrder | None) -> bool:
        """Return whether a robot may report the end of an order that it has not begun."""
        if vda_order is None or state.order_id != vda_order.order_id:
            return False
        first, last = vda_order.nodes[0], vda_order.nodes[-1]
        if (state.last_node_id, state.last_node_sequence_id) != (last.node_id, last.sequence_id):
            self._current[robot] = state.order_id
        # Only an order that ends at its first node looks ended before it has begun.
        return first.node_id == last.node_id and self._current.get(robot) != state.order_id


def in_letters_of(vda_order: VdaOrder, state: State) -> tuple[State, tuple[Repair, ...]]:
    """Return a state with the IDs of the robot's order in the letter case in which they were sent."""
    if state.order_id == vda_order.order_id and not state.action_states:
        return state, ()  # most states, in a tenth of the time
    ours = {each.casefold(): each for each in (vda_order.order_id, *vda_order.action_ids)}
    ids = [action.action_id for action in state.action_states]
    others = [each for each in (state.order_id, *ids) if ours.get(each.casefold(), each) != each]
    if not others:
        return state, ()
    actions = (
        changed(each, action_id=ours.get(each.action_id.casefold(), each.action_id))
        for each in state.action_states
    )
    order_id = ours.get(state.order_id.casefold(), state.order_id)
    fields = ("actionStates.actionId" if each in ids else "orderId" for each in others)
    repairs = (
        Repair(field, RepairKind.LETTER_CASE, quoted(each))
        for field, each in zip(fields, others, strict=True)
    )
    return changed(state, order_id=order_id, action_states=tuple(actions)), tuple(repairs)


def _omit(part: Any, path: list[str]) -> None:  # noqa: ANN401 - a part of a JSON document
    """Remove the field at ``path``, in each item of lists along it."""
    if isinstance(part, list):
        for item in part:
            _omit(item, path)
    elif isinstance(part, dict) and len(path) == 1:
        part.pop(path[0], None)
    elif isinstance(part, dict):
        _omit(part.get(path[0]), path[1:])


def _as_text(actions: tuple[Action, ...]) -> tuple[Action, ...]:
    return tuple(action.with_values(lambda each: text_of(each.value)) for action in actions)


STANDARD: Final = Dialect()


class RobotAddresses:
    """Keeps the version and topics of each robot: of its last valid message, initially of the plant model.

    ``schemes`` are the default topics, one per major version.
    """

    def __init__(self, schemes: Sequence[TopicScheme]) -> None:
        self._defaults = {scheme.major_version: scheme for scheme in schemes}
        self._schemes = dict.fromkeys(schemes)
        self._addresses: dict[RobotKey, RobotAddress] = {}
        self._sources = RobotSources()
        self._dialects: dict[RobotKey, Dialect] = {}
        self._expected: dict[RobotKey, tuple[RobotAddress, ...]] = {}
        self._by_letters: dict[str, RobotKey] = {}
        """Robots of the plant model by their names in small letters; by the serial number if it is unique."""

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """All topics that robots may use."""
        return tuple(self._schemes)

    def expect_vehicles(self, vehicles: Iterable[tuple[RobotKey, Vehicle]]) -> None:
        """Note the versions and interface names of vehicles in the plant model.

        Raises:
            ConfigurationError: it names an unsupported version, an invalid interface name, or a robot whose
                name is too long for the store.
        """
        for robot, vehicle in vehicles:
            if len(str(robot)) > KEY_LENGTH:
                message = (
                    f"plant: vehicle '{vehicle.name[:60]}': manufacturer and serial number have more than "
                    f"{KEY_LENGTH} characters together"
                )
                raise ConfigurationError([message])
            if not suits_all_brokers(robot):
                log.warning(
                    "some brokers refuse or change topics with this manufacturer or serial number: NATS "
                    "accepts no '.' and no space, RabbitMQ no '.'",
                    vehicle=vehicle.name,
                    robot=str(robot),
                )
            self._dialects[robot] = Dialect.from_vehicle(vehicle)
            name = _read_prefix(vehicle, VDA5050_INTERFACE_NAME)
            schemes = [
                TopicScheme(name or default.interface_name, major)
                for major, default in self._defaults.items()
            ]
            if prefix := _read_prefix(vehicle, TOPIC_PREFIX):
                schemes = [TopicScheme.below(prefix, vehicle.protocol_version, robot)]
            self._schemes.update(dict.fromkeys(schemes))
            if vehicle.protocol_version:
                codec = _configured_codec(vehicle, vehicle.protocol_version)
                scheme = next(each for each in schemes if each.major_version == codec.major_version)
                self._addresses[robot] = RobotAddress(codec, scheme)
                self._sources.expect(robot, scheme)
            self._expected[robot] = tuple(map(_oldest_address, schemes))
        serials = Counter(robot.serial_number.casefold() for robot in self._expected)
        for robot in self._expected:
            self._by_letters[str(robot).casefold()] = robot
            if serials[serial := robot.serial_number.casefold()] == 1:
                self._by_letters[serial] = robot

    def dialect_of(self, robot: RobotKey) -> Dialect:
        """Return the configured deviations of ``robot`` from the standard."""
        return self._dialects.get(robot, STANDARD)

    @property
    def expected(self) -> Collection[RobotKey]:
        """The robots of the plant model."""
        return self._expected.keys()

    def addresses_of(self, robot: RobotKey) -> tuple[RobotAddress, ...]:
        """Return the version and topics of ``robot``; all that it may use if they are not known yet."""
        address = self._addresses.get(robot)
        if address:
            return (address,)
        return self._expected.get(robot) or tuple(map(_oldest_address, self._defaults.values()))

    def similar_to(self, topic: str) -> tuple[RobotKey, str] | None:
        """Return the robot whose topic is probably meant, and its topic; None for a right or another one."""
        *_, manufacturer, serial_number, name = ["", "", *topic.split("/")]
        robot = RobotKey(manufacturer, serial_number)
        alike = (self._by_letters.get(name.casefold()) for name in (str(robot), serial_number))
        meant = robot if robot in self._expected else next(filter(None, alike), None)
        if meant is None:
            return None
        level = Topic(name) if name in set(Topic) else Topic.CONNECTION
        if any(address.scheme.of(meant, level) == topic for address in self._expected[meant]):
            return None
        return meant, self.addresses_of(meant)[0].scheme.of(meant, level)

    def learn_source(
        self, robot: RobotKey, codec: Codec, scheme: TopicScheme, message: Dated, *, retained: bool
    ) -> bool:
        """Store the source of a message of ``robot``, to which answers are sent.

        Return False if the message is outdated; see :class:`RobotSources`.
        """
        if not self._sources.accepts(robot, scheme, message, retained=retained):
            return False
        previous = self._addresses.get(robot)
        if previous and previous.codec is codec and previous.scheme == scheme:
            return True
        self._addresses[robot] = RobotAddress(codec, scheme)
        log.info(
            "robot uses VDA 5050",
            robot=str(robot),
            version=codec.version,
            interface_name=scheme.interface_name,
            before=previous.codec.version if previous else None,
        )
        return True


def _configured_codec(vehicle: Vehicle, version: str) -> Codec:
    try:
        return codec_named(version)
    except UnknownVersionError as error:
        message = f"plant: vehicle '{vehicle.name}', property vda5050:version: {error}"
        raise ConfigurationError([message]) from error


def _oldest_address(scheme: TopicScheme) -> RobotAddress:
    """Return the address of a robot of unknown version: newer minor versions understand the oldest one."""
    version = next(number for number in CODECS if f"v{number.partition('.')[0]}" == scheme.major_version)
    return RobotAddress(CODECS[version], scheme)


def _read_prefix(vehicle: Vehicle, key: str) -> str | None:
    try:
        return _TOPIC_PREFIX.validate_python(vehicle.properties.get(key) or None)
    except ValidationError as error:
        problem = error.errors()[0]["msg"]
        message = f"plant: vehicle '{vehicle.name}', property {key}: {problem}"
        raise ConfigurationError([message]) from error


HEADER_ID_COUNT: Final = 2**32


HeaderIds = dict[tuple[RobotKey, Topic], int]
"""The next headerId by robot and topic."""


class Outgoing:
    """Builds the messages, with headerIds counted per robot and topic (section 7.2).

    Commands contain the ``epoch`` of the order service, unless it is 0; a robot refuses commands of older
    epochs, and those of the same epoch whose headerId is not greater than that of the last accepted order.
    """

    def __init__(self, clock: Clock, epoch: int = 0, header_ids: HeaderIds | None = None) -> None:
        """``header_ids`` are those that the epoch has reached; None: they begin at 0."""
        self._clock = clock
        self._epoch = epoch or None
        self._header_ids = {} if header_ids is None else header_ids

    def make_message(self, output: Publish, version: str) -> tuple[Topic, Message]:
        """Return the message and its topic."""
        match output:
            case PublishOrder():
                header = self._next_header(output.robot, Topic.ORDER, version)
                return Topic.ORDER, Order(
                    **header,
                    nena_epoch=self._epoch,
                    order_id=output.vda_order.order_id,
                    order_update_id=output.order_update_id,
                    nodes=output.vda_order.nodes,
                    edges=output.vda_order.edges,
                )
            case PublishInstantActions():
                header = self._next_header(output.robot, Topic.INSTANT_ACTIONS, version)
                return Topic.INSTANT_ACTIONS, InstantActions(
                    **header, nena_epoch=self._epoch, actions=output.actions
                )
            case PublishResponses():
                header = self._next_header(output.robot, Topic.RESPONSES, version)
                return Topic.RESPONSES, Responses(**header, responses=output.responses)
            case PublishZoneSet():
                header = self._next_header(output.robot, Topic.ZONE_SET, version)
                return Topic.ZONE_SET, ZoneSetTransfer(**header, zone_set=output.zone_set)

    def _next_header(self, robot: RobotKey, topic: Topic, version: str) -> dict[str, Any]:
        header_id = self._header_ids.get((robot, topic), 0)
        self._header_ids[robot, topic] = (header_id + 1) % HEADER_ID_COUNT
        return {
            "header_id": header_id,
            "timestamp": self._clock.now(),
            "version": version,
            "manufacturer": robot.manufacturer,
            "serial_number": robot.serial_number,
        }


M = TypeVar("M", Connection, Factsheet, State)
Take = Callable[[RobotKey, M, float], Outputs]

MALFORMED_LOGGED_EACH: Final = 100
"""Of a robot's malformed messages, the first and then one in this many are logged."""

COMMANDS: Final = (Topic.ORDER, Topic.INSTANT_ACTIONS)
SENT_REMEMBERED: Final = 10_000
"""Number of our own commands that are recognised when the broker returns them."""
LOGGED_OF_COMMAND: Final = 300

SEARCHED_AFTER: Final = 10.0
"""Seconds after a connect after which robots that are not heard of are searched for on similar topics."""
SIMILAR_TOPICS: Final = tuple(
    f"{'+/' * levels}{name}" for levels in range(2, 6) for name in ("connection", "connect")
)
"""Retained topics on which robots with another interface name, version level or topic name are found."""

READ_WITHIN: Final = 2.0
"""Seconds within which waiting messages are read before timeouts are checked: under load, orders were sent
again although the robots' answers were there."""

LOGGED_OF_NAME: Final = 60
"""Characters of a name that is too long."""


class FleetListener(Protocol):
    """Follows VDA orders and messages; ``now`` is monotonic, s."""

    def begun(self, order_id: str, now: float, *, restored: bool) -> None:
        """Handle a VDA order that is to be sent, or was ``restored`` after a restart."""
        ...

    def published(self, topic: Topic, output: Publish, now: float) -> None:
        """Handle a message to a robot."""
        ...

    def happened(self, event: FleetOutput, now: float) -> None:
        """Handle an event of the core."""
        ...


class FleetLink:
    """Connects a :class:`FleetController` with the broker; call all methods in the event loop's thread.

    ``on_events`` receives the core's events in order, once per call and within that call; it may call this
    object again. Sending never waits for the broker: the core resends messages that no state echoes.
    """

    def __init__(
        self,
        mqtt: BrokerLink,
        *,
        addresses: RobotAddresses,
        settings: FleetSettings,
        clock: Clock,
        on_events: Callable[[*tuple[FleetOutput, ...]], None],
        epoch: int = 0,
        header_ids: HeaderIds | None = None,
        only_map: str = "",
        nodes: Iterable[str] = (),
        make_reader: Callable[..., MessageReader] = MessageReader,
    ) -> None:
        """``only_map``: the plant's map, empty if it does not have exactly one; ``nodes``: its points."""
        self._mqtt = mqtt
        self._addresses = addresses
        self._settings = settings
        self._now = clock.monotonic
        self._on_events = on_events
        self._outgoing = Outgoing(clock, epoch, header_ids)
        self._last_nodes = LastNodes()
        self._connected = False
        self._term = 0
        self._undated: dict[RobotKey, MessageOrder] = {}
        """By robot with unreadable timestamps, the message order by headerId alone."""
        self.statistics = FleetStatistics()
        self.listeners: list[FleetListener] = [self.statistics]
        self._sent: dict[int, None] = {}
        """Hashes of the last commands that this program has sent, oldest first."""
        self.deviations = Deviations(clock)
        """Repairs of the robots' messages."""
        self._controller = FleetController(
            settings, expected=addresses.expected, utc_now=clock.now, deviations=self.deviations.of
        )
        self._reader = make_reader(self._note_repairs, strict=settings.strict)
        self._reader.know_plant(only_map, nodes)
        self._rate = MessageRate(settings.messages_per_second, settings.messages_burst)
        self._subscribe_to(Topic.CONNECTION, Connection, self._controller.on_connection, qos=1)
        for robot in addresses.expected:
            for address in addresses.addresses_of(robot):
                mqtt.subscribe_by_name(address.scheme.of(robot, Topic.CONNECTION))
        self._subscribe_to(Topic.FACTSHEET, Factsheet, self._controller.on_factsheet, qos=settings.qos)
        self._subscribe_to(Topic.STATE, State, self._take_state, qos=settings.qos)

        for scheme in addresses.schemes:
            for topic in COMMANDS:
                mqtt.subscribe(scheme.for_all(topic), self._check_command, qos=0, needed=False)
        self._searched = False

    async def run(self) -> None:
        """Handle timeouts periodically, until cancelled."""
        await forever("fleet control", self._check_periodically)

    def start_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """Send a VDA order (section 6.1.1); raises RobotBusyError."""
        outputs = self._controller.control(robot).start_order(vda_order, self._now())
        self._tell_begun(vda_order, outputs, restored=False)

    def adopt_vda_order(
        self, robot: RobotKey, vda_order: VdaOrder, *, accepted: bool, update_id: int = 0
    ) -> None:
        """Restore a VDA order after a restart; raises RobotBusyError."""
        outputs = self._controller.control(robot).adopt_order(
            vda_order, self._now(), accepted=accepted, update_id=update_id
        )
        self._tell_begun(vda_order, outputs, restored=True)

    def _tell_begun(self, vda_order: VdaOrder, outputs: Iterable[FleetOutput], *, restored: bool) -> None:
        for listener in self.listeners:
            listener.begun(vda_order.order_id, self._now(), restored=restored)
        self._hand_out(outputs)

    def extend_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """Send an order update (section 6.1.2); raises BaseChangedError."""
        self._hand_out(self._controller.control(robot).extend_order(vda_order, self._now()))

    def release_base(self, robot: RobotKey, order_id: str, sequence_id: int | None) -> None:
        """Send an order update that only extends the base, to this node; None: to the end (section 6.1.2)."""
        self._hand_out(self._controller.control(robot).release_base(order_id, sequence_id, self._now()))

    def cancel_vda_order(self, robot: RobotKey) -> None:
        """Cancel the robot's VDA order (section 6.1.3)."""
        self._hand_out(self._controller.control(robot).cancel_order(self._now()))

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        """Send an instant action (section 6.2.1)."""
        self._hand_out(self._controller.control(robot).send_instant_action(action, self._now()))

    def send_zone_set(self, robot: RobotKey, zone_set: ZoneSet) -> None:
        """Send a zone set to a robot; its states show whether it has accepted it (section 6.4)."""
        self._publish_output(PublishZoneSet(robot, zone_set), self._now())

    def all_known(self) -> bool:
        """Return whether every robot that is connected, according to the broker, has reported its state."""
        return self._controller.all_known(self._now())

    def connected_for(self) -> float:
        """Return how long the link to the broker has been up, seconds; 0 while it is down."""
        return self._controller.connected_for(self._now())

    def view(self, robot: RobotKey) -> RobotView:
        """Return the known state of a robot; LinkStatus.UNKNOWN if it never reported."""
        return self._controller.view(robot, self._now())

    async def _check_periodically(self) -> None:
        await asyncio.sleep(self._settings.tick_interval)
        await self._mqtt.read_waiting(READ_WITHIN)
        self._notice_broker()
        self._rate.read_postponed(self._now())
        self._search_robots()
        outputs: list[FleetOutput] = []
        try:
            for of_robot in self._controller.tick(self._now()):
                outputs += of_robot
        finally:  # what one robot's failure leaves of the others is not lost
            self._hand_out(outputs)

    def _notice_broker(self) -> None:
        """Report changes of our own link to the core, periodically and with each received message."""
        # In a new term of leadership, what is known about robots may be older than the leadership of another
        # order service: they must report before they are sent orders.
        link = self._mqtt.state
        unread = link.connected and link.term != self._term
        if link.connected is self._connected and not unread:
            return
        self._connected = link.connected
        if link.connected:
            self._term = link.term
        self._hand_out(self._controller.on_broker(connected=link.connected, now=self._now(), unread=unread))

    def _search_robots(self) -> None:
        """Subscribe once to similar topics if robots of the plant model have not been heard of."""
        if self._searched or self.connected_for() < SEARCHED_AFTER:
            return
        self._searched = True
        if any(self.view(robot).link is LinkStatus.UNKNOWN for robot in self._addresses.expected):
            for topic in SIMILAR_TOPICS:
                self._mqtt.subscribe(topic, self._note_similar, qos=0, needed=False)

    def _note_similar(self, inbound: Inbound) -> None:
        """Record that a message came on a topic similar to that of an expected robot."""
        meant = self._addresses.similar_to(inbound.topic) if inbound.payload else None
        if meant:
            control, topic = self._controller.control(meant[0]), inbound.topic[:LOGGED_OF_COMMAND]
            self._hand_out(control.on_other_topic(topic, meant[1], self._now()))

    def _check_command(self, inbound: Inbound) -> None:
        """Log an error if another program commands robots; the broker returns our own commands as well."""
        if not inbound.payload or hash((inbound.topic, inbound.payload)) in self._sent:
            return
        if DIRECT_ACTION.encode() in inbound.payload:
            return  # of the aggregator's stop, which this service takes over
        if self.statistics.foreign % MALFORMED_LOGGED_EACH == 0:
            log.error(
                "another program commands robots of this fleet",
                topic=inbound.topic,
                retained=inbound.retained,
                message=inbound.payload[:LOGGED_OF_COMMAND].decode(errors="replace"),
                so_far=self.statistics.foreign + 1,
            )
        self.statistics.foreign += 1

    def _subscribe_to(self, topic: Topic, kind: type[M], take: Take[M], *, qos: int) -> None:
        """Subscribe to a topic of all robots; ``take`` receives valid, current messages."""

        def count_and_read(scheme: TopicScheme, inbound: Inbound) -> None:
            self.statistics.received[topic] += 1
            read_inbound(scheme, inbound)

        def read_inbound(scheme: TopicScheme, inbound: Inbound) -> None:
            robot_message = self._read_message(
                kind, scheme, inbound, later=partial(read_inbound, scheme, inbound)
            )
            if robot_message:
                self._hand_out(take(*robot_message, self._now()))

        for scheme in self._addresses.schemes:
            self._mqtt.subscribe(scheme.for_all(topic), partial(count_and_read, scheme), qos=qos)

    def _take_state(self, robot: RobotKey, message: State, now: float) -> Outputs:
        self._controller.control(robot).on_substituted(self._reader.substituted)
        return self._controller.on_state(robot, message, now)

    def _read_message(
        self, kind: type[M], scheme: TopicScheme, inbound: Inbound, *, later: Callable[[], None]
    ) -> tuple[RobotKey, M] | None:
        """Read a message; ignore one that is malformed, outdated or beyond the limits.

        ``later`` reads it again: the last one beyond the robot's rate.
        """
        self._notice_broker()
        robot = scheme.robot_of(inbound.topic)
        # an empty message clears a retained one, and states are not retained
        if robot is None or not (inbound.payload or kind is State):
            return None
        if len(str(robot)) > KEY_LENGTH:
            self._note_long_name(robot)
            return None
        if not self._controller.knows(robot):
            self._note_similar(inbound)
        if not self._controller.has_room_for(robot):
            self.statistics.robot_limit += 1
            return None
        if self._rate.exceeded(inbound.topic, len(inbound.payload), self._now(), read=later):
            self.statistics.too_many += 1
            return None
        try:
            message = self._reader.read(kind, inbound.topic, inbound.payload, scheme.major_version, robot)
        except MalformedMessageError as error:
            self._note_malformed(robot, scheme, inbound, error)
            return None
        codec = self._reader.codec_of(message.version)
        dialect = self._addresses.dialect_of(robot)
        vda_order = self._controller.vda_order(robot)
        if kind is State and vda_order and not self._settings.strict:
            message, repairs = in_letters_of(vda_order, message)
            if repairs:
                self.deviations.note(robot, Topic.STATE, repairs)
        if kind is State and dialect.keeps_last_node_states:
            outdated = self._last_nodes.may_be_outdated(robot, message, vda_order)
            message = dialect.to_standard(message, outdated=outdated)
        is_current = self._addresses.learn_source(robot, codec, scheme, message, retained=inbound.retained)
        return (
            (robot, message) if is_current and self._is_new(kind, robot, message.header_id, inbound) else None
        )

    def _note_repairs(self, topic: str, repairs: tuple[Repair, ...]) -> None:
        robots = (scheme.robot_of(topic) for scheme in self._addresses.schemes)
        self.deviations.note(next(filter(None, robots)), topic.rpartition("/")[2], repairs)

    def _is_new(
        self,
        kind: type[Connection | Factsheet | State],
        robot: RobotKey,
        header_id: int,
        inbound: Inbound,
    ) -> bool:
        """Return False for an old state of a robot whose timestamps cannot be read."""
        # The reader replaces such a timestamp by the time of arrival, with which an old state would look new.
        if kind is Connection:
            self._undated.pop(robot, None)
        if kind is not State or not self._reader.undated:
            return True
        order = self._undated.setdefault(robot, MessageOrder())
        if order.is_new(header_id, NO_TIME, self._now(), inbound.payload):
            return True
        header = header_text(header_id, NO_TIME)
        self._hand_out(self._controller.control(robot).on_old_state(header, order.last_header, self._now()))
        return False

    def _note_long_name(self, robot: RobotKey) -> None:
        """Ignore a robot whose name is too long for the store."""
        if self.statistics.name_too_long % MALFORMED_LOGGED_EACH == 0:
            log.warning(
                "ignoring robot: manufacturer and serial number are too long",
                robot=f"{str(robot)[:LOGGED_OF_NAME]}...",
                characters=len(str(robot)),
                limit=KEY_LENGTH,
                so_far=self.statistics.name_too_long + 1,
            )
        self.statistics.name_too_long += 1

    def _note_malformed(
        self, robot: RobotKey, scheme: TopicScheme, inbound: Inbound, error: MalformedMessageError
    ) -> None:
        name = Topic(inbound.topic.rpartition("/")[2])
        self.statistics.malformed[name] += 1
        control = self._controller.control(robot)
        if name is Topic.STATE:
            problem = Reason(R.UNREADABLE_STATES, error.reason)
            sighting = self._reader.sighting(inbound.topic, inbound.payload, scheme.major_version)
            outputs = control.on_unreadable_state(problem, sighting, self._now())
        else:
            field = error.references.get("parameter", "message")
            self.deviations.note(robot, name, (Repair(field, RepairKind.LEFT_OUT, error.received),))
            of_connection = name is Topic.CONNECTION  # no orders without a connection
            reason = Reason(R.UNREADABLE_CONNECTIONS, error.reason) if of_connection else None
            outputs = control.on_malformed(reason, self._now())
        self._hand_out(outputs)
        count = self.view(robot).malformed
        if count % MALFORMED_LOGGED_EACH == 1:
            log.warning(
                "ignoring invalid robot message",
                robot=str(robot),
                topic=inbound.topic,
                problems=error.problems,
                so_far=count,
            )

    def _hand_out(self, outputs: Iterable[FleetOutput]) -> None:
        events: list[FleetOutput] = []
        at = self._now()
        for output in tuple(outputs):
            if isinstance(output, Publish):
                self._publish_output(output, at)
            else:
                for listener in self.listeners:
                    listener.happened(output, at)
                events.append(output)
        if events:
            self._on_events(*events)

    def _publish_output(self, output: Publish, now: float) -> None:
        refused, robot = self._mqtt.state.refused_names, output.robot
        unheard = refused and self.view(robot).link is LinkStatus.UNKNOWN
        for address in self._addresses.addresses_of(robot):
            # A broker that refuses a name may end the connection of who publishes to it (NATS); nothing is
            # ever heard of such a robot.
            if refused and address.scheme.of(robot, Topic.CONNECTION) in refused and unheard:
                continue
            self._publish_to(address, output, now)

    def _publish_to(self, address: RobotAddress, output: Publish, now: float) -> None:
        topic, message = self._outgoing.make_message(output, address.codec.version)
        dialect = self._addresses.dialect_of(output.robot)
        try:
            payload = dialect.rename_keys(topic, address.codec.encode(dialect.to_readable(message)))
        except (MalformedMessageError, ValidationError):
            log.exception(
                "message not supported by the robot's VDA 5050 version", robot=str(output.robot), topic=topic
            )
            return
        # A broker that ends the connection at a message would do so again at every resend, and nobody else
        # would be commanded meanwhile.
        place = address.scheme.of(output.robot, topic)
        if place in self._mqtt.state.set_aside and topic is Topic.ORDER:
            self._hand_out(self._controller.control(output.robot).on_undeliverable(place, now))
            return
        if topic in COMMANDS:  # the broker returns it to us, see _check_command
            if len(self._sent) >= SENT_REMEMBERED:
                del self._sent[next(iter(self._sent))]
            self._sent[hash((place, payload))] = None
        for listener in self.listeners:
            listener.published(topic, output, now)
        self._mqtt.publish(Outbound(place, payload, qos=self._settings.qos, keep=False))
