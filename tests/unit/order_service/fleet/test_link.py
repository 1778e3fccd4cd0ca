"""Where robots are spoken to."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from paho.mqtt.client import topic_matches_sub

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.failures import RobotBusyError
from nena_order_service.fleet.link import (
    SEARCHED_AFTER,
    STANDARD,
    FleetLink,
    LastNodes,
    RobotAddresses,
    in_letters_of,
)
from nena_order_service.fleet.outputs import VdaOrderFinished
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.mqtt import Handler, Inbound, MqttLink, Outbound
from nena_shared.plant import Vehicle
from nena_shared.plant.fleet_checks import KEY_LENGTH
from nena_shared.settings import ConfigurationError, MqttSettings
from nena_shared.vda5050.action import ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.order import NodePosition, Order
from nena_shared.vda5050.records import read_record
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.clocks import ManualClock
from support.fleet import make_action, make_vda_order
from support.fleet_examples import factsheet, state
from support.waiting import until

pytestmark = pytest.mark.clause("4.2")

ROBOT = RobotKey("ACME", "r1")
HELLO = HonestRobot(key=ROBOT).connection(ConnectionState.ONLINE)
V2, V3 = TopicScheme("uagv", "v2"), TopicScheme("vda5050", "v3")


def addresses(**properties: str) -> RobotAddresses:
    known = RobotAddresses([V2, V3])
    vehicle = Vehicle(name="Tug", properties={f"vda5050:{key}": value for key, value in properties.items()})
    known.expect_vehicles([(ROBOT, vehicle)])
    return known


class Handlers(MqttLink):
    """A link without a broker, whose messages a test delivers."""

    def __init__(self) -> None:
        super().__init__(MqttSettings(), client_id="c")
        self.by_filter: dict[str, Handler] = {}

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        assert qos in (0, 1), needed
        self.by_filter[topic_filter] = handler


def link_over(
    mqtt: MqttLink, clock: ManualClock | None = None, settings: FleetSettings | None = None
) -> FleetLink:
    """Return a link that tells nobody of events."""
    return FleetLink(
        mqtt,
        addresses=addresses(version="2.1.0"),
        settings=settings or FleetSettings(),
        clock=clock or ManualClock(),
        on_events=lambda *_: None,
    )


@pytest.mark.parametrize("robot", [ROBOT, RobotKey("ACME", "not in the plant model")])
def test_a_robot_of_unknown_version_is_addressed_on_all_topics_that_it_may_use(robot: RobotKey) -> None:
    found = addresses().addresses_of(robot)

    assert [(each.codec.version, each.scheme) for each in found] == [("2.0.0", V2), ("3.0.0", V3)]
    assert addresses().schemes == (V2, V3)


@pytest.mark.parametrize(
    ("written", "version", "scheme"),
    [
        ("2.0.0", "2.0.0", V2),
        ("2.0", "2.0.0", V2),
        ("2.1", "2.1.0", V2),
        ("3.0.0", "3.0.0", V3),
        ("3.0", "3.0.0", V3),
    ],
)
def test_the_plant_model_names_its_version(written: str, version: str, scheme: TopicScheme) -> None:
    (address,) = addresses(version=written).addresses_of(ROBOT)

    assert (address.codec.version, address.scheme) == (version, scheme)


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("interfaceName", "#", "interfaceName"),
        ("interfaceName", "a/+/b", "interfaceName"),
        ("interfaceName", "uagv/", "interfaceName"),
        ("topicPrefix", "site/+", "topicPrefix"),
        ("version", "1.1", r"version.*'1\.1'"),
    ],
)
def test_an_invalid_property_is_an_error_of_the_plant_model(key: str, value: str, named: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"vehicle 'Tug', property vda5050:{named}"):
        addresses(**{key: value})


def test_the_plant_model_names_its_topics() -> None:
    own = TopicScheme("acme/hall", "v2"), TopicScheme("acme/hall", "v3")
    known = addresses(interfaceName="acme/hall")
    (address,) = addresses(version="2.0.0", interfaceName="acme/hall").addresses_of(ROBOT)

    assert address.scheme == own[0]
    assert tuple(each.scheme for each in known.addresses_of(ROBOT)) == own
    assert known.schemes == (V2, V3, *own)


@pytest.mark.parametrize(
    ("prefix", "version", "scheme", "topic"),
    [
        ("site7/agv/V1", "2.0", TopicScheme("site7/agv/V1", "v2", ROBOT), "site7/agv/V1/state"),
        ("site7", "", TopicScheme("site7", "v2", ROBOT), "site7/state"),
        ("site7", "3.0", TopicScheme("site7", "v3", ROBOT), "site7/state"),
        ("x/v2/ACME/r1", "2.1", TopicScheme("x", "v2"), "x/v2/ACME/r1/state"),  # any robot below x
        ("uagv/v2/ACME/r2", "2.1", TopicScheme("uagv/v2/ACME/r2", "v2", ROBOT), "uagv/v2/ACME/r2/state"),
    ],
)
def test_the_plant_model_names_a_prefix_of_all_topics(
    prefix: str, version: str, scheme: TopicScheme, topic: str
) -> None:
    known = addresses(topicPrefix=prefix, interfaceName="acme", **({"version": version} if version else {}))
    (address,) = known.addresses_of(ROBOT)

    assert address.scheme == scheme
    assert scheme.of(ROBOT, Topic.STATE) == topic
    assert known.schemes == (V2, V3, scheme)
    assert scheme.robot_of(topic) == ROBOT
    assert scheme.robot_of(f"other/{topic}") is None
    if scheme.robot:
        assert scheme.for_all(Topic.STATE) == topic


async def test_a_robot_below_its_own_prefix_is_heard_and_commanded() -> None:
    mqtt, known = Handlers(), addresses(topicPrefix="site7/V1", version="2.1")
    link = FleetLink(
        mqtt, addresses=known, settings=FleetSettings(), clock=ManualClock(), on_events=lambda *_: None
    )
    own = "site7/V1/connection"
    mqtt.by_filter[own](Inbound(own, codec_for(HELLO.version).encode(HELLO), retained=False))

    assert link.view(ROBOT).link is LinkStatus.ONLINE
    assert {"site7/V1/state", "site7/V1/factsheet", "site7/V1/order"} <= set(mqtt.by_filter)


def test_what_a_robot_below_its_own_prefix_deviates_in_is_told_of_it() -> None:
    mqtt, known = Handlers(), addresses(topicPrefix="site7", version="2.1")
    link = FleetLink(
        mqtt, addresses=known, settings=FleetSettings(), clock=ManualClock(), on_events=lambda *_: None
    )
    payload = codec_for("2.1.0").encode(HELLO).replace(b'"ONLINE"', b'"online"')
    mqtt.by_filter["site7/connection"](Inbound("site7/connection", payload, retained=False))

    (told,) = link.deviations.of(ROBOT)
    assert str(told) == 'connection.connectionState "online": letter case'


def test_ids_of_an_order_are_read_in_any_letter_case() -> None:
    order = make_vda_order("M-1", "A", "B", operation="pick")
    actions = tuple(
        ActionState(action_id=each, action_type="pick", action_status=ActionStatus.FINISHED)
        for each in ("m-1/PICK", "other")
    )
    found, repairs = in_letters_of(order, state(order_id="m-1", action_states=actions))

    assert (found.order_id, [each.action_id for each in found.action_states]) == (
        "M-1",
        ["M-1/pick", "other"],
    )
    assert [str(each) for each in repairs] == [
        'orderId "m-1": letter case',
        'actionStates.actionId "m-1/PICK": letter case',
    ]
    assert in_letters_of(order, found) == (found, ())


def test_a_robot_that_the_store_cannot_hold_is_an_error_of_the_plant_model() -> None:
    long = RobotKey("ACME", "r" * KEY_LENGTH)
    with pytest.raises(ConfigurationError, match=r"vehicle 'Tug'.*more than 400 characters"):
        RobotAddresses([V2, V3]).expect_vehicles([(long, Vehicle(name="Tug"))])


@pytest.mark.parametrize(
    ("written", "told", "scheme", "retained"), [("2.0.0", "3.0.0", V3, False), ("3.0.0", "2.1.0", V2, True)]
)
def test_a_robots_messages_override_the_plant_model_unless_outdated_and_retained(
    written: str, told: str, scheme: TopicScheme, *, retained: bool
) -> None:
    known = addresses(version=written)

    assert known.learn_source(ROBOT, codec_for(told), scheme, HELLO, retained=retained) is not retained
    (address,) = known.addresses_of(ROBOT)
    assert address.scheme == V3


def test_an_order_refused_to_a_busy_robot_is_not_counted_as_undelivered() -> None:
    link = link_over(Handlers())
    link.start_vda_order(ROBOT, make_vda_order("m1", "A", "B"))

    with pytest.raises(RobotBusyError):
        link.start_vda_order(ROBOT, make_vda_order("m2", "A", "B"))
    with pytest.raises(RobotBusyError):
        link.adopt_vda_order(ROBOT, make_vda_order("m3", "A", "B"), accepted=False)

    assert link.statistics.undelivered == 1


def test_a_vehicle_without_such_properties_keeps_to_the_standard() -> None:
    assert addresses().dialect_of(ROBOT) == addresses().dialect_of(RobotKey("ACME", "r2")) == STANDARD


def test_parameters_are_sent_as_text_if_configured() -> None:
    dialect = addresses(parametersAsText="true").dialect_of(ROBOT)
    values: dict[str, Any] = {"height": 1.5, "slowly": True, "slots": [1, 2], "station": "7"}
    action = make_action("pick", **values)
    mission = make_vda_order("m", "A", "B")
    node = mission.nodes[1].model_copy(update={"actions": (action,)})
    header = dict(HELLO) | {"header_id": 1}
    header = {name: header[name] for name in Header.model_fields}
    order = Order(
        **header, order_id="m", order_update_id=0, nodes=(mission.nodes[0], node), edges=mission.edges
    )
    instant = InstantActions(**header, actions=(action,))

    read = dialect.to_readable(order)
    assert isinstance(read, Order)
    also = dialect.to_readable(instant)
    assert isinstance(also, InstantActions)
    for fitted in (read.nodes[1].actions[0], also.actions[0]):
        given = {each.key: each.value for each in fitted.action_parameters}
        assert given == {"height": "1.5", "slowly": "true", "slots": "[1,2]", "station": "7"}
    assert STANDARD.to_readable(order) is order


def test_the_list_of_instant_actions_has_the_configured_key() -> None:
    dialect = addresses(instantActionsKey="instantActions").dialect_of(ROBOT)

    assert dialect.rename_keys(Topic.INSTANT_ACTIONS, b'{"headerId":1,"actions":[]}') == (
        b'{"headerId":1,"instantActions":[]}'
    )
    assert dialect.rename_keys(Topic.ORDER, b'{"actions":[]}') == b'{"actions":[]}'
    assert STANDARD.rename_keys(Topic.INSTANT_ACTIONS, b'{"actions":[]}') == b'{"actions":[]}'


@pytest.mark.parametrize(
    ("more", "empty"),
    [
        ({}, True),
        ({"driving": True}, False),
        ({"last_node_id": "A"}, False),
        ({"last_node_sequence_id": 0}, False),
    ],
)
@pytest.mark.parametrize("recorded", [False, True])
def test_kept_last_node_states_count_as_done(more: dict[str, object], *, empty: bool, recorded: bool) -> None:
    dialect = addresses(keepsLastNodeStates="true").dialect_of(ROBOT)
    robot = HonestRobot(key=ROBOT)
    robot.nodes = list(make_vda_order("m", "A", "B").nodes[1:])
    robot.last_node_id, robot.last_sequence_id, robot.paused = "B", 2, True
    state = robot.state().model_copy(update=more)
    if recorded:
        codec = codec_for("2.1.0")
        state = read_record(State, codec, codec.encode(state))

    assert (dialect.to_standard(state).node_states == ()) is empty
    assert STANDARD.to_standard(state) is state


@pytest.mark.parametrize(
    ("heading", "wanted", "allowed", "done"),
    [
        (0.0, 1.57, None, False),
        (1.5, 1.57, None, True),
        (-3.1, 3.1, None, True),
        (1.2, 1.57, 0.2, False),
        (0.0, None, None, True),
    ],
)
def test_a_robot_that_turns_at_its_last_node_finishes_after_the_turn(
    heading: float, wanted: float | None, allowed: float | None, *, done: bool
) -> None:
    """Its lastNodeSequenceId may be that of the order before, which ended there."""
    dialect = addresses(keepsLastNodeStates="true").dialect_of(ROBOT)
    state = at_last_node(heading, wanted, allowed)

    assert (dialect.to_standard(state, outdated=True).node_states == ()) is done
    assert dialect.to_standard(state).node_states == (), "a robot whose last node is current has arrived"


def at_last_node(heading: float, wanted: float | None, allowed: float | None = None) -> State:
    """Return the state of a robot that stands at B, its last node, and keeps it."""
    robot = HonestRobot(key=ROBOT, order_id="m")
    robot.nodes = list(make_vda_order("m", "B", "B").nodes[1:])
    robot.last_node_id, robot.last_sequence_id, robot.paused = "B", 2, True
    robot.position = (1.0, 0.0, heading)
    place = NodePosition(x=1.0, y=0.0, theta=wanted, map_id="hall", allowed_deviation_theta=allowed)
    state = robot.state()
    nodes = tuple(each.model_copy(update={"node_position": place}) for each in state.node_states)
    return state.model_copy(update={"node_states": nodes})


@pytest.mark.parametrize(
    ("places", "before", "outdated"),
    [
        (("A", "B"), None, False),
        (("B", "B"), None, True),
        (("B", "B"), {"last_node_sequence_id": 0}, False),
        (("B", "B"), {"order_id": "earlier"}, True),
    ],
)
def test_a_last_node_may_be_outdated_in_a_round_trip_until_another_is_reported(
    places: tuple[str, ...], before: dict[str, object] | None, *, outdated: bool
) -> None:
    nodes, vda_order, state = LastNodes(), make_vda_order("m", *places), at_last_node(0.0, 1.57)
    if before is not None:
        nodes.may_be_outdated(ROBOT, state.model_copy(update=before), vda_order)

    assert nodes.may_be_outdated(ROBOT, state, vda_order) is outdated
    assert not nodes.may_be_outdated(ROBOT, state, None)


@pytest.mark.parametrize("start", ["A", "B"])
def test_an_order_finishes_slightly_off_the_heading_with_kept_last_node(
    start: str,
) -> None:
    """An order from B to B is not: the robot may not have turned yet."""
    mqtt, codec, news = Handlers(), codec_for("2.1.0"), list[object]()
    link = FleetLink(
        mqtt,
        addresses=addresses(keepsLastNodeStates="true", version="2.1.0"),
        settings=FleetSettings(),
        clock=ManualClock(),
        on_events=lambda *outputs: news.extend(outputs),
    )
    link.adopt_vda_order(ROBOT, make_vda_order("m", start, "B"), accepted=True)
    payload = codec.encode(at_last_node(0.5, 1.57, allowed=0.1))
    mqtt.by_filter[V2.for_all(Topic.STATE)](Inbound(V2.of(ROBOT, Topic.STATE), payload, retained=False))

    finished = any(isinstance(each, VdaOrderFinished) for each in news)
    assert finished is (start == "A")


def test_a_robot_that_floods_is_read_at_its_rate_and_others_at_once() -> None:
    mqtt, codec, clock = Handlers(), codec_for("2.1.0"), ManualClock()
    link = link_over(mqtt, clock, FleetSettings(messages_per_second=10, messages_burst=20))

    def send(robot: HonestRobot, topic: Topic, payload: bytes) -> None:
        mqtt.by_filter[V2.for_all(topic)](Inbound(V2.of(robot.key, topic), payload, retained=False))

    def last_of(robot: HonestRobot) -> int | None:
        state = link.view(robot.key).state
        return state.header_id if state else None

    flood, other = HonestRobot(key=ROBOT), HonestRobot(key=RobotKey("ACME", "r2"))
    for robot in (flood, other):
        send(robot, Topic.CONNECTION, codec.encode(robot.connection(ConnectionState.ONLINE)))
    states = [flood.state() for _ in range(51)]
    for each in states[:50]:
        send(flood, Topic.STATE, codec.encode(each))
    send(other, Topic.STATE, codec.encode(other.state()))
    send(flood, Topic.CONNECTION, codec.encode(flood.connection(ConnectionState.OFFLINE)))

    assert link.statistics.too_many == 30
    assert last_of(flood) == states[19].header_id
    assert last_of(other) is not None
    assert link.view(ROBOT).link is LinkStatus.OFFLINE, "other topics count for themselves"

    send(flood, Topic.CONNECTION, codec.encode(flood.connection(ConnectionState.ONLINE)))
    clock.advance(0.1)
    send(flood, Topic.STATE, codec.encode(states[50]))
    assert last_of(flood) == states[50].header_id, "the next one makes up for those that were dropped"


async def test_the_last_will_of_a_robot_that_flooded_its_connection_topic_is_read() -> None:
    mqtt, codec, clock = Handlers(), codec_for("2.1.0"), ManualClock()
    link = link_over(
        mqtt, clock, FleetSettings(messages_per_second=10, messages_burst=20, tick_interval=0.001)
    )
    robot, topic = HonestRobot(key=ROBOT), V2.of(ROBOT, Topic.CONNECTION)
    wills = [ConnectionState.ONLINE] * 30 + [ConnectionState.CONNECTION_BROKEN]
    for each in wills:
        payload = codec.encode(robot.connection(each))
        mqtt.by_filter[V2.for_all(Topic.CONNECTION)](Inbound(topic, payload, retained=False))
    assert link.view(ROBOT).link is LinkStatus.ONLINE
    clock.advance(1.0)

    running = asyncio.create_task(link.run())
    await until(lambda: link.view(ROBOT).link is LinkStatus.CONNECTION_BROKEN, what="the last will is read")
    running.cancel()
    assert link.statistics.received[Topic.CONNECTION] == len(wills)
    assert link.statistics.too_many == 11


@pytest.mark.parametrize("topic", [Topic.CONNECTION, Topic.FACTSHEET])
def test_an_empty_message_that_clears_a_retained_one_says_nothing_of_the_robot(topic: Topic) -> None:
    mqtt, codec = Handlers(), codec_for("2.1.0")
    link, robot = link_over(mqtt, ManualClock(), FleetSettings()), HonestRobot(key=ROBOT, last_node_id="A")

    def send(topic: Topic, payload: bytes) -> None:
        mqtt.by_filter[V2.for_all(topic)](Inbound(V2.of(ROBOT, topic), payload, retained=False))

    send(Topic.CONNECTION, codec.encode(robot.connection(ConnectionState.ONLINE)))
    send(Topic.STATE, codec.encode(robot.state()))
    before = link.view(ROBOT)
    send(topic, b"")

    assert (link.view(ROBOT), link.statistics.malformed[topic]) == (before, 0)


def test_an_unreadable_connection_beside_readable_states_is_reported() -> None:
    mqtt, codec = Handlers(), codec_for("2.1.0")
    link, robot = link_over(mqtt, ManualClock(), FleetSettings()), HonestRobot(key=ROBOT, last_node_id="A")
    connected = codec.encode(robot.connection(ConnectionState.ONLINE)).replace(b"ONLINE", b"CONNECTED")
    for topic, payload in ((Topic.CONNECTION, connected), (Topic.STATE, codec.encode(robot.state()))):
        mqtt.by_filter[V2.for_all(topic)](Inbound(V2.of(ROBOT, topic), payload, retained=False))
    assert link.view(ROBOT).link is LinkStatus.ONLINE
    assert [str(each) for each in link.deviations.of(ROBOT)] == [
        'connection.connectionState "CONNECTED": left out'
    ]


async def test_waiting_messages_are_read_before_an_order_is_sent_again() -> None:
    """Under load, the robot's answer to an order may wait longer than the order service for it."""
    waiting: list[Inbound] = []
    sent: list[Order] = []
    looks: list[float] = []

    class Waiting(Handlers):
        async def read_waiting(self, seconds: float) -> None:
            looks.append(seconds)
            for each in waiting:
                self.by_filter[V2.for_all(Topic.STATE)](each)
            waiting.clear()

        def publish(self, message: Outbound) -> None:
            if message.topic == V2.of(ROBOT, Topic.ORDER):
                sent.append(codec.decode(Order, message.payload))

    mqtt, codec, clock = Waiting(), codec_for("2.1.0"), ManualClock()
    mqtt.state.connected = True
    settings = FleetSettings(tick_interval=0.001)
    link = link_over(mqtt, clock, settings)

    def inbound(topic: Topic, payload: bytes) -> Inbound:
        return Inbound(V2.of(ROBOT, topic), payload, retained=False)

    robot = HonestRobot(key=ROBOT, last_node_id="A")
    for topic, message in (
        (Topic.CONNECTION, robot.connection(ConnectionState.ONLINE)),
        (Topic.FACTSHEET, factsheet()),
        (Topic.STATE, robot.state()),
    ):
        mqtt.by_filter[V2.for_all(topic)](inbound(topic, codec.encode(message)))
    link.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
    assert len(sent) == 1

    robot.take_order(sent[0])
    waiting.append(inbound(Topic.STATE, codec.encode(robot.state())))
    clock.advance(settings.resend_after + 0.1)
    running = asyncio.create_task(link.run())
    await until(lambda: len(looks) >= 3, what="timeouts are checked")
    running.cancel()
    assert len(sent) == 1


