"""What 3.0 reads besides its own spelling, as its text and schemas disagree, and what it never sends."""

from __future__ import annotations

import json
from math import pi
from typing import Any

import pytest

from nena_shared.vda5050.action import BlockingType, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import AllowedDeviationXY, CorridorReferencePoint, Order
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.responses import GrantType, Responses
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from nena_shared.vda5050.v3_0 import CODEC
from nena_shared.vda5050.versions import CODECS
from nena_shared.vda5050.zone_set import ZoneReleaseLossBehavior, ZoneSetTransfer
from support.json_messages import JsonMessages
from support.reference import reference_dir
from support.schemas import schema_problems

JsonObject = dict[str, Any]
MESSAGES = JsonMessages(CODEC)
read, written = MESSAGES.read, MESSAGES.written


def zone_set(header: JsonObject, *zones: JsonObject) -> JsonObject:
    return header | {"zoneSet": {"mapId": "m", "zoneSetId": "s", "zones": list(zones)}}


@pytest.mark.clause("7.3", "7.8", "7.10/message")
@pytest.mark.parametrize(("kind", "name"), [(Order, "order"), (State, "state"), (Factsheet, "factsheet")])
def test_examples_fit_the_schema_and_round_trip(
    request: pytest.FixtureRequest, kind: type[Header], name: str
) -> None:
    content = request.getfixturevalue(name)

    payload = CODEC.encode(read(kind, content))

    assert schema_problems("3.0.0", name, json.dumps(content).encode()) == []
    assert json.loads(payload) == content


def test_example_of_the_reference_is_read() -> None:
    lines = reference_dir("vda5050.md").read_text(encoding="utf-8").splitlines()
    state = next(line for line in lines if line.startswith("Smallest valid state 3.0:")).split("`")[1]

    assert CODEC.decode(State, state.encode()).header_id == 7


@pytest.mark.clause("7.2/timestamp")
def test_time_is_written_in_milliseconds(state: JsonObject) -> None:
    message = read(State, state | {"timestamp": "2026-01-01T00:00:05.123456Z"})

    assert written(message)["timestamp"] == "2026-01-01T00:00:05.123Z"


@pytest.mark.clause("7.2/version")
def test_major_version_is_its_own(state: JsonObject) -> None:
    with pytest.raises(MalformedMessageError, match=r"2\.1\.0 is not of the same major version as 3\.0\.0"):
        read(State, state | {"version": "2.1.0"})


@pytest.mark.clause("7.2/lenient")
@pytest.mark.parametrize("missing", ["headerId", "timestamp", "version", "manufacturer", "serialNumber"])
def test_factsheet_without_a_complete_header_is_refused(factsheet: JsonObject, missing: str) -> None:
    del factsheet[missing]

    with pytest.raises(MalformedMessageError, match=missing):
        read(Factsheet, factsheet)


@pytest.mark.clause("7.7", "6.6.6/STARTUP")
def test_spellings_of_2_x_are_read(header: JsonObject, state: JsonObject) -> None:
    broken = read(Connection, header | {"connectionState": "CONNECTIONBROKEN"})

    assert broken.connection_state is ConnectionState.CONNECTION_BROKEN
    assert written(broken)["connectionState"] == "CONNECTION_BROKEN"
    assert read(State, state | {"operatingMode": "TEACHIN"}).operating_mode is OperatingMode.TEACH_IN


@pytest.mark.clause("7.3")
def test_edge_reads_the_name_of_the_schema_and_the_spelling_of_2_x(order: JsonObject) -> None:
    corridor = {"leftWidth": 1, "rightWidth": 1, "corridorReferencePoint": "KINEMATICCENTER"}
    order["edges"][0] |= {"maxRotationSpeed": 0.5, "corridor": corridor}

    message = read(Order, order)
    edge = written(message)["edges"][0]

    assert message.edges[0].corridor.corridor_reference_point is CorridorReferencePoint.KINEMATIC_CENTER
    assert edge["maximumRotationSpeed"] == 0.5
    assert "maxRotationSpeed" not in edge
    assert edge["corridor"]["corridorReferencePoint"] == "KINEMATIC_CENTER"


@pytest.mark.clause("7.4")
def test_position_is_initialized_by_either_name(instant_action: JsonObject) -> None:
    instant_action["actions"][0]["actionType"] = "initPosition"

    assert read(InstantActions, instant_action).actions[0].action_type == "initializePosition"


@pytest.mark.clause("6.2.1/blocking")
@pytest.mark.parametrize("blocking", BlockingType)
def test_instant_action_never_blocks(instant_action: JsonObject, blocking: BlockingType) -> None:
    instant_action["actions"][0]["blockingType"] = blocking

    assert read(InstantActions, instant_action).actions[0].blocking_type is BlockingType.NONE


@pytest.mark.clause("6.2.1/blocking")
def test_instant_action_without_a_word_for_blocking_is_refused(instant_action: JsonObject) -> None:
    instant_action["actions"][0]["blockingType"] = "LOOSE"

    with pytest.raises(MalformedMessageError, match="blockingType"):
        read(InstantActions, instant_action)


