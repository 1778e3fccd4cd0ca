"""Ready-made actions by settings alone: what they declare, what they do, and what cannot be made."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from nena_edge_agent.actions.check_plugin import findings_of
from nena_edge_agent.actions.contract import Verdict
from nena_edge_agent.actions.dry_ports import DryDrive
from nena_edge_agent.actions.installed import Installed
from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext
from nena_edge_agent.actions.ready_made import operations_beside, ready_made
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.run import Patience
from nena_edge_agent.actions.runner import ActionRunner
from nena_edge_agent.actions.trial import Subject
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.protocol.declaration import LoadChange
from nena_edge_agent.protocol.effects import CancelAction, PauseAction, ResumeAction, StartAction
from nena_edge_agent.protocol.events import ActionReport
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import action
from support.ros_port import ScriptedRos
from support.waiting import until

STRING = "std_msgs/msg/String"
COMMAND = {"topic": "lift/command", "type": STRING, "fields": {"data": "raise {height}"}}
STEERED = {
    **COMMAND,
    "on_pause": {"data": "hold"},
    "on_resume": {"data": "go on"},
    "on_cancel": {"data": "stop {actionId}"},
}
ANSWER = {"topic": "lift/result", "type": STRING, "match": {"data": "done"}, "failed": {"data": "jammed"}}
HEIGHT = {"key": "height", "type": "NUMBER", "minimum": 0, "maximum": 2}
LIFT: dict[str, Any] = {
    "kind": "topic",
    "action_type": "lift",
    "parameters": [HEIGHT],
    "command": STEERED,
    "answer": {**ANSWER, "result": "data"},
}
CALL = {"service": "clamp", "type": "std_srvs/srv/SetBool", "fields": {"data": True}}
CLAMP: dict[str, Any] = {"kind": "service", "action_type": "clamp", "call": CALL}


def settings_of(*operations: dict[str, Any], **actions: Any) -> EdgeAgentSettings:
    return EdgeAgentSettings.model_validate({"operations": operations, "actions": actions})


def plugins_of(*operations: dict[str, Any], ros: ScriptedRos | None, **actions: Any) -> list[ActionPlugin]:
    settings = settings_of(*operations, **actions)
    context = PluginContext(RobotKey("ACME", "0001"), DryDrive(), ros)
    return list(ready_made(settings.operations, context, settings.actions))


class Robot:
    """The ready-made actions of one robot, with the ROS side in the test's hands."""

    def __init__(self, *operations: dict[str, Any], **actions: Any) -> None:
        self.ros = ScriptedRos()
        self.registry = ActionRegistry(plugins_of(*operations, ros=self.ros, **actions))
        self.reports: list[ActionReport] = []
        self.runner = ActionRunner(self.registry, self.reports.append)

    async def begin(self, action_type: str, **parameters: Any) -> None:
        self.runner.start(StartAction(action("a", "HARD", action_type, **parameters), ()))
        await asyncio.sleep(0)

    async def until_published(self, *texts: str) -> None:
        await until(lambda: [each["data"] for _, each in self.ros.published] == list(texts), timeout=30)

    async def end(self) -> tuple[str, str | None]:
        last = await until(
            lambda: next((each for each in self.reports if each.status.ended), None), timeout=30
        )
        return last.status.value, last.result


async def test_a_command_is_sent_and_its_answer_ends_the_action() -> None:
    robot = Robot(LIFT)
    await robot.begin("lift", height=1.5)
    await robot.until_published("raise 1.5")
    robot.ros.say("lift/result", data="busy")
    robot.ros.say("lift/result", data="done")

    assert await robot.end() == ("FINISHED", "done")


async def test_an_answer_that_says_so_fails_the_action() -> None:
    robot = Robot(LIFT)
    robot.ros.replies["lift/command"] = lambda _: robot.ros.say("lift/result", data="jammed")
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "jammed")


async def test_it_is_held_and_given_up_by_messages() -> None:
    robot = Robot(LIFT)
    await robot.begin("lift", height=1)
    await robot.until_published("raise 1")
    robot.runner.pause(PauseAction("a"))
    robot.runner.resume(ResumeAction("a"))
    robot.runner.cancel(CancelAction("a"))

    assert await robot.end() == ("FAILED", "cancelled")
    await robot.until_published("raise 1", "hold", "go on", "stop a")
    assert ActionStatus.PAUSED in [each.status for each in robot.reports]


async def test_what_was_not_sent_before_a_pause_is_sent_behind_it() -> None:
    robot = Robot(LIFT)
    robot.ros.listeners = 0
    await robot.begin("lift", height=1)
    robot.runner.pause(PauseAction("a"))
    robot.ros.listeners = 1
    robot.runner.resume(ResumeAction("a"))
    robot.runner.pause(PauseAction("a"))
    robot.runner.resume(ResumeAction("a"))

    await robot.until_published("raise 1")


async def test_one_that_takes_too_long_is_told_to_stop() -> None:
    robot = Robot({**LIFT, "timeout": 0.05})
    await robot.begin("lift", height=1)

    status, result = await robot.end()
    assert status == "FAILED"
    assert "took longer than 0.05 s; the last that it told: waits for lift/result" in str(result)
    await robot.until_published("raise 1", "stop a")


async def test_a_command_to_which_nobody_listens_fails() -> None:
    robot = Robot({**LIFT, "command": {**STEERED, "listener_timeout": 0.1}})
    robot.ros.listeners = 0
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "nobody listens to lift/command")
    assert robot.ros.published == []


async def test_without_a_session_it_fails_with_the_reason() -> None:
    robot = Robot(LIFT)
    robot.ros.active = False
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "the robot's ROS session is not active")


