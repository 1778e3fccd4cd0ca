from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import timedelta
from math import pi

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.factsheet import make_capabilities
from nena_edge_agent.messages import (
    NO_ACTIONS,
    RESERVE,
    WRAP,
    HeaderMaker,
    Inbox,
    InboxCounts,
    RobotMessages,
    client_id_of,
)
from nena_edge_agent.protocol.declaration import PREDEFINED, ActionDeclaration, Parameter
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import Event, InstantActionsReceived, MessageRefused, OrderReceived
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.mqtt import Inbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType, InstantActions
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, ValueDataType
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.versions import codec_for
from nena_shared.vda5050.visualization import Visualization
from support.clocks import ManualClock
from support.robot_core import HEADER, action, order


@pytest.mark.clause("7.2/headerId", "7.2")
def test_each_topic_is_counted_from_0() -> None:
    clock = ManualClock()
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock)

    first = maker.make(Topic.STATE)
    clock.advance(2.0)
    second = maker.make(Topic.STATE)
    other = maker.make(Topic.CONNECTION)

    assert (first["header_id"], second["header_id"], other["header_id"]) == (0, 1, 0)
    assert second["timestamp"] - first["timestamp"] == timedelta(seconds=2)
    assert (first["manufacturer"], first["serial_number"], first["version"]) == ("ACME", "1", "2.1.0")
    assert (maker.last_id(Topic.STATE), maker.last_id(Topic.FACTSHEET)) == (1, 0)


@pytest.mark.clause("7.2/headerId")
def test_header_ids_wrap_around_at_32_bits() -> None:
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock())
    maker._counts[Topic.STATE] = WRAP - 1

    assert maker.make(Topic.STATE)["header_id"] == WRAP - 1
    assert maker.make(Topic.STATE)["header_id"] == 0


@pytest.mark.clause("7.2/headerId", "6.6/restart")
def test_after_a_restart_header_ids_continue_after_all_reserved_ones() -> None:
    clock = ManualClock()
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock)
    used = 0
    for _ in range(3 * RESERVE):
        reserved = maker.reserve()
        used = maker.make(Topic.STATE)["header_id"]

    again = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock, reserved=reserved)

    assert used < again.make(Topic.STATE)["header_id"] <= used + RESERVE
    assert again.make(Topic.CONNECTION)["header_id"] == RESERVE


def test_header_ids_are_rarely_reserved() -> None:
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock())
    reserved = set()
    for _ in range(3 * RESERVE):
        reserved.add(maker.reserve())
        maker.make(Topic.STATE)

    assert len(reserved) <= 3 * RESERVE // (RESERVE // 2)


def test_header_ids_are_reserved_across_the_wrap_around() -> None:
    reserved = ((Topic.STATE, WRAP - 2),)
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock(), reserved=reserved)

    assert dict(maker.reserve())[Topic.STATE] == RESERVE - 2


def test_a_client_id_contains_the_robot_and_depends_on_its_secret() -> None:
    robot, secret = RobotKey("ACME", "1"), MqttSettings.model_validate({"password": "a"})
    topics = TopicScheme("uagv", "v2")

    assert client_id_of(robot, topics, MqttSettings()) == "nena-edge-agent-uagv-ACME-1"
    assert client_id_of(robot, TopicScheme("hall/2", "v2"), MqttSettings()) == "nena-edge-agent-hall-2-ACME-1"
    assert client_id_of(robot, topics, secret).startswith("nena-edge-agent-uagv-ACME-1-")
    assert client_id_of(robot, topics, secret) != client_id_of(RobotKey("ACME", "2"), topics, secret)


ROBOT = RobotKey("NeNa", "robot1")


def messages(version: str = "2.1.0", first: int = 0) -> RobotMessages:
    settings = EdgeAgentSettings.model_validate({"version": version, "qos": 0})
    capabilities = make_capabilities(settings, ActionRegistry([]))
    reserved = ((Topic.CONNECTION, first),)
    codec = codec_for(version)
    return RobotMessages(settings, ROBOT, capabilities, codec=codec, clock=ManualClock(), reserved=reserved)


