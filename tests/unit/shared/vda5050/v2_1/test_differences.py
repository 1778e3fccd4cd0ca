"""Differences of 2.1 from 3.0."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest

from nena_shared.vda5050.action import ActionParameter, BlockingType, InstantActions
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType, error
from nena_shared.vda5050.factsheet import Factsheet, OptionalParameter, Support
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import (
    AllowedDeviationXY,
    Corridor,
    CorridorReferencePoint,
    Order,
    ReleaseLossBehavior,
)
from nena_shared.vda5050.state import EmergencyStop, OperatingMode, State
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.v2_1.order import uniform_knots
from nena_shared.vda5050.v2_1.state import REJECTIONS, WRITTEN
from nena_shared.vda5050.visualization import Visualization
from support.json_messages import JsonMessages
from support.reference import reference_dir

JsonObject = dict[str, Any]
MESSAGES = JsonMessages(CODEC)
read, written = MESSAGES.read, MESSAGES.written
STOPPING = {
    "nodeUnreachable",
    "localizationError",
    "outsideOfCorridor",
    "actionFailed",
    "blockedZoneViolation",
    "releaseLost",
    "zoneActionConflict",
}
ORDER_FIELDS = {"orderId", "orderUpdateId", "nodes", "edges"}


def test_examples_of_the_reference_are_read() -> None:
    lines = reference_dir("vda5050.md").read_text(encoding="utf-8").splitlines()
    order, state = (
        next(line for line in lines if line.startswith(name)).split("`")[1]
        for name in ("Minimal order 2.1:", "Smallest valid state 2.1:")
    )

    assert CODEC.decode(Order, order.encode()).order_id == "o1"
    assert CODEC.decode(State, state.encode()).header_id == 7


@pytest.mark.clause("7.3/rotation")
@pytest.mark.parametrize(("allowed", "before_entering"), [(True, False), (False, True), (None, None)])
def test_rotation_allowed_is_the_inverse(order: JsonObject, *, allowed: Any, before_entering: Any) -> None:
    if allowed is not None:
        order["edges"][0]["rotationAllowed"] = allowed

    message = read(Order, order)

    assert message.edges[0].reach_orientation_before_entering is before_entering
    assert written(message)["edges"][0].get("rotationAllowed") is allowed


@pytest.mark.clause("7.3/deviation")
def test_deviation_is_a_circle(order: JsonObject) -> None:
    message = read(Order, order)
    position = message.nodes[1].node_position

    assert position.allowed_deviation_xy == AllowedDeviationXY(a=0.3, b=0.3)
    wide = position.model_copy(update={"allowed_deviation_xy": AllowedDeviationXY(a=2.0, b=0.5, theta=1.0)})
    nodes = (message.nodes[0], message.nodes[1].model_copy(update={"node_position": wide}))
    again = written(message.model_copy(update={"nodes": nodes}))
    assert again["nodes"][1]["nodePosition"]["allowedDeviationXY"] == 0.5


@pytest.mark.clause("7.3/deviation")
@pytest.mark.parametrize("deviation", ["0.3", True, -1, {"a": 1, "b": "x"}])
def test_deviation_is_not_negative(order: JsonObject, deviation: object) -> None:
    order["nodes"][1]["nodePosition"]["allowedDeviationXY"] = deviation

    with pytest.raises(MalformedMessageError, match="allowedDeviationXY"):
        read(Order, order)


@pytest.mark.clause("6.1.1/ends")
def test_edges_name_their_ends(order: JsonObject) -> None:
    edge = written(read(Order, order))["edges"][0]

    assert (edge["startNodeId"], edge["endNodeId"]) == ("A", "B")


@pytest.mark.clause("6.1.1/ends")
@pytest.mark.parametrize("missing", ["startNodeId", "endNodeId"])
def test_edges_that_do_not_name_their_ends_are_refused(order: JsonObject, missing: str) -> None:
    del order["edges"][0][missing]

    with pytest.raises(MalformedMessageError, match=missing):
        read(Order, order)


@pytest.mark.clause("6.1.1/ends")
def test_edge_that_joins_other_nodes_is_refused(order: JsonObject) -> None:
    order["edges"][0]["endNodeId"] = "C"

    with pytest.raises(MalformedMessageError, match="goes from 'A' to 'C', but is between 'A' and 'B'"):
        read(Order, order)


@pytest.mark.clause("6.1.5")
def test_corridor_that_needs_a_release_is_left_out(order: JsonObject) -> None:
    message = read(Order, order)
    free = Corridor(
        left_width=1.0,
        right_width=2.0,
        corridor_reference_point=CorridorReferencePoint.KINEMATIC_CENTER,
        release_loss_behavior=ReleaseLossBehavior.STOP,
    )

    def corridor(given: Corridor) -> Any:
        edge = message.edges[0].model_copy(update={"corridor": given})
        return written(message.model_copy(update={"edges": (edge,)}))["edges"][0].get("corridor")

    assert corridor(free) == {"leftWidth": 1.0, "rightWidth": 2.0, "corridorRefPoint": "KINEMATICCENTER"}
    assert corridor(free.model_copy(update={"release_required": True})) is None


@pytest.mark.clause("7.3/trajectory")
@pytest.mark.parametrize(
    ("points", "degree", "knots"),
    [
        (2, 1, (0, 0, 1, 1)),
        (3, 1, (0, 0, 0.5, 1, 1)),
        (3, 2, (0, 0, 0, 1, 1, 1)),
        (5, 3, (0, 0, 0, 0, 0.5, 1, 1, 1, 1)),
    ],
)
def test_knots_by_default_are_clamped_and_even(points: int, degree: int, knots: tuple[float, ...]) -> None:
    assert uniform_knots(points, degree) == knots


@pytest.mark.clause("7.3/trajectory")
def test_trajectory_of_an_absurd_degree_costs_nothing(order: JsonObject) -> None:
    order["edges"][0]["trajectory"] = {"degree": 2_000_000_000, "controlPoints": [{"x": 0, "y": 0}]}

    assert read(Order, order).edges[0].trajectory.knot_vector is None


@pytest.mark.clause("7.4", "6.2.3/initializePosition")
def test_initial_position_has_a_shorter_name(instant_action: JsonObject) -> None:
    message = read(InstantActions, instant_action)

    assert message.actions[0].action_type == "initializePosition"
    assert written(message)["actions"][0]["actionType"] == "initPosition"


@pytest.mark.clause("6.2.2/single")
def test_single_becomes_hard(instant_action: JsonObject) -> None:
    message = read(InstantActions, instant_action)
    action = message.actions[0].model_copy(update={"blocking_type": BlockingType.SINGLE})

    again = written(message.model_copy(update={"actions": (action,)}))

    assert again["actions"][0]["blockingType"] == "HARD"


@pytest.mark.clause("7.8/safety")
def test_autoack_is_a_field_violation(state: JsonObject) -> None:
    state["safetyState"] = {"eStop": "AUTOACK", "fieldViolation": False}

    safety = read(State, state).safety_state

    assert (safety.active_emergency_stop, safety.field_violation) == (EmergencyStop.NONE, True)


@pytest.mark.clause("7.8/safety")
@pytest.mark.parametrize("stop", ["MANUAL", "REMOTE", "NONE"])
def test_other_stops_stay(state: JsonObject, stop: str) -> None:
    state["safetyState"] = {"eStop": stop, "fieldViolation": False}

    message = read(State, state)

    assert message.safety_state.field_violation is False
    assert written(message)["safetyState"] == state["safetyState"]


@pytest.mark.clause("6.6.6/STARTUP", "6.6.6/INTERVENED")
@pytest.mark.parametrize(
    ("mode", "name"),
    [
        (OperatingMode.TEACH_IN, "TEACHIN"),
        (OperatingMode.STARTUP, "SERVICE"),
        (OperatingMode.INTERVENED, "AUTOMATIC"),
        (OperatingMode.SEMIAUTOMATIC, "SEMIAUTOMATIC"),
    ],
)
def test_operating_modes(state: JsonObject, mode: OperatingMode, name: str) -> None:
    message = read(State, state).model_copy(update={"operating_mode": mode})

    assert written(message)["operatingMode"] == name
    assert written(message).get("paused") is (True if mode is OperatingMode.INTERVENED else None)


@pytest.mark.clause("6.6.6/STARTUP")
def test_teach_in_is_read_in_either_spelling(state: JsonObject) -> None:
    for spelling in ("TEACHIN", "TEACH_IN"):
        assert read(State, state | {"operatingMode": spelling}).operating_mode is OperatingMode.TEACH_IN


@pytest.mark.clause("7.7")
def test_connection_broken_has_no_underscore(order: JsonObject) -> None:
    header = {
        name: order[name] for name in ("headerId", "timestamp", "version", "manufacturer", "serialNumber")
    }
    message = read(Connection, header | {"connectionState": "CONNECTIONBROKEN"})

    assert message.connection_state is ConnectionState.CONNECTION_BROKEN
    assert written(message) == header | {"connectionState": "CONNECTIONBROKEN"}


@pytest.mark.clause("7.1/unknown")
def test_fields_of_3_0_are_unknown_fields(state: JsonObject) -> None:
    state |= {"plannedPath": 5, "intermediatePath": "x", "instantActionStates": [{"bad": 1}]}
    state["batteryState"]["batteryCurrent"] = "much"

    message = read(State, state)

    assert message.planned_path is None
    assert message.power_supply.battery_current is None
    assert message.instant_action_states == ()


@pytest.mark.clause("6.6.5.4")
def test_every_error_type_has_a_name_of_2_x() -> None:
    assert set(WRITTEN) == set(ErrorType) >= REJECTIONS.keys()
    assert WRITTEN[ErrorType.NODE_UNREACHABLE] == "nodeUnreachable"
    assert WRITTEN[ErrorType.OUTDATED_ORDER_UPDATE] == "orderUpdateError"


@pytest.mark.clause("6.6.5.1", "6.6.5.3", "6.6.5.4")
@pytest.mark.parametrize("kind", ErrorType)
def test_only_errors_that_stop_the_robot_are_fatal(state: JsonObject, kind: ErrorType) -> None:
    entry = error(kind, "why", hint="do this", order_id="o1")
    stops_the_robot = WRITTEN[kind] in STOPPING

    sent = written(read(State, state).model_copy(update={"errors": (entry,)}))["errors"][0]

    assert sent["errorType"] == WRITTEN[kind]
    assert sent["errorLevel"] == ("FATAL" if stops_the_robot else "WARNING")
    assert sent["errorReferences"] == [{"referenceKey": "orderId", "referenceValue": "o1"}]
    assert (sent["errorDescription"], sent["errorHint"]) == ("why", "do this")


@pytest.mark.clause("6.6.5.1")
@pytest.mark.parametrize(
    ("level", "name"),
    [
        (ErrorLevel.WARNING, "WARNING"),
        (ErrorLevel.URGENT, "WARNING"),
        (ErrorLevel.CRITICAL, "FATAL"),
        (ErrorLevel.FATAL, "FATAL"),
    ],
)
def test_levels_of_errors_of_its_own(state: JsonObject, level: ErrorLevel, name: str) -> None:
    entry = error(ErrorType.ACTION_FAILED, "why").model_copy(
        update={"error_type": "somethingElse", "error_level": level}
    )

    sent = written(read(State, state).model_copy(update={"errors": (entry,)}))["errors"][0]

    assert (sent["errorType"], sent["errorLevel"]) == ("somethingElse", name)


@pytest.mark.clause("6.6.5.4")
def test_unknown_error_types_are_read_unchanged(state: JsonObject) -> None:
    state["errors"] = [{"errorType": "ovenTooHot", "errorLevel": "FATAL"}]

    assert read(State, state).errors[0].error_type == "ovenTooHot"


@pytest.mark.clause("6.2.3/waitForTrigger", "7.4")
def test_single_trigger_is_a_list_in_3_0(instant_action: JsonObject) -> None:
    action = instant_action["actions"][0]
    action |= {"actionType": "waitForTrigger", "actionParameters": [{"key": "triggerType", "value": "LOCAL"}]}

    message = read(InstantActions, instant_action)

    assert message.actions[0].parameter("triggerType") == ["LOCAL"]
    assert written(message)["actions"][0]["actionParameters"] == action["actionParameters"]


def test_trigger_of_another_type_is_unchanged(instant_action: JsonObject) -> None:
    action = instant_action["actions"][0]
    action |= {"actionType": "waitForTrigger", "actionParameters": [{"key": "triggerType", "value": 3}]}

    assert read(InstantActions, instant_action).actions[0].parameter("triggerType") == 3


@pytest.mark.clause("6.2.3/waitForTrigger")
def test_first_of_several_triggers_is_written(instant_action: JsonObject) -> None:
    triggers = ActionParameter(key="triggerType", value=["FLEET_CONTROL", "LOCAL"])
    message = read(InstantActions, instant_action)
    action = message.actions[0].model_copy(
        update={"action_type": "waitForTrigger", "action_parameters": (triggers,)}
    )

    sent = written(message.model_copy(update={"actions": (action,)}))["actions"][0]

    assert sent["actionParameters"] == [{"key": "triggerType", "value": "FLEET_CONTROL"}]


@pytest.mark.clause("6.1.3/named")
def test_cancel_does_not_name_the_order(instant_action: JsonObject) -> None:
    parameters = (ActionParameter(key="orderId", value="o1"), ActionParameter(key="why", value="x"))
    message = read(InstantActions, instant_action)
    action = message.actions[0].model_copy(
        update={"action_type": "cancelOrder", "action_parameters": parameters}
    )

    sent = written(message.model_copy(update={"actions": (action,)}))["actions"][0]

    assert sent["actionParameters"] == [{"key": "why", "value": "x"}]


@pytest.mark.clause("6.10/parameters", "7.10/message")
def test_optional_parameters_have_the_names_of_the_version(factsheet: JsonObject) -> None:
    listed = ["order.edges.maxSpeed", "order.edges.corridor.corridorRefPoint", "order.edges.rotationAllowed"]
    factsheet["protocolFeatures"]["optionalParameters"] = [
        {"parameter": each, "support": "SUPPORTED"} for each in listed
    ]

    message = read(Factsheet, factsheet)

    parameters = message.protocol_features.optional_parameters
    assert [each.parameter for each in parameters] == [
        "order.edges.maximumSpeed",
        "order.edges.corridor.corridorReferencePoint",
        "order.edges.reachOrientationBeforeEntering",
    ]
    sent = written(message)["protocolFeatures"]["optionalParameters"]
    assert [each["parameter"] for each in sent] == listed


@pytest.mark.clause("6.10/parameters")
def test_optional_parameters_missing_in_2_1_are_omitted(factsheet: JsonObject) -> None:
    message = read(Factsheet, factsheet)
    features = message.protocol_features.model_copy(
        update={
            "optional_parameters": tuple(
                OptionalParameter(parameter=each, support=Support.SUPPORTED)
                for each in ("order.edges.corridor.releaseRequired", "order.edges.actions.retriable")
            )
        }
    )

    sent = written(message.model_copy(update={"protocol_features": features}))

    assert sent["protocolFeatures"]["optionalParameters"] == []


@pytest.mark.clause("6.6.5.2")
def test_errors_refer_to_parameters_by_the_names_of_the_version(state: JsonObject) -> None:
    references = [
        {"referenceKey": "parameter", "referenceValue": "edges.maxSpeed"},
        {"referenceKey": "edges.maxHeight", "referenceValue": "maxHeight"},
        {"referenceKey": "orderId", "referenceValue": "maxSpeed"},
    ]
    entry = {"errorType": "orderError", "errorLevel": "WARNING", "errorReferences": references}

    message = read(State, state | {"errors": [entry]})

    assert [(each.reference_key, each.reference_value) for each in message.errors[0].error_references] == [
        ("parameter", "edges.maximumSpeed"),
        ("edges.maximumMobileRobotHeight", "maxHeight"),
        ("orderId", "maxSpeed"),
    ]
    assert written(message)["errors"][0]["errorReferences"] == references


@pytest.mark.clause("7.2/lenient")
@pytest.mark.parametrize("missing", ["headerId", "timestamp"])
def test_factsheet_may_come_without(factsheet: JsonObject, missing: str) -> None:
    del factsheet[missing]
    before = datetime.now(UTC)

    message = read(Factsheet, factsheet)

    assert message.header_id == factsheet.get("headerId", 0)
    assert message.timestamp >= before or missing == "headerId"


@pytest.mark.clause("7.2/lenient", "7.9")
def test_visualization_may_come_without_a_header() -> None:
    before = datetime.now(UTC)

    message = read(Visualization, {"velocity": {"vx": 1.0}})

    assert (message.header_id, message.version, message.manufacturer) == (0, "2.1.0", "")
    assert before <= message.timestamp <= datetime.now(UTC)
    assert message.velocity.vx == 1.0


@pytest.mark.clause("7.3/zoneSetId")
def test_zone_set_in_use_is_an_id_alone(order: JsonObject, state: JsonObject) -> None:
    assert read(Order, order | {"zoneSetId": "z"}).zone_set_id == "z"
    assert written(read(State, state | {"zoneSetId": "z"}))["zoneSetId"] == "z"


@pytest.mark.clause("7.10/message")
def test_factsheet_reads_the_names_of_2_x(factsheet: JsonObject) -> None:
    message = read(Factsheet, factsheet)

    assert message.type_specification.mobile_robot_kinematics == "DIFFERENTIAL"
    assert message.type_specification.navigation_types == ("FREELY_NAVIGATING",)
    assert message.protocol_limits.maximum_array_lengths.order_nodes == 50
    assert message.protocol_features.mobile_robot_actions[0].action_parameters[0].value_data_type == "NUMBER"
    assert written(message)["typeSpecification"]["agvKinematic"] == "DIFF"
    assert written(message)["protocolLimits"]["maxArrayLens"] == {"order.nodes": 50}


@pytest.mark.clause("7.10/message")
def test_blocking_types_are_read_and_not_written(factsheet: dict[str, Any]) -> None:
    action = factsheet["protocolFeatures"]["agvActions"][0]
    action["blockingTypes"] = ["NONE", "SOFT", "HARD"]

    message = read(Factsheet, factsheet)

    assert message.protocol_features.mobile_robot_actions[0].blocking_types == (
        BlockingType.NONE,
        BlockingType.SOFT,
        BlockingType.HARD,
    )
    assert "blockingTypes" not in written(message)["protocolFeatures"]["agvActions"][0]


@pytest.mark.clause("7.4")
def test_instant_actions_are_read_under_their_name_of_1_1(state: JsonObject) -> None:
    pause = {"actionType": "startPause", "actionId": "p", "blockingType": "NONE"}

    message = read(InstantActions, state | {"instantActions": [pause]})

    assert [each.action_id for each in message.actions] == ["p"]
    assert [each["actionId"] for each in written(message)["actions"]] == ["p"]
