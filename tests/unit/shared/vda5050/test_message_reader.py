from __future__ import annotations

import json
from datetime import UTC, datetime
from math import pi
from typing import Any, cast

import pytest

from nena_shared.vda5050 import message_reader as reader
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import DEVIATIONS_REMEMBERED, MessageReader
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.state import State, Velocity
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_0 import CODEC as CODEC_2_0
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from nena_shared.vda5050.versions import codec_for
from nena_shared.vda5050.visualization import Visualization
from support.fleet_examples import connection, factsheet, position, state, visualization

TOPIC = "uagv/v2/ACME/r1/state"


def test_a_robot_may_change_its_version_at_any_message() -> None:
    messages = MessageReader()
    for codec in (CODEC_2_1, CODEC_2_1, CODEC_2_0, CODEC_2_0, CODEC_2_1):
        payload = codec.encode(state(last_node_id="A"))
        message = messages.read(State, TOPIC, payload, "v2")
        assert (message.version, message.last_node_id) == (codec.version, "A")


def test_malformed_message_is_explained_and_the_next_one_is_read() -> None:
    messages = MessageReader(strict=True)
    good = CODEC_2_1.encode(state())
    messages.read(State, TOPIC, good, "v2")
    with pytest.raises(MalformedMessageError, match="headerId"):
        messages.read(State, TOPIC, good.replace(b'"headerId":1', b'"headerId":-1'), "v2")
    with pytest.raises(MalformedMessageError, match="version"):
        messages.read(State, TOPIC, good.replace(b'"2.1.0"', b'"3.0.0"'), "v2")
    assert messages.read(State, TOPIC, good, "v2").header_id == 1


@pytest.mark.parametrize(
    ("before", "told"),
    [
        ('"driving":true,', True),
        ('"driving":"?",', True),
        ('"vendor":{"a":1,"a":2},', True),
        ('"driving":false,', False),
        ('"vendor":{"a":1},', False),
    ],
)
def test_a_key_with_two_values_is_told_at_the_first_message_and_from_time_to_time(
    before: str, *, told: bool
) -> None:
    found: list[str] = []
    messages = MessageReader(lambda _, repairs: found.extend(map(str, repairs)))
    payload = b"{" + before.encode() + CODEC_2_1.encode(state(driving=False))[1:]
    for _ in range(DEVIATIONS_REMEMBERED + 1):
        assert not messages.read(State, TOPIC, payload, "v2").driving
    assert len([each for each in found if each.endswith("twice: repeated key")]) == (2 if told else 0)


def test_names_of_nodes_in_another_letter_case_are_those_of_the_plant_if_there_is_one() -> None:
    found: list[str] = []
    messages = MessageReader(lambda _, repairs: found.extend(map(str, repairs)))
    messages.know_plant("", ("Dock-1", "goal", "GOAL", "Goal-2"))
    names = {"DOCK-1": "Dock-1", "goal": "goal", "Goal": "Goal", "goal-2": "Goal-2", "": "", "x": "x"}
    for said, read in names.items():
        payload = CODEC_2_1.encode(state(last_node_id=said))
        assert messages.read(State, TOPIC, payload, "v2").last_node_id == read
    assert found == ['lastNodeId "DOCK-1": letter case', 'lastNodeId "goal-2": letter case']


def test_only_so_many_topics_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "TOPICS_REMEMBERED", 3)
    messages = MessageReader()
    for number in range(10):
        messages.read(State, f"{TOPIC}{number}", CODEC_2_1.encode(state()), "v2")
    assert len(messages._readers) <= 3


def test_a_message_that_deviates_is_repaired_and_reported_until_it_is_right_again() -> None:
    reports: list[tuple[str, tuple[Repair, ...]]] = []
    messages = MessageReader(lambda topic, repairs: reports.append((topic, repairs)))
    good = CODEC_2_1.encode(state())
    bad = good.replace(b'"headerId":1', b'"headerId":"1"')
    worse = bad.replace(b'"batteryCharge":80.0', b'"batteryCharge":101.3')
    for payload in (good, bad, worse, bad, good):
        assert messages.read(State, TOPIC, payload, "v2").header_id == 1
    number = Repair("headerId", RepairKind.TEXT_AS_NUMBER, '"1"')
    charge = Repair("batteryState.batteryCharge", RepairKind.CLAMPED, "101.3")
    assert reports == [(TOPIC, (number,)), (TOPIC, (number, charge)), (TOPIC, (number,))]