def test_robots_whose_names_differ_in_letter_case_are_not_taken_for_each_other() -> None:
    known = RobotAddresses([V2, V3])
    robots = (ROBOT, RobotKey("ACME", "R1"), RobotKey("BETA", "r1"))
    known.expect_vehicles([(robot, Vehicle(name=str(robot))) for robot in robots])

    assert [known.similar_to(V2.of(robot, Topic.CONNECTION)) for robot in robots] == [None, None, None]
    assert known.similar_to("uagv/v2/OTHER/r1/connection") is None, "several have this serial number"


SIMILAR = [
    *("uagv/v2/ACME/R1/connection", "uagv/v2/acme/r1/connection", "uagv/v2/ACME/R1/state"),
    *("uagv/v2.0.0/ACME/r1/connection", "uagv/v2/ACME/r1/connect", "meili/v2/ACME/r1/connection"),
    *("v2/ACME/r1/connection", "uagv/ACME/r1/connection", "ACME/r1/connection"),
    *("site/hall/v2/ACME/r1/connection", "uagv/v2/NeNa/r1/connection", "uagv/v2.0.0/ACME/R1/connect"),
]


@pytest.mark.parametrize("topic", [*SIMILAR, "uagv/v2/ACME/r2/connection", "fleet/v2/ACME/r22/connection"])
async def test_a_robot_that_was_never_heard_is_told_of_messages_on_a_similar_topic(topic: str) -> None:
    mqtt, clock = Handlers(), ManualClock()
    link = link_over(mqtt, clock, FleetSettings(tick_interval=0.001))
    mqtt.state.connected = True
    robot = HonestRobot(key=ROBOT)
    messages = {
        "state": robot.state(),
        "connection": robot.connection(ConnectionState.ONLINE),
        "connect": robot.connection(ConnectionState.ONLINE),
    }

    def send(topic: str) -> None:
        payload = codec_for("2.1.0").encode(messages[topic.rpartition("/")[2]])
        for topic_filter, handler in dict(mqtt.by_filter).items():
            if topic_matches_sub(topic_filter, topic):
                handler(Inbound(topic, payload, retained=True))

    running = asyncio.create_task(link.run())
    try:
        await until(lambda: link.connected_for() >= 0.0 and link._connected, what="the link noticed")
        clock.advance(SEARCHED_AFTER)
        await until(lambda: link._searched, what="a search")
        send(topic)
        reason = str(link.view(ROBOT).availability.reason)
        own = V2.of(
            ROBOT, Topic(level) if (level := topic.rpartition("/")[2]) in set(Topic) else Topic.CONNECTION
        )
        assert reason.startswith("has never connected")
        assert (f"on '{topic}' instead of '{own}'" in reason) is (topic in SIMILAR)

        send(V2.of(ROBOT, Topic.STATE))
        assert "instead of" not in str(link.view(ROBOT).availability.reason)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