@pytest.mark.clause("6.5", "7.9")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_connection_is_retained_and_sent_with_qos_1(version: str) -> None:
    found = messages(version).connection(ConnectionState.ONLINE)

    assert (found.retain, found.qos) == (True, 1)
    assert found.keep, "an OFFLINE waits for a link that is being connected"
    assert found.topic.endswith("/NeNa/robot1/connection")
    said = codec_for(version).decode(Connection, found.payload)
    assert (said.connection_state, said.version) == (ConnectionState.ONLINE, version)


@pytest.mark.clause("7.2/headerId")
def test_header_ids_continue_after_those_of_an_earlier_run() -> None:
    made = messages(first=100)
    codec = codec_for("2.1.0")

    connections = [made.connection(ConnectionState.ONLINE).payload for _ in range(2)]
    sheet = made.factsheet()

    assert [codec.decode(Connection, each).header_id for each in connections] == [100, 101]
    assert codec.decode(Factsheet, sheet.payload).header_id == 0
    assert (sheet.retain, sheet.qos) == (True, 0)


def test_visualization_is_sent_with_qos_0_and_not_kept() -> None:
    made = messages()
    here = Visualization(**made.headers.make(Topic.VISUALIZATION), reference_state_header_id=0)

    found = made.visualization(here)

    assert (found.qos, found.retain, found.keep) == (0, False, False)
    assert found.topic == made.topic(Topic.VISUALIZATION)


class Receiver:
    def __init__(
        self,
        serial: str = "0001",
        *,
        actions: Mapping[str, ActionDeclaration] = NO_ACTIONS,
        strict: bool = False,
        map_ids: frozenset[str] = frozenset(),
    ) -> None:
        self.events: list[Event] = []
        robot = RobotKey("ACME", serial)
        self.inbox = Inbox(
            CODEC,
            robot,
            self.events.append,
            ManualClock(),
            actions=actions,
            strict=strict,
            map_ids=lambda: map_ids,
        )

    def order(self, payload: bytes, *, retained: bool = False) -> None:
        self.inbox.take_message(Topic.ORDER, Inbound("x/order", payload, retained))

    @property
    def refusal(self) -> dict[str, str]:
        (event,) = self.events
        assert isinstance(event, MessageRefused)
        assert event.error.error_type == ErrorType.VALIDATION_FAILURE
        return {each.reference_key: each.reference_value for each in event.error.error_references}


def test_a_valid_order_becomes_an_event() -> None:
    receiver = Receiver()

    receiver.order(CODEC.encode(order("n0", "n1")))

    (event,) = receiver.events
    assert isinstance(event, OrderReceived)
    assert [node.node_id for node in event.order.nodes] == ["n0", "n1"]
    assert receiver.inbox.counts.taken == 1


def test_valid_instant_actions_become_an_event() -> None:
    receiver = Receiver()

    receiver.inbox.take_message(
        Topic.INSTANT_ACTIONS,
        Inbound("x", CODEC.encode(InstantActions(**HEADER, actions=(action("a"),))), retained=False),
    )

    (event,) = receiver.events
    assert isinstance(event, InstantActionsReceived)
    assert event.message.actions[0].action_id == "a"
    assert event.utc == ManualClock().now()


@pytest.mark.clause("4.1/retain")
def test_a_retained_message_is_ignored() -> None:
    receiver = Receiver()

    receiver.order(CODEC.encode(order("n0")), retained=True)

    assert receiver.events == []
    assert receiver.inbox.counts.retained == 1


@pytest.mark.parametrize("retained", [True, False])
def test_an_empty_message_is_ignored(*, retained: bool) -> None:
    receiver = Receiver()

    receiver.order(b"", retained=retained)

    assert receiver.events == []
    assert receiver.inbox.counts == InboxCounts()


