"""Ready-made actions by settings alone: what they declare, what they do, and what cannot be made."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.actions.builtin import Wait
from nena_edge_agent.actions.plugin import ActionTimeouts
from nena_edge_agent.actions.registry import Installed
from nena_edge_agent.plugin_check import check_plugin
from nena_edge_agent.program import effective_operations
from nena_edge_agent.protocol.declaration import LoadChange
from nena_edge_agent.protocol.events import ActionReport
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.factsheet import ActionScope
from support.ready_made import ANSWER, CALL, CLAMP, COMMAND, LIFT, plugins_of, settings_of
from support.robot_core import action
from support.ros_port import ScriptedRos
from support.waiting import until


def test_ready_made_actions_declare_their_parameters() -> None:
    lift, clamp, plain = (
        each.declaration
        for each in plugins_of(
            {**LIFT, "load": "take", "timeout": 30.0, "description": "Lifts."},
            CLAMP,
            {**LIFT, "action_type": "plain", "command": COMMAND},
            ros=ScriptedRos(),
        )
    )

    assert [each.key for each in lift.parameters] == ["height", "loadId", "loadType"]
    assert lift.parameters[0].words == "at least 0 and at most 2"
    assert (lift.load, lift.timeout, lift.description) == (LoadChange.TAKE, 30.0, "Lifts.")
    assert (lift.pause_allowed, lift.cancel_allowed, lift.restartable) == (True, True, False)
    assert (clamp.pause_allowed, clamp.cancel_allowed) == (False, False)
    assert (plain.pause_allowed, plain.cancel_allowed) == (False, False)


def test_a_value_that_fits_no_message_is_refused_before_the_start() -> None:
    level = {"key": "level", "type": "INTEGER"}
    command = {"topic": "level", "type": "std_msgs/msg/UInt8", "fields": {"data": "{level}"}}
    (plugin,) = plugins_of(
        {"kind": "topic", "action_type": "go", "parameters": [level], "command": command}, ros=ScriptedRos()
    )

    problem = plugin.declaration.problem(action("a", "HARD", "go", level=300), ActionScope.NODE)

    assert problem == ("action 'go': operations.0.command.fields.data: 300 is not an integer from 0 to 255")
    assert plugin.declaration.problem(action("a", "HARD", "go", level=200), ActionScope.NODE) is None


@pytest.mark.parametrize(
    ("operation", "problem"),
    [
        (
            {**LIFT, "command": {**COMMAND, "type": "std_msgs/msg/Strin"}},
            "operations.0.command.type: type ",
        ),
        (
            {**LIFT, "answer": {**ANSWER, "match": {"dat": "x"}}},
            "operations.0.answer.match.dat: std_msgs/msg/String",
        ),
        (
            {**LIFT, "answer": {**ANSWER, "match": {"data": ["x", 1]}}},
            "operations.0.answer.match.data: 1 is not",
        ),
        ({**LIFT, "parameters": []}, "operations.0.command.fields.data: unknown parameter 'height'"),
        (
            {**CLAMP, "call": {**CALL, "fields": {"data": 1}}},
            "operations.0.call.fields.data: 1 is not true or",
        ),
        (
            {**CLAMP, "call": {**CALL, "expect": {"ok": True}}},
            "operations.0.call.expect.ok: std_srvs/srv/SetBool",
        ),
        (
            {**CLAMP, "call": {**CALL, "type": "std_srvs/msg/SetBool"}},
            "operations.0.call.type: 'std_srvs/msg/",
        ),
        (
            {"kind": "turn_signal", "type": "std_msgs/msg/UInt8", "values": {"left": "left", "off": 0}},
            "operations.0.command.fields.data: 'left' is not an integer",
        ),
    ],
)
def test_an_invalid_setting_is_one_error_with_its_location(operation: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        plugins_of(operation, ros=ScriptedRos())

    assert raised.value.problems[0].startswith(problem)


KEPT = [
    (LIFT, {"height": 1.0}),
    ({**LIFT, "action_type": "fetch", "load": "take"}, {"height": 1.0}),
    (CLAMP, {}),
    ({"kind": "charge", "action_type": "charge"}, {}),
    ({"kind": "signal", "action_type": "signal", "answer": ANSWER}, {}),
    ({"kind": "turn_signal", "scopes": ["NODE"]}, {}),
    ({"kind": "turn_signal", "action_type": "edgeSignal"}, {}),
    ({"kind": "dock", "action_type": "dock"}, {}),
    ({"action_type": "timed", "seconds": 0.3}, {}),
]


@pytest.mark.parametrize(("operation", "parameters"), KEPT, ids=lambda each: str(each.get("kind", "")))
async def test_each_ready_made_action_meets_the_contract(
    operation: dict[str, Any], parameters: dict[str, Any]
) -> None:
    ros = ScriptedRos()
    ros.services["clamp"] = {"success": True, "message": ""}
    (plugin,) = plugins_of(operation, ros=ros)

    await check_plugin(plugin, parameters, seconds=0.5, timeouts=ActionTimeouts(begin=10.0, obey=10.0))


async def test_wait_meets_the_contract() -> None:
    timeouts = ActionTimeouts(begin=10.0, obey=10.0)

    await check_plugin(Wait(), {"duration": 0.3}, seconds=30.0, timeouts=timeouts)


def test_without_ros_actions_that_need_it_are_refused_and_not_offered() -> None:
    (plugin,) = plugins_of(LIFT, ros=None)

    problem = plugin.declaration.problem(action("a", "HARD", "lift", height=1), ActionScope.NODE)
    assert "action 'lift' is not possible: it needs ROS" in str(problem)


async def test_without_ros_actions_are_simulated_if_configured() -> None:
    (plugin,) = plugins_of(LIFT, ros=None, without_ros="rehearse", rehearsal_seconds=0.01)
    reports: list[ActionReport] = []
    plugin.start(action("a", "HARD", "lift", height=1), (), reports.append)
    await until(lambda: reports[-1].status.ended)

    assert reports[-1].result == "simulated"
    assert [each.key for each in plugin.declaration.parameters] == ["height"]


def test_plug_ins_replace_default_operations_only() -> None:
    (pick,) = plugins_of({"action_type": "pick"}, ros=None)
    found = Installed((pick,))

    assert "pick" not in [each.action_type for each in effective_operations(found, EdgeAgentSettings())]
    assert len(effective_operations(found, settings_of({"action_type": "pick"}))) == 1