@pytest.mark.parametrize("charge", [b"101.3", b"NaN"])
def test_recent_deviations_are_repaired_without_checking_the_whole_message(
    charge: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = MessageReader()
    good = CODEC_2_1.encode(state())
    payloads = (
        good,
        good.replace(b'"batteryCharge":80.0', b'"batteryCharge":' + charge),
        good.replace(b'"headerId":1', b'"headerId":"1"'),
    )
    for payload in payloads:
        messages.read(State, TOPIC, payload, "v2")
    monkeypatch.setattr(reader, "parse", None)
    for payload in payloads:
        assert messages.read(State, TOPIC, payload, "v2").header_id == 1


def test_a_deviation_that_ended_is_forgotten_while_another_one_lasts() -> None:
    messages = MessageReader()
    lasting = CODEC_2_1.encode(state()).replace(b'"headerId":1', b'"headerId":"1"')
    for charge in (b"80.0", b"101.3"):
        payload = lasting.replace(b'"batteryCharge":80.0', b'"batteryCharge":' + charge)
        messages.read(State, TOPIC, payload, "v2")
    assert messages._readers[TOPIC].deviations == {"headerId", "batteryState.batteryCharge"}
    for _ in range(DEVIATIONS_REMEMBERED):
        messages.read(State, TOPIC, lasting, "v2")
    assert messages._readers[TOPIC].deviations == {"headerId"}
    for _ in range(2 * DEVIATIONS_REMEMBERED):
        messages.read(State, TOPIC, CODEC_2_1.encode(state()), "v2")
    assert not messages._readers[TOPIC].deviations


def test_a_robot_that_deviates_may_change_its_version() -> None:
    messages = MessageReader()
    for codec in (CODEC_2_1, CODEC_2_0, CODEC_2_1):
        payload = codec.encode(state(maps=({"map_id": "m", "map_version": "1", "map_status": "ENABLED"},)))
        payload = payload.replace(b'"headerId":1', b'"headerId":"1","maps":[]')
        message = messages.read(State, TOPIC, payload, "v2")
        assert (message.version, message.maps is None) == (codec.version, codec is CODEC_2_0)


def test_refusal_names_only_unrepairable_values() -> None:
    payload = CODEC_2_1.encode(state()).replace(b'"orderId":""', b'"orderId":[]')
    broken = payload.replace(b'"batteryCharge":80.0', b'"batteryCharge":101.3')
    with pytest.raises(MalformedMessageError) as caught:
        MessageReader().read(State, TOPIC, broken, "v2")
    assert caught.value.reason == "orderId: Input should be a valid string (received [])"


def test_an_unknown_minor_version_is_read_as_the_nearest_and_reported_once() -> None:
    reports: list[Repair] = []
    messages = MessageReader(lambda _, repairs: reports.extend(repairs))
    payload = CODEC_2_1.encode(state()).replace(b'"2.1.0"', b'"2.7.0"')
    for _ in range(3):
        assert messages.read(State, TOPIC, payload, "v2").version == "2.7.0"
    assert reports == [Repair("version", RepairKind.UNKNOWN_VERSION, "2.7.0, read as 2.1.0")]


ROBOT = RobotKey("ACME", "0001")


def test_a_command_is_repaired_only_where_its_meaning_is_certain(order: dict[str, Any]) -> None:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    order["nodes"][1]["sequenceId"] = 2.0
    order["nodes"][1]["nodePosition"]["theta"] = 3.2
    read, repairs = read_command(Order, CODEC_2_1, json.dumps(order).encode(), now=now, robot=ROBOT)
    assert read.nodes[1].sequence_id == 2
    assert {each.kind for each in repairs} == {RepairKind.WHOLE_NUMBER, RepairKind.ANGLE_WRAPPED}
    for unsafe in ({"maxSpeed": -1.0}, {"maxSpeed": "fast"}, {"released": None}):
        edges = [order["edges"][0] | unsafe]
        with pytest.raises(MalformedMessageError):
            read_command(
                Order, CODEC_2_1, json.dumps(order | {"edges": edges}).encode(), now=now, robot=ROBOT
            )


@pytest.mark.clause("7.3/deviation")
@pytest.mark.parametrize(("given", "meant"), [(-0.1, 0.0), (6.28, pi)])
def test_a_deviation_beyond_a_half_turn_allows_every_heading_and_one_below_0_none(
    order: dict[str, Any], given: float, meant: float
) -> None:
    order["nodes"][1]["nodePosition"]["allowedDeviationTheta"] = given
    read, repairs = read_command(
        Order, CODEC_2_1, json.dumps(order).encode(), now=datetime(2026, 1, 1, tzinfo=UTC), robot=ROBOT
    )
    assert read.nodes[1].node_position is not None
    assert read.nodes[1].node_position.allowed_deviation_theta == meant
    assert [each.kind for each in repairs] == [RepairKind.CLAMPED]


@pytest.mark.parametrize("given", [10, 179.0, -90.0])
def test_deviation_beyond_a_full_turn_is_refused(order: dict[str, Any], given: float) -> None:
    order["nodes"][1]["nodePosition"]["allowedDeviationTheta"] = given
    with pytest.raises(MalformedMessageError):
        read_command(
            Order, CODEC_2_1, json.dumps(order).encode(), now=datetime(2026, 1, 1, tzinfo=UTC), robot=ROBOT
        )


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999", "9" * 400])
@pytest.mark.parametrize("field", ["x", "y", "theta"])
def test_position_with_nan_is_omitted_despite_other_usual_deviations(field: str, value: str) -> None:
    messages = MessageReader()
    turned = json.loads(CODEC_2_1.encode(state()))
    position = {"x": 1.0, "y": 2.0, "theta": 3.2, "mapId": "hall", "positionInitialized": True}
    turned["agvPosition"] = position
    assert messages.read(State, TOPIC, json.dumps(turned).encode(), "v2").mobile_robot_position
    turned["agvPosition"][field] = "HERE"
    payload = json.dumps(turned).replace('"HERE"', value).encode()
    assert messages.read(State, TOPIC, payload, "v2").mobile_robot_position is None


def test_an_integer_beyond_all_floats_is_repaired_or_refused_but_never_breaks_the_reader() -> None:
    messages = MessageReader()
    huge = CODEC_2_1.encode(state()).replace(b'"orderUpdateId":0', b'"orderUpdateId":' + b"9" * 400)
    for _ in range(2):
        assert messages.read(State, TOPIC, huge, "v2").order_update_id == 0
    with_order = huge.replace(b'"orderId":""', b'"orderId":"o1"')
    with pytest.raises(MalformedMessageError, match="orderUpdateId"):
        messages.read(State, TOPIC, with_order, "v2")


OTHERS = ("1.3.2", "1.1", "0.8.4", "5.0.0", "VDA1_1", "v9", 7, "")
KINDS: list[type[Header]] = [State, Connection, Visualization, Factsheet]


def content_of(kind: type[Header], version: str) -> dict[str, Any]:
    """Return a message that conforms to a version."""
    made: dict[type[Header], Header] = {
        State: state(mobile_robot_position=position(4.0, 0.0)),
        Connection: connection(),
        Visualization: visualization(x=4.0),
        Factsheet: factsheet(),
    }
    return cast("dict[str, Any]", json.loads(codec_for(version).encode(made[kind])))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("version", "stated"),
    [("2.1.0", each) for each in (*OTHERS, "3.0.0", "3.0.1")]
    + [("3.0.0", each) for each in (*OTHERS, "2.1.0", "2.0.0", "v2")],
)
def test_the_topic_decides_the_version_not_the_header(kind: type[Header], version: str, stated: Any) -> None:
    reports: list[Repair] = []
    major = f"v{version[0]}"
    topic = f"uagv/{major}/FIELD/r2/x"
    payload = json.dumps({**content_of(kind, version), "version": stated}).encode()
    messages = MessageReader(lambda _, repairs: reports.extend(repairs))
    for _ in range(2):
        reports.clear()
        assert messages.read(kind, topic, payload, major).version.startswith(version[0])
        assert [each.field for each in reports] == ["version"]
    with pytest.raises(MalformedMessageError, match="version"):
        MessageReader(strict=True).read(kind, topic, payload, major)