@pytest.mark.clause("7.3/deviation")
@pytest.mark.parametrize(
    ("turn", "told"), [(0.5, 0.5), (pi / 2, pi / 2), (3.0, 3.0 - pi), (-2.0, pi - 2.0), (-pi, 0.0)]
)
def test_ellipse_is_turned_by_at_most_a_quarter(order: JsonObject, turn: float, told: float) -> None:
    message = read(Order, order)
    wide = AllowedDeviationXY(a=2.0, b=1.0, theta=turn)
    position = message.nodes[1].node_position.model_copy(update={"allowed_deviation_xy": wide})
    nodes = (message.nodes[0], message.nodes[1].model_copy(update={"node_position": position}))

    sent = written(message.model_copy(update={"nodes": nodes}))["nodes"][1]["nodePosition"]

    assert sent["allowedDeviationXY"] == {"a": 2.0, "b": 1.0, "theta": pytest.approx(told)}


@pytest.mark.clause("7.1/types", "7.3/theta")
@pytest.mark.parametrize("version", CODECS)
def test_the_angle_limit_of_3_0_1_is_read_in_every_version_and_written_within_a_half_turn(
    order: JsonObject, version: str
) -> None:
    codec = CODECS[version]
    message = read(Order, order)
    theta = {"theta": 3.1416, "allowed_deviation_theta": 3.1416}
    position = message.nodes[1].node_position.model_copy(update=theta)
    nodes = (message.nodes[0], message.nodes[1].model_copy(update={"node_position": position}))

    payload = codec.encode(message.model_copy(update={"nodes": nodes}))

    assert schema_problems(version, "order", payload) == []
    sent = json.loads(payload)
    assert sent["nodes"][1]["nodePosition"]["theta"] == pytest.approx(3.1416 - 2 * pi)
    sent["nodes"][1]["nodePosition"] |= {"theta": 3.1416, "allowedDeviationTheta": 3.1416}
    position = codec.decode(Order, json.dumps(sent).encode()).nodes[1].node_position
    assert position is not None
    assert position.theta == 3.1416
    sent["nodes"][1]["nodePosition"]["theta"] = 3.142
    with pytest.raises(MalformedMessageError, match="theta"):
        codec.decode(Order, json.dumps(sent).encode())


@pytest.mark.clause("7.3/trajectory")
def test_control_point_without_weight_shapes_nothing(order: JsonObject) -> None:
    order["edges"][0]["trajectory"] = {"controlPoints": [{"x": 0, "y": 0, "weight": 0}, {"x": 1, "y": 0}]}

    with pytest.raises(MalformedMessageError, match="weight"):
        read(Order, order)


@pytest.mark.clause("7.1/unknown")
def test_zone_set_of_2_x_is_an_unknown_field(order: JsonObject, state: JsonObject) -> None:
    assert read(Order, order | {"zoneSetId": 5}).zone_set_id is None
    assert read(State, state | {"zoneSetId": 5}).zone_set_id is None


@pytest.mark.clause("6.9")
def test_queued_request_is_read_and_still_a_request_when_sent(state: JsonObject) -> None:
    request = {
        "requestId": "r",
        "requestType": "ACCESS",
        "zoneId": "z",
        "zoneSetId": "s",
        "requestStatus": "QUEUED",
    }

    message = read(State, state | {"zoneRequests": [request]})

    assert message.zone_requests[0].request_status is RequestStatus.QUEUED
    assert written(message)["zoneRequests"] == [request | {"requestStatus": "REQUESTED"}]


@pytest.mark.clause("6.6.5.4")
def test_older_name_of_an_error_is_read(state: JsonObject) -> None:
    state["errors"] = [{"errorType": "INVALID_ORDER", "errorLevel": "WARNING"}]

    assert read(State, state).errors[0].error_type == "INVALID_ORDER_ACTION"


@pytest.mark.clause("7.8")
def test_arrival_is_a_moment(state: JsonObject) -> None:
    point = {"x": 1.0, "y": 2.0, "eta": "2026-01-01T00:00:05.500Z"}

    message = read(State, state | {"intermediatePath": {"polyline": [point]}})

    assert written(message)["intermediatePath"] == {"polyline": [point]}


@pytest.mark.clause("7.5")
@pytest.mark.parametrize("name", ["grantType", "responseType"])
def test_response_is_read_by_both_names(header: JsonObject, name: str) -> None:
    message = read(Responses, header | {"responses": [{"requestId": "r", name: "GRANTED"}]})

    assert message.responses[0].grant_type is GrantType.GRANTED
    assert written(message)["responses"] == [{"requestId": "r", "grantType": "GRANTED"}]


@pytest.mark.clause("7.10/message")
def test_factsheet_reads_what_its_faulty_schema_demands(factsheet: JsonObject) -> None:
    specification = factsheet["typeSpecification"]
    specification["mobileRobotKinematic"] = specification.pop("mobileRobotKinematics")
    factsheet["mobileRobotConfiguration"] = {"batteryCharging ": {"minimumChargingTime": 5.0}}

    sent = written(read(Factsheet, factsheet))

    assert sent["typeSpecification"]["mobileRobotKinematics"] == "DIFFERENTIAL"
    assert sent["mobileRobotConfiguration"] == {"batteryCharging": {"minimumChargingTime": 5.0}}