@pytest.mark.parametrize(
    ("call", "response", "end"),
    [
        ({}, {"success": True, "message": "closed"}, ("FINISHED", "closed")),
        ({}, {"success": False, "message": "jammed"}, ("FAILED", "jammed")),
        ({}, {"success": False, "message": ""}, ("FAILED", "clamp says that it has failed")),
        ({"expect": {"message": ["a", "b"]}}, {"success": False, "message": "b"}, ("FINISHED", "b")),
        ({"result": "success"}, {"success": True, "message": ""}, ("FINISHED", "True")),
    ],
)
async def test_a_service_is_called_and_its_response_judged(
    call: dict[str, Any], response: dict[str, Any], end: tuple[str, str]
) -> None:
    robot = Robot({**CLAMP, "call": {**CALL, **call}})
    robot.ros.services["clamp"] = response
    await robot.begin("clamp")

    assert await robot.end() == end
    assert robot.ros.called == [("clamp", {"data": True})]


async def test_charging_begins_when_the_battery_says_so() -> None:
    robot = Robot({"kind": "charge", "call": {"service": "connect", "type": "std_srvs/srv/Trigger"}})
    robot.ros.services["connect"] = {"success": True, "message": "connected"}
    await robot.begin("startCharging")
    await until(lambda: robot.ros.called, timeout=30)
    robot.ros.say("battery_state", power_supply_status=2)
    assert not [each for each in robot.reports if each.status.ended]
    robot.ros.say("battery_state", power_supply_status=1)

    assert (await robot.end())[0] == "FINISHED"
    assert robot.reports[-1].charging is True


async def test_a_signal_is_waited_for_also_one_that_came_before_where_it_is_latched() -> None:
    door = {"topic": "door", "type": "std_msgs/msg/Bool", "match": {"data": True}}
    waits = {"kind": "signal", "action_type": "waitForDoor", "answer": door}
    latched = {**waits, "action_type": "seeDoor", "answer": {**door, "qos": "latched"}}
    robot = Robot(waits, latched)
    robot.ros.say("door", data=True)

    await robot.begin("seeDoor")
    assert await robot.end() == ("FINISHED", None)

    robot.reports.clear()
    await robot.begin("waitForDoor")
    assert not [each for each in robot.reports if each.status.ended]
    robot.ros.say("door", data=True)
    assert await robot.end() == ("FINISHED", None)


async def test_a_turn_signal_of_an_edge_goes_out_with_it_and_another_stays() -> None:
    robot = Robot(
        {"kind": "turn_signal"},
        {"kind": "turn_signal", "action_type": "blink", "scopes": ["NODE"], "topic": "lamp"},
    )
    assert robot.registry.declarations["setTurnSignal"].open_ended
    await robot.begin("setTurnSignal", direction="left")
    await robot.until_published("left")
    robot.runner.cancel(CancelAction("a"))
    await robot.until_published("left", "off")

    robot.reports.clear()
    await robot.begin("blink", direction="right")
    assert await robot.end() == ("FINISHED", None)
    assert robot.ros.published[-1] == ("lamp", {"data": "right"})


def test_they_declare_what_they_are_set_to() -> None:
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


def test_a_value_that_no_message_can_hold_is_refused_beforehand() -> None:
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
            "operations.0.command.type: there is no",
        ),
        (
            {**LIFT, "answer": {**ANSWER, "match": {"dat": "x"}}},
            "operations.0.answer.match.dat: std_msgs/msg/String",
        ),
        (
            {**LIFT, "answer": {**ANSWER, "match": {"data": ["x", 1]}}},
            "operations.0.answer.match.data: 1 is not",
        ),
        ({**LIFT, "parameters": []}, "operations.0.command.fields.data: there is no parameter 'height'"),
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
def test_what_cannot_work_is_one_error_with_its_place(operation: dict[str, Any], problem: str) -> None:
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
def test_each_of_them_keeps_the_contract(operation: dict[str, Any], parameters: dict[str, Any]) -> None:
    ros = ScriptedRos()
    ros.services["clamp"] = {"success": True, "message": ""}
    (plugin,) = plugins_of(operation, ros=ros)

    findings = findings_of(Subject(plugin, parameters, Patience(begin=10.0, obey=10.0), 0.5))

    assert [each for each in findings if each.verdict is Verdict.BROKEN] == []
    assert len([each for each in findings if each.verdict is Verdict.OK]) >= 6


def test_wait_keeps_the_contract() -> None:
    findings = findings_of(Subject(Wait(), {"duration": 0.3}, Patience(begin=10.0, obey=10.0), 30.0))

    assert {each.verdict for each in findings} == {Verdict.OK}


def test_without_ros_they_are_refused_with_the_reason_and_not_offered() -> None:
    (plugin,) = plugins_of(LIFT, ros=None)

    problem = plugin.declaration.problem(action("a", "HARD", "lift", height=1), ActionScope.NODE)
    assert "action 'lift' is not possible: it uses ROS" in str(problem)


async def test_without_ros_they_are_rehearsed_where_it_is_set_so() -> None:
    (plugin,) = plugins_of(LIFT, ros=None, without_ros="rehearse", rehearsal_seconds=0.01)
    reports: list[ActionReport] = []
    plugin.start(action("a", "HARD", "lift", height=1), (), reports.append)
    await until(lambda: reports[-1].status.ended, timeout=30)

    assert reports[-1].result == "rehearsed"
    assert [each.key for each in plugin.declaration.parameters] == ["height"]


def test_plug_ins_take_the_place_of_default_operations_only() -> None:
    (pick,) = plugins_of({"action_type": "pick"}, ros=None)
    found = Installed((pick,))

    assert "pick" not in [each.action_type for each in operations_beside(found, EdgeAgentSettings())]
    assert len(operations_beside(found, settings_of({"action_type": "pick"}))) == 1