@pytest.mark.parametrize("kind", [State, Factsheet])
@pytest.mark.parametrize("stated", ["1.3.2", "3.0.0", "2.1.0"])
@pytest.mark.parametrize(("version", "major"), [("3.0.0", "v2"), ("2.1.0", "v3")])
def test_a_message_in_the_form_of_another_version_than_its_topic_is_refused_as_such(
    kind: type[Header], version: str, major: str, stated: str
) -> None:
    payload = json.dumps({**content_of(kind, version), "version": stated}).encode()
    with pytest.raises(
        MalformedMessageError, match=rf"a field of VDA 5050 {version[0]}\.x, but is on a topic of {major}"
    ):
        MessageReader().read(kind, f"uagv/{major}/FIELD/r2/x", payload, major)


def test_one_heading_beyond_a_full_turn_makes_all_of_a_robot_degrees() -> None:
    reports: list[str] = []
    messages = MessageReader(lambda _, repairs: reports.extend(map(str, repairs)))

    def read(kind: type[State | Visualization], theta: Any, robot: str = "r1", **fields: Any) -> float:
        reports.clear()
        content = content_of(kind, "2.1.0") | fields
        content["agvPosition"]["theta"] = theta
        payload = json.dumps(content).encode()
        message = messages.read(
            kind, f"uagv/v2/FIELD/{robot}/x/{kind.__name__}".replace("/x", ""), payload, "v2"
        )
        assert message.mobile_robot_position
        return message.mobile_robot_position.theta

    assert read(State, 3.0) == 3.0
    assert read(State, 90) == pytest.approx(pi / 2)
    assert reports == ["agvPosition.theta 90: degrees"]
    for kind in (State, Visualization):
        for fields in ({}, {"version": "1.3.2"}, {"timestamp": 1_795_858_193}):
            assert read(kind, 3, **fields) == pytest.approx(3 * pi / 180)
            assert "agvPosition.theta 3: degrees" in reports
            assert read(kind, "270.0", **fields) == pytest.approx(-pi / 2)
    assert read(State, 3.0, robot="r2") == 3.0
    unreadable = {**content_of(State, "2.1.0"), "nodeStates": 5}
    unreadable["agvPosition"]["theta"] = 180
    seen = messages.sighting("uagv/v2/FIELD/r1/state", json.dumps(unreadable).encode(), "v2")
    assert seen
    assert seen.mobile_robot_position
    assert abs(seen.mobile_robot_position.theta) == pytest.approx(pi)


def test_a_visualization_without_a_header_does_not_deviate() -> None:
    repairs: list[Repair] = []
    messages = MessageReader(lambda _, found: repairs.extend(found))

    for _ in range(2):
        message = messages.read(
            Visualization, "uagv/v2/ACME/r1/visualization", b'{"velocity": {"vx": 1.0}}', "v2"
        )
        assert message.velocity == Velocity(vx=1.0)
    assert not repairs


def test_a_visualization_that_names_no_state_shows_where_the_robot_is() -> None:
    repairs: list[Repair] = []
    content = content_of(Visualization, "3.0.0")
    del content["referenceStateHeaderId"]

    message = MessageReader(lambda _, found: repairs.extend(found)).read(
        Visualization, "vda5050/v3/ACME/r1/visualization", json.dumps(content).encode(), "v3"
    )

    assert message.mobile_robot_position
    assert [str(each) for each in repairs] == ["referenceStateHeaderId missing: replaced"]
