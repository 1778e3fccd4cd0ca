"""The factsheet is true to the actions that are set, and the order service understands what it says."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.__main__ import make_registry
from nena_edge_agent.actions.dry_ports import DryDrive
from nena_edge_agent.actions.plugin import PluginContext
from nena_edge_agent.factsheet import make_factsheet
from nena_edge_agent.loopback.bench import Bench
from nena_edge_agent.own_capabilities import make_capabilities
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.settings import EdgeAgentSettings
from nena_order_service.fleet.feasibility import fitted_action, instant_action_problem
from nena_order_service.fleet.robot import Abilities
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MobileRobotAction, ValueDataType
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import CODECS
from support.robot_core import HEADER, action
from support.ros_port import ScriptedRos
from support.schemas import schema_problems

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
    settings = EdgeAgentSettings.model_validate(
        {
            "operations": operations,
            "version": version,
            "driver": "nav2" if ros else "loopback",
            "actions": actions,
        }
    )
    context = PluginContext(RobotKey("ACME", "0001"), DryDrive(), ScriptedRos() if ros else None)
    registry = make_registry(settings, Bench(), context=context)
    return settings, make_capabilities(settings, registry)


def factsheet(*operations: dict[str, Any], **more: Any) -> Factsheet:
    settings, capabilities = robot(*operations, **more)
    return make_factsheet(HEADER | {"version": settings.version}, settings, capabilities)


def listed(sheet: Factsheet) -> dict[str, MobileRobotAction]:
    return {each.action_type: each for each in sheet.protocol_features.mobile_robot_actions}


@pytest.mark.clause("6.10", "6.2.3")
def test_what_is_set_is_what_it_tells() -> None:
    actions = listed(factsheet(LIFT, SIGNAL))

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
def test_a_robot_that_takes_loads_has_a_place_for_them() -> None:
    assert factsheet(LIFT).load_specification.load_positions
    assert not factsheet(SIGNAL).load_specification.load_positions


@pytest.mark.clause("6.10")
def test_what_a_robot_without_ros_refuses_is_not_offered() -> None:
    assert "lift" not in listed(factsheet(LIFT, ros=False))
    assert "lift" in listed(factsheet(LIFT, ros=False, without_ros="rehearse"))


@pytest.mark.clause("7.10/message")
@pytest.mark.parametrize("version", list(CODECS))
def test_it_fits_the_official_schema_of_each_version(version: str) -> None:
    payload = CODECS[version].encode(factsheet(LIFT, SIGNAL, version=version))

    assert not schema_problems(version, "factsheet", payload)


@pytest.mark.clause("6.10")
@pytest.mark.parametrize("version", list(CODECS))
@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        ({"height": 1.5}, None),
        ({"height": "1.5"}, None),
        ({"height": "1.5", "gently": "true", "stationName": "A"}, None),
        ({}, "needs the parameter 'height'"),
        ({"height": "high"}, "must be NUMBER"),
        ({"height": 1, "speed": 2}, "has no parameter 'speed'"),
    ],
)
def test_both_sides_agree_about_an_action(
    version: str, parameters: dict[str, Any], problem: str | None
) -> None:
    """What the order service sends by the factsheet the robot takes; what it refuses the robot would too."""
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
