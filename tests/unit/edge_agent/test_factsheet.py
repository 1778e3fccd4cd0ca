"""The factsheet agrees with the configured actions, and the order service understands it."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.actions.builtin import TimedOperation, Wait
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.factsheet import braking_distance, make_capabilities, make_factsheet
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.nav2.offers import Nav2Offers
from nena_edge_agent.program import make_registry
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.instant_actions import MESSAGE_LIMIT
from nena_edge_agent.protocol.zone_sets import MAXIMUM_ZONES
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import DescriptionSettings, EdgeAgentSettings
from nena_order_service.fleet.feasibility import fitted_action, instant_action_problem
from nena_order_service.fleet.robot import Abilities
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MobileRobotAction, ValueDataType
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.versions import CODECS, RULES
from support.edge_agent import SETTINGS, make_robot
from support.robot_core import HEADER, action
from support.ros_port import ScriptedRos
from support.schemas import schema_problems


def factsheet(*operations: OperationSettings, **changes: object) -> Factsheet:
    settings = SETTINGS.model_validate({"operations": operations, **changes})
    registry = ActionRegistry([*(TimedOperation(each) for each in operations), Wait()])
    return make_factsheet(HEADER, settings, make_capabilities(settings, registry))


@pytest.mark.clause("6.10", "6.2.3")
def test_it_lists_exactly_the_robots_actions() -> None:
    lift = OperationSettings(
        action_type="lift",
        load="take",
        scopes=(ActionScope.NODE,),
        blocking_types=(BlockingType.HARD,),
        interruptible=False,
    )

    actions = {each.action_type: each for each in factsheet(lift).protocol_features.mobile_robot_actions}

    assert set(actions) == {
        "cancelOrder",
        "startPause",
        "stopPause",
        "stateRequest",
        "factsheetRequest",
        "initializePosition",
        "wait",
        "waitForTrigger",
        "lift",
    }
    assert actions["lift"].action_scopes == (ActionScope.NODE,)
    assert actions["lift"].blocking_types == (BlockingType.HARD,)
    assert not actions["lift"].cancel_allowed
    (duration,) = actions["wait"].action_parameters or ()
    assert (duration.key, duration.is_optional) == ("duration", False)


@pytest.mark.clause("6.10")
def test_it_follows_the_settings() -> None:
    sheet = factsheet(
        interval={"state_minimum": 0.5, "state_maximum": 10.0, "visualization": 0},
        description={"series_name": "Mule", "length": 1.0, "width": 0.5},
    )

    assert sheet.type_specification.series_name == "Mule"
    assert sheet.protocol_limits.timing.minimum_state_interval == 0.5
    assert sheet.protocol_limits.timing.visualization_interval is None
    assert sheet.protocol_limits.maximum_array_lengths.order_edges == 999
    (footprint,) = sheet.mobile_robot_geometry.envelopes2d or ()
    assert max(point.x for point in footprint.vertices) == 0.5
    assert sheet.load_specification.load_positions == ()


@pytest.mark.clause("6.10/parameters", "7.3/speed")
def test_speed_limits_are_offered_only_if_the_driver_supports_them() -> None:
    offered = {
        driver: {each.parameter for each in factsheet(driver=driver).protocol_features.optional_parameters}
        for driver in ("loopback", "nav2")
    }

    assert offered["loopback"] - offered["nav2"] == {"order.edges.maximumSpeed"}
    assert "order.nodes.nodePosition.theta" in offered["nav2"]


@pytest.mark.clause("7.10/message")
def test_it_fits_the_official_schema() -> None:
    payload = CODEC.encode(factsheet(OperationSettings(action_type="pick", load="take")))

    assert not schema_problems("2.1.0", "factsheet", payload)
    assert json.loads(payload)["protocolFeatures"]["agvActions"]


@pytest.mark.clause("6.2.3/pick", "6.10")
@pytest.mark.parametrize(
    ("version", "key"), [("2.1.0", "lhd"), ("3.0.0", "lhd"), ("3.0.1", "loadHandlingDevice")]
)
def test_the_load_handling_device_has_the_key_of_the_version(version: str, key: str) -> None:
    pick = OperationSettings.model_validate(
        {"action_type": "pick", "parameters": [{"key": "lhd", "type": "STRING"}, {"key": "side"}]}
    )
    actions = factsheet(pick, version=version).protocol_features.mobile_robot_actions
    (listed,) = (each.action_parameters or () for each in actions if each.action_type == "pick")
    assert [each.key for each in listed] == [key, "side"]


@pytest.mark.clause("6.10/zones")
@pytest.mark.parametrize(
    ("version", "driver", "zones"),
    [
        ("2.1.0", "loopback", ()),
        ("3.0.0", "loopback", ("BLOCKED", "LINE_GUIDED", "RELEASE", "SPEED_LIMIT")),
        ("3.0.0", "nav2", ("BLOCKED", "LINE_GUIDED", "RELEASE")),
    ],
)
def test_it_lists_the_supported_zones(version: str, driver: str, zones: tuple[str, ...]) -> None:
    assert factsheet(version=version, driver=driver).type_specification.supported_zones == zones


@pytest.mark.clause("7.1.2", "7.1.2/size", "6.2.1/limits")
def test_it_lists_the_limits_that_are_enforced() -> None:
    limits = factsheet().protocol_limits

    assert limits.maximum_string_lengths.maximum_message_length == MAXIMUM_PAYLOAD
    assert limits.maximum_array_lengths.order_nodes == Capabilities(map_id="hall").maximum_nodes
    assert limits.maximum_array_lengths.instant_actions == MESSAGE_LIMIT
    assert limits.maximum_array_lengths.zone_set_zones == MAXIMUM_ZONES


LIFT: dict[str, Any] = {
    "kind": "topic",
    "action_type": "lift",
    "description": "Lifts the table.",
    "scopes": ["NODE", "INSTANT"],
    "blocking_types": ["HARD"],
    "load": "take",
    "parameters": [
        {"key": "height", "type": "NUMBER", "minimum": 0, "maximum": 2, "description": "m"},
        {"key": "gently", "type": "BOOL", "required": False},
    ],
    "command": {
        "topic": "lift",
        "type": "std_msgs/msg/Float64",
        "fields": {"data": "{height}"},
        "on_cancel": {"data": 0},
    },
}
SIGNAL = {"kind": "turn_signal"}


def robot(
    *operations: dict[str, Any], ros: bool = True, version: str = "2.1.0", **actions: Any
) -> tuple[EdgeAgentSettings, Capabilities]:
    settings = SETTINGS.model_validate(
        {
            "operations": operations,
            "version": version,
            "driver": "nav2" if ros else "loopback",
            "actions": actions,
        }
    )
    registry = make_registry(
        settings, SimulationControl(RobotLink().cut), make_robot(ros=ScriptedRos() if ros else None)
    )
    return settings, make_capabilities(settings, registry)


def factsheet_with(*operations: dict[str, Any], **more: Any) -> Factsheet:
    settings, capabilities = robot(*operations, **more)
    return make_factsheet(HEADER | {"version": settings.version}, settings, capabilities)


def listed(sheet: Factsheet) -> dict[str, MobileRobotAction]:
    return {each.action_type: each for each in sheet.protocol_features.mobile_robot_actions}


@pytest.mark.clause("6.10", "6.2.3")
def test_the_factsheet_lists_the_configured_operations() -> None:
    actions = listed(factsheet_with(LIFT, SIGNAL))

    lift = actions["lift"]
    assert lift.action_description == "Lifts the table."
    assert lift.action_scopes == (ActionScope.NODE, ActionScope.INSTANT)
    assert lift.blocking_types == (BlockingType.HARD,)
    assert (lift.pause_allowed, lift.cancel_allowed) == (False, True)
    described = {each.key: each for each in lift.action_parameters or ()}
    assert list(described) == ["height", "gently", "loadId", "loadType"]
    assert described["height"].value_data_type is ValueDataType.NUMBER
    assert described["height"].description == "m, at least 0 and at most 2"
    assert [each.is_optional for each in described.values()] == [False, True, True, True]
    (direction,) = actions["setTurnSignal"].action_parameters or ()
    assert direction.description == "what the signal shows, one of left, right, off"


@pytest.mark.clause("6.10")
def test_a_robot_that_picks_up_loads_has_a_load_position() -> None:
    assert factsheet_with(LIFT).load_specification.load_positions
    assert not factsheet_with(SIGNAL).load_specification.load_positions


@pytest.mark.clause("6.10")
def test_actions_refused_without_ros_are_not_offered() -> None:
    assert "lift" not in listed(factsheet_with(LIFT, ros=False))
    assert "lift" in listed(factsheet_with(LIFT, ros=False, without_ros="rehearse"))


@pytest.mark.clause("7.10/message")
@pytest.mark.parametrize("version", list(CODECS))
def test_it_fits_the_official_schema_of_each_version(version: str) -> None:
    payload = CODECS[version].encode(factsheet_with(LIFT, SIGNAL, version=version))

    assert not schema_problems(version, "factsheet", payload)


@pytest.mark.clause("6.10")
@pytest.mark.parametrize("version", list(CODECS))
@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        ({"height": 1.5}, None),
        ({"height": "1.5"}, None),
        ({"height": "1.5", "gently": "true", "stationName": "A"}, None),
        ({}, "requires the parameter 'height'"),
        ({"height": "high"}, "must be NUMBER"),
        ({"height": 1, "speed": 2}, "has no parameter 'speed'"),
    ],
)
def test_the_order_service_accepts_what_the_robot_accepts(
    version: str, parameters: dict[str, Any], problem: str | None
) -> None:
    """The robot accepts what the order service sends by the factsheet, and would refuse what it refuses."""
    codec = CODECS[version]
    settings, capabilities = robot(LIFT, version=version)
    sheet = make_factsheet(HEADER | {"version": version}, settings, capabilities)
    abilities = Abilities(codec.decode(Factsheet, codec.encode(sheet)))

    sent = fitted_action(action("a", "NONE", "lift", **parameters), abilities)
    refused = instant_action_problem(sent, abilities)

    if problem is None:
        assert refused is None
        assert capabilities.actions["lift"].problem(sent, ActionScope.INSTANT) is None
    else:
        assert problem in str(refused)


SPEEDS = st.floats(0.0, 5.0)


def capabilities(**changes: object) -> Capabilities:
    return make_capabilities(SETTINGS.model_validate(changes), ActionRegistry([Wait()]))


@given(SPEEDS, st.floats(0.1, 5.0))
def test_the_braking_distance_grows_with_speed_and_shrinks_with_deceleration(
    speed: float, brakes: float
) -> None:
    here = braking_distance(DescriptionSettings(maximum_speed=speed, maximum_deceleration=brakes))
    better = braking_distance(DescriptionSettings(maximum_speed=speed, maximum_deceleration=2 * brakes))
    faster = braking_distance(DescriptionSettings(maximum_speed=speed + 0.5, maximum_deceleration=brakes))

    assert speed * 0.5 <= better <= here < faster


def test_a_robot_without_a_deceleration_has_only_its_reaction_distance() -> None:
    assert braking_distance(DescriptionSettings(maximum_speed=2.0, maximum_deceleration=0.0)) == 1.0


def test_a_robot_stops_within_its_braking_distance() -> None:
    assert braking_distance(DescriptionSettings(maximum_speed=2.0, maximum_deceleration=1.0)) == 3.0


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_it_follows_the_rules_of_its_version(version: str) -> None:
    assert capabilities(version=version).rules is RULES[version]


@pytest.mark.parametrize(("driver", "limits"), [("loopback", True), ("nav2", False)])
def test_a_nav2_robot_accepts_no_speed_limits_without_the_types(driver: str, *, limits: bool) -> None:
    assert capabilities(driver=driver).limits_speed is limits


@pytest.mark.clause("7.3/speed")
def test_speed_limits_are_listed_if_nav2_accepts_them() -> None:
    settings = EdgeAgentSettings()
    known = make_capabilities(settings, ActionRegistry([Wait()]), Nav2Offers(limits_speed=True))
    sheet = make_factsheet(HEADER, settings, known)
    listed = {each.parameter for each in sheet.protocol_features.optional_parameters}
    assert "order.edges.maximumSpeed" in listed


@pytest.mark.clause("7.10/message", "6.1.5")
@pytest.mark.parametrize("follows", [True, False])
def test_trajectories_and_corridors_are_listed_if_the_robot_follows_them(*, follows: bool) -> None:
    settings = EdgeAgentSettings()
    known = make_capabilities(settings, ActionRegistry([Wait()]), Nav2Offers(follows_paths=follows))
    sheet = make_factsheet(HEADER, settings, known)
    listed = {each.parameter for each in sheet.protocol_features.optional_parameters}
    paths = {"order.edges.trajectory", "order.edges.corridor", "order.edges.corridor.corridorReferencePoint"}
    assert (paths <= listed, bool(paths & listed)) == (follows, follows)
    assert ("VIRTUAL_LINE_GUIDED" in sheet.type_specification.navigation_types) is follows


def test_it_has_its_own_actions_in_addition_to_the_standard_ones() -> None:
    types = set(capabilities().actions)
    assert {"wait", "cancelOrder", "startPause"} <= types