@pytest.mark.clause("7.10/message")
def test_factsheet_reads_the_spellings_of_2_x(factsheet: JsonObject) -> None:
    factsheet["typeSpecification"] |= {"mobileRobotKinematics": "OMNI", "navigationTypes": ["AUTONOMOUS"]}
    features = factsheet["protocolFeatures"]
    features["mobileRobotActions"][0]["actionParameters"][0]["valueDataType"] = "FLOAT"
    features["optionalParameters"] = [{"parameter": "order.edges.maxRotationSpeed", "support": "REQUIRED"}]

    message = read(Factsheet, factsheet)

    assert message.type_specification.mobile_robot_kinematics == "OMNIDIRECTIONAL"
    assert message.type_specification.navigation_types == ("FREELY_NAVIGATING",)
    assert message.protocol_features.mobile_robot_actions[0].action_parameters[0].value_data_type == "NUMBER"
    assert message.protocol_features.optional_parameters[0].parameter == "order.edges.maximumRotationSpeed"


@pytest.mark.clause("7.6")
@pytest.mark.parametrize(
    ("zone_type", "misspelt", "name", "value"),
    [
        ("PRIORITY", "priorityFactor ", "priorityFactor", 0.5),
        ("PENALTY", "penaltyFactor ", "penaltyFactor", 1.0),
        ("DIRECTED", "limitation", "directedLimitation", "STRICT"),
        ("BIDIRECTED", "limitation", "bidirectedLimitation", "SOFT"),
    ],
)
def test_zone_reads_what_its_faulty_schema_demands(
    header: JsonObject, zone: JsonObject, *, zone_type: str, misspelt: str, name: str, value: object
) -> None:
    directed = {"direction": 1.0} if name.endswith("Limitation") else {}

    message = read(
        ZoneSetTransfer, zone_set(header, zone | directed | {"zoneType": zone_type, misspelt: value})
    )

    sent = written(message)["zoneSet"]["zones"][0]
    assert sent == zone | directed | {"zoneType": zone_type, name: value}


@pytest.mark.clause("7.6")
@pytest.mark.parametrize(
    ("zone_type", "needed"),
    [
        ("SPEED_LIMIT", "maximumSpeed"),
        ("ACTION", "entryActions, duringActions, exitActions"),
        ("PRIORITY", "priorityFactor"),
        ("PENALTY", "penaltyFactor"),
        ("DIRECTED", "direction, directedLimitation"),
        ("BIDIRECTED", "direction, bidirectedLimitation"),
    ],
)
def test_zone_without_what_its_type_needs_is_refused(
    header: JsonObject, zone: JsonObject, zone_type: str, needed: str
) -> None:
    with pytest.raises(MalformedMessageError, match=f"a {zone_type} zone needs {needed}"):
        read(ZoneSetTransfer, zone_set(header, zone | {"zoneType": zone_type}))


@pytest.mark.clause("7.6")
@pytest.mark.parametrize("zone_type", ["STRANGE", 5, [], {}])
def test_zone_of_no_type_is_refused(header: JsonObject, zone: JsonObject, zone_type: object) -> None:
    with pytest.raises(MalformedMessageError, match="zoneType"):
        read(ZoneSetTransfer, zone_set(header, zone | {"zoneType": zone_type, "limitation": "SOFT"}))


@pytest.mark.clause("7.6")
def test_lost_release_means_stop(header: JsonObject, zone: JsonObject) -> None:
    message = read(ZoneSetTransfer, zone_set(header, zone | {"zoneType": "RELEASE"}))

    assert message.zone_set.zones[0].release_loss_behavior is ZoneReleaseLossBehavior.STOP
    kept = zone_set(header, zone | {"zoneType": "RELEASE", "releaseLossBehavior": "EVACUATE"})
    assert written(read(ZoneSetTransfer, kept)) == kept


@pytest.mark.clause("7.6")
def test_area_has_three_corners_and_each_zone_its_own_id(header: JsonObject, zone: JsonObject) -> None:
    with pytest.raises(MalformedMessageError, match="vertices"):
        read(ZoneSetTransfer, zone_set(header, zone | {"vertices": zone["vertices"][:2]}))
    with pytest.raises(MalformedMessageError, match="zoneId 'z' occurs twice"):
        read(ZoneSetTransfer, zone_set(header, zone, zone))


@pytest.mark.clause("4.3")
def test_message_that_2_x_does_not_have(header: JsonObject, zone: JsonObject) -> None:
    content = zone_set(header, zone)

    with pytest.raises(MalformedMessageError, match=r"2\.1\.0 has no such message"):
        CODEC_2_1.encode(read(ZoneSetTransfer, content))
    with pytest.raises(MalformedMessageError, match=r"2\.1\.0 has no such message"):
        CODEC_2_1.decode(ZoneSetTransfer, json.dumps(content).encode())