@pytest.mark.clause("6.1.4.1")
@pytest.mark.parametrize("payload", [b" ", b"\xff", b"[]", b'"order"', b"{}", b"null"])
def test_malformed_messages_are_refused_and_counted(payload: bytes) -> None:
    receiver = Receiver()

    receiver.order(payload)

    assert receiver.refusal == {"topic": "order"} | ({"parameter": "orderId"} if payload == b"{}" else {})
    assert receiver.inbox.counts.malformed == 1


@pytest.mark.clause("6.1.4.1", "6.6.5.2")
def test_the_readable_ids_of_a_malformed_message_are_referenced() -> None:
    receiver = Receiver()
    content = json.loads(CODEC.encode(order("n0", "n1", order_id="o7", update=2)))
    content["edges"] = []

    receiver.order(json.dumps(content).encode())

    named = {"headerId": "7", "orderId": "o7", "orderUpdateId": "2"}
    assert receiver.refusal == {"topic": "order", "parameter": "edges", **named}


def test_the_error_of_a_refused_message_quotes_the_value() -> None:
    receiver = Receiver()
    content = json.loads(CODEC.encode(order("n0", "n1"))) | {"version": "1.3.2"}
    content["edges"][0]["maxSpeed"] = -1.0

    receiver.order(json.dumps(content).encode())

    (event,) = receiver.events
    assert isinstance(event, MessageRefused)
    said = "edges.0.maxSpeed: Input should be greater than or equal to 0 (received -1.0)"
    assert event.error.error_description == f"not a valid Order: {said}"


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize(
    ("before", "refused"),
    [('"orderId":"other",', "orderId"), ('"nodes":[],', "nodes"), ('"orderUpdateId":0,', "")],
)
def test_a_key_with_two_values_is_refused(before: str, refused: str, *, strict: bool) -> None:
    receiver = Receiver(strict=strict)
    receiver.order(b"{" + before.encode() + CODEC.encode(order("n0", "n1"))[1:])

    if refused:
        assert receiver.refusal["parameter"] == refused
    else:
        assert isinstance(receiver.events[0], OrderReceived)


@pytest.mark.parametrize(("map_ids", "read"), [({"hall"}, True), ({"hall", "yard"}, False)])
def test_an_order_without_map_is_on_the_only_one_of_the_robot(map_ids: set[str], *, read: bool) -> None:
    events: list[Event] = []
    robot, known = RobotKey("ACME", "0001"), frozenset(map_ids)
    inbox = Inbox(CODEC, robot, events.append, ManualClock(), map_ids=lambda: known)
    content = json.loads(CODEC.encode(order("n0", "n1")))
    del content["nodes"][1]["nodePosition"]["mapId"]

    inbox.take_message(Topic.ORDER, Inbound("x/order", json.dumps(content).encode(), retained=False))

    assert [isinstance(event, OrderReceived) for event in events] == [read]


@pytest.mark.clause("7.2")
def test_a_message_for_another_robot_is_refused() -> None:
    receiver = Receiver(serial="0002")

    receiver.order(CODEC.encode(order("n0")))

    assert receiver.refusal == {"topic": "order", "headerId": "7"}
    assert receiver.inbox.counts.misdirected == 1


@pytest.mark.clause("6.2.1/refused")
def test_the_error_of_refused_instant_actions_ends_with_the_next_ones() -> None:
    receiver = Receiver()

    receiver.inbox.take_message(Topic.INSTANT_ACTIONS, Inbound("x", b"{}", retained=False))
    receiver.order(b"{}")

    assert [event.until for event in receiver.events if isinstance(event, MessageRefused)] == [
        Until.INSTANT_ACTION_ACCEPTED,
        Until.ORDER_ACCEPTED,
    ]


LIFT = ActionDeclaration(
    "lift",
    scopes=(ActionScope.NODE, ActionScope.INSTANT),
    parameters=(
        Parameter("height", ValueDataType.NUMBER),
        Parameter("levels", ValueDataType.INTEGER),
        Parameter("slowly", ValueDataType.BOOL),
        Parameter("station", ValueDataType.STRING),
    ),
)
TEXTS = {"height": " 1.5", "levels": "3", "slowly": "True", "station": "7", "unknown": "8"}
VALUES = {"height": 1.5, "levels": 3, "slowly": True, "station": "7", "unknown": "8"}


@pytest.mark.parametrize("strict", [False, True])
def test_numbers_and_booleans_sent_as_text_are_accepted_if_the_action_declares_them(*, strict: bool) -> None:
    receiver = Receiver(actions={"lift": LIFT}, strict=strict)
    lift = Action(
        action_type="lift",
        action_id="a",
        blocking_type=BlockingType.HARD,
        action_parameters=tuple(ActionParameter(key=key, value=value) for key, value in TEXTS.items()),
    )

    receiver.order(CODEC.encode(order("n0", "n1", node_actions={"n1": [lift]})))
    receiver.inbox.take_message(
        Topic.INSTANT_ACTIONS,
        Inbound("x", CODEC.encode(InstantActions(**HEADER, actions=(lift,))), retained=False),
    )

    ordered, instant = receiver.events
    assert isinstance(ordered, OrderReceived)
    assert isinstance(instant, InstantActionsReceived)
    for taken in (ordered.order.nodes[1].actions[0], instant.message.actions[0]):
        values = {each.key: each.value for each in taken.action_parameters}
        assert values == (TEXTS if strict else VALUES)
    assert receiver.inbox.counts.repaired == (0 if strict else 2)


@pytest.mark.parametrize(
    ("changes", "read"),
    [
        ({"theta": 90}, {"theta": pi / 2}),
        ({"theta": -180.0}, {"theta": -pi}),
        ({"theta": "90"}, {"theta": pi / 2}),
        ({"theta": 4.0}, {"theta": 4.0 - 2 * pi}),
        ({"mapId": ""}, {"mapId": "hall"}),
        ({"mapId": None}, {"mapId": "hall"}),
        ({"mapId": "Hall"}, {"mapId": "hall"}),
        ({"mapId": "yard"}, {}),
        ({"lastNodeId": None}, {"lastNodeId": ""}),
        ({"x": "1.5"}, {"x": 1.5}),
        ({"lastNodeId": ""}, {}),
        ({"theta": 3.0}, {}),
        ({"theta": 400}, {}),
        ({"theta": None}, {}),
    ],
)
@pytest.mark.clause("6.2.3/initializePosition")
def test_an_initial_position_is_read_if_its_meaning_is_certain(
    changes: dict[str, JsonValue], read: dict[str, JsonValue]
) -> None:
    right: dict[str, JsonValue] = {"x": 1.0, "y": 2, "theta": 0.5, "mapId": "hall", "lastNodeId": "n1"}
    sent = right | changes
    receiver = Receiver(actions=PREDEFINED, map_ids=frozenset({"hall"}))
    given = tuple(ActionParameter(key=key, value=each) for key, each in sent.items() if each is not None)
    place = action("i", "NONE", "initializePosition").model_copy(update={"action_parameters": given})
    payload = CODEC.encode(InstantActions(**HEADER, actions=(place,)))
    receiver.inbox.take_message(Topic.INSTANT_ACTIONS, Inbound("x", payload, retained=False))

    (event,) = receiver.events
    assert isinstance(event, InstantActionsReceived)
    found = {each.key: each.value for each in event.message.actions[0].action_parameters}
    assert found == pytest.approx({key: each for key, each in (sent | read).items() if each is not None})
    assert receiver.inbox.counts.repaired == bool(read)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("NUMBER", "fast"),
        ("NUMBER", "nan"),
        ("NUMBER", "1_0"),
        ("INTEGER", "1.5"),
        ("BOOL", "1"),
        ("ARRAY", "[]"),
    ],
)
def test_a_text_that_is_not_a_valid_value_is_unchanged(kind: str, text: str) -> None:
    parameter = Parameter("p", ValueDataType(kind))

    assert parameter.read(text) == text
    assert (
        parameter.problem(parameter.read(text))
        == f"parameter 'p' must be of type {kind} (received {json.dumps(text)})"
    )
