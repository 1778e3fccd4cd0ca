"""Commands, calls and answers of ready-made actions, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from nena_edge_agent.actions.messages import FieldError, message_type, service_type
from nena_edge_agent.actions.plugin import RosError, WorkFailedError
from nena_edge_agent.actions.ros_operations import ActionValues, Answer, Call, Command, MessageTemplate, Steps
from nena_edge_agent.actions.settings import (
    AnswerSettings,
    CallSettings,
    CommandSettings,
    FieldValues,
    OperationBase,
    ParameterSettings,
)
from nena_edge_agent.protocol.events import CancelAction, PauseAction, ResumeAction
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ValueDataType
from support.ready_made import CALL, CLAMP, LIFT, STEERED, Robot
from support.robot_core import action
from support.ros_port import ScriptedRos
from support.waiting import until

SIDE = {"key": "side", "values": {"left": 1, "right": 2}}
LEVEL = {"key": "level", "type": "INTEGER", "required": False}
UINT8 = message_type("std_msgs/msg/UInt8")
STRING = message_type("std_msgs/msg/String")


def values_of(*parameters: Mapping[str, object], load: str = "") -> ActionValues:
    base = {"action_type": "x", "parameters": parameters, "load": load}
    return ActionValues(OperationBase.model_validate(base))


def test_placeholders_are_filled_from_the_actions_parameters_and_id() -> None:
    values = values_of(SIDE, LEVEL).values_of(action("a1", "HARD", "x", side="right"))

    assert values == {"actionId": "a1", "side": 2, "level": None}


def test_a_pick_may_name_its_load_but_not_twice() -> None:
    own = {"key": "loadId", "required": True}

    assert [each.key for each in values_of(load="take").declared] == ["loadId", "loadType"]
    assert [(each.key, each.required) for each in values_of(own, load="take").declared] == [
        ("loadId", True),
        ("loadType", False),
    ]
    assert values_of(load="give").declared == ()


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"data": "{sid}"}, "p.data: unknown parameter 'sid'"),
        ({"date": 1}, "p.date: std_msgs/msg/UInt8 has no such field"),
        ({"data": 300}, "p.data: 300 is not an integer from 0 to 255"),
    ],
)
def test_fields_that_form_no_message_are_refused_with_their_location(
    fields: FieldValues, problem: str
) -> None:
    with pytest.raises(ConfigurationError) as raised:
        MessageTemplate(fields, UINT8, values_of(SIDE), "p")

    assert raised.value.problems[0].startswith(problem)


def test_each_value_of_a_choice_is_checked() -> None:
    wrong = {"key": "side", "values": {"left": 1, "right": 256}}

    MessageTemplate({"data": "{side}"}, UINT8, values_of(SIDE), "p")
    with pytest.raises(ConfigurationError, match="256 is not an integer"):
        MessageTemplate({"data": "{side}"}, UINT8, values_of(wrong), "p")


def test_an_array_lists_alternatives_where_configured() -> None:
    names: FieldValues = {"data": ["done {actionId}", "ok"]}

    template = MessageTemplate(names, STRING, values_of(), "p", any_of=True)
    assert template.fill({"actionId": "a1"}) == {"data": ["done a1", "ok"]}
    with pytest.raises(ConfigurationError, match=r"is not a string"):
        MessageTemplate(names, STRING, values_of(), "p")


def test_a_value_that_does_not_fit_its_field_is_refused_when_filled_in() -> None:
    template = MessageTemplate({"data": "{level}"}, UINT8, values_of(LEVEL), "p")

    assert template.fill({"level": 200}) == {"data": 200}
    assert template.fill({"level": None}) == {}
    with pytest.raises(FieldError, match=r"p\.data: 300 is not"):
        template.fill({"level": 300})


TYPE = "std_msgs/msg/String"
NOTHING = ActionValues(OperationBase(action_type="go"))


def listening(**settings: object) -> tuple[ScriptedRos, Answer]:
    ros = ScriptedRos()
    full = {"topic": "said", "type": TYPE, "match": {"data": "done {actionId}"}, "result": "data", **settings}
    return ros, Answer(AnswerSettings.model_validate(full), ros, message_type(TYPE), NOTHING, "p")


async def test_each_waiting_action_gets_its_own_response() -> None:
    ros, answer = listening()
    one = answer.expect_answer({"actionId": "a1"}, print)
    other = answer.expect_answer({"actionId": "a2"}, print)
    ros.say("said", data="done a2")

    assert await other == "done a2"
    assert not one.done()
    one.cancel()
    await until(lambda: answer._waiting == {})
    ros.say("said", data="done a1")


async def test_failure_and_progress_are_distinguished() -> None:
    ros, answer = listening(failed={"data": ["jam", "no power"]}, progress={"data": "half"})
    wait_for_subscriber: list[str] = []
    waiting = answer.expect_answer({"actionId": "a1"}, wait_for_subscriber.append)
    for text in ("other", "half", "no power", "done a1"):
        ros.say("said", data=text)

    assert wait_for_subscriber == ["half"]
    with pytest.raises(WorkFailedError, match="no power"):
        await waiting


async def test_without_a_result_field_it_reports_a_default_text() -> None:
    ros, answer = listening(result="", failed={"data": "jam"})
    assert answer.words == "waits for said"
    waiting = answer.expect_answer({"actionId": "a1"}, print)
    ros.say("said", data="jam")

    with pytest.raises(WorkFailedError, match="said reported failure"):
        await waiting


async def test_earlier_messages_count_only_if_latched() -> None:
    for qos, seen in (("reliable", False), ("latched", True)):
        ros, answer = listening(qos=qos)
        ros.say("said", data="done a1")
        waiting = answer.expect_answer({"actionId": "a1"}, print)
        assert waiting.done() is seen
        waiting.cancel()


def call(ros: ScriptedRos, type_name: str, **settings: object) -> Call:
    chosen = CallSettings.model_validate({"service": "x", "type": type_name, **settings})
    return Call(chosen, ros.client("x", type_name), service_type(type_name), NOTHING, "p")


async def test_a_service_without_a_result_field_has_succeeded() -> None:
    ros = ScriptedRos()
    ros.services["x"] = {}

    assert await call(ros, "std_srvs/srv/Empty").call_service({}) is None


async def test_expected_values_may_contain_parameters_of_the_action() -> None:
    ros = ScriptedRos()
    ros.services["x"] = {"success": False, "message": "a1 done"}
    named = call(ros, "std_srvs/srv/Trigger", expect={"message": "{actionId} done"}, result="")

    assert await named.call_service({"actionId": "a1"}) is None
    with pytest.raises(WorkFailedError, match="x reported failure"):
        await named.call_service({"actionId": "a2"})


async def test_a_missing_service_is_reported_by_ros() -> None:
    with pytest.raises(RosError, match="no node offers"):
        await call(ScriptedRos(), "std_srvs/srv/Trigger").call_service({})


TYPE_of_command = "std_msgs/msg/UInt8"
LEVEL_of_command = ParameterSettings(key="level", type=ValueDataType.INTEGER)


def command(ros: ScriptedRos, **settings: object) -> Command:
    full = {"topic": "level", "type": TYPE_of_command, "fields": {"data": "{level}"}, **settings}
    values = ActionValues(OperationBase(action_type="go", parameters=(LEVEL_of_command,)))
    chosen = CommandSettings.model_validate(full)
    return Command(
        chosen, ros.publisher("level", TYPE_of_command), message_type(TYPE_of_command), values, "p"
    )


def test_each_step_sends_its_configured_message() -> None:
    ros = ScriptedRos()
    steered = command(ros, on_pause={"data": 0}, on_resume={"data": "{level}"})
    for step in (steered.begin, steered.pause, steered.resume, steered.cancel):
        steered.publish(step, {"level": 7})

    assert [each["data"] for _, each in ros.published] == [7, 0, 7]


def test_an_invalid_value_is_found_before_the_start() -> None:
    problem = Steps(command(ScriptedRos())).problem({"level": 300})
    assert problem is not None
    assert "p.fields.data: 300" in problem


async def test_a_subscriber_is_required_unless_configured_otherwise() -> None:
    ros = ScriptedRos()
    ros.listeners = 0
    with pytest.raises(WorkFailedError, match="no node subscribes to level"):
        await command(ros, listener_timeout=0.1).wait_for_subscriber()
    await command(ros, listener_timeout=0).wait_for_subscriber()
    ros.listeners = 1
    await command(ros).wait_for_subscriber()


async def test_a_command_is_sent_and_its_answer_ends_the_action() -> None:
    robot = Robot(LIFT)
    await robot.begin("lift", height=1.5)
    await robot.until_published("raise 1.5")
    robot.ros.say("lift/result", data="busy")
    robot.ros.say("lift/result", data="done")

    assert await robot.end() == ("FINISHED", "done")


async def test_a_negative_response_fails_the_action() -> None:
    robot = Robot(LIFT)
    robot.ros.replies["lift/command"] = lambda _: robot.ros.say("lift/result", data="jammed")
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "jammed")


async def test_an_action_is_paused_and_cancelled_by_messages() -> None:
    robot = Robot(LIFT)
    await robot.begin("lift", height=1)
    await robot.until_published("raise 1")
    robot.runner.pause(PauseAction("a"))
    robot.runner.resume(ResumeAction("a"))
    robot.runner.cancel(CancelAction("a"))

    assert await robot.end() == ("FAILED", "cancelled")
    await robot.until_published("raise 1", "hold", "go on", "stop a")
    assert ActionStatus.PAUSED in [each.status for each in robot.reports]


async def test_a_goal_not_sent_before_a_pause_is_sent_after_it() -> None:
    robot = Robot(LIFT)
    robot.ros.listeners = 0
    await robot.begin("lift", height=1)
    robot.runner.pause(PauseAction("a"))
    robot.ros.listeners = 1
    robot.runner.resume(ResumeAction("a"))
    robot.runner.pause(PauseAction("a"))
    robot.runner.resume(ResumeAction("a"))

    await robot.until_published("raise 1")


async def test_an_action_that_takes_too_long_is_stopped() -> None:
    robot = Robot({**LIFT, "timeout": 1.0})
    await robot.begin("lift", height=1)

    status, result = await robot.end()
    assert status == "FAILED"
    assert "took longer than 1 s; last progress: waits for lift/result" in str(result)
    await robot.until_published("raise 1", "stop a")


async def test_a_command_without_a_subscriber_fails() -> None:
    robot = Robot({**LIFT, "command": {**STEERED, "listener_timeout": 0.1}})
    robot.ros.listeners = 0
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "no node subscribes to lift/command")
    assert robot.ros.published == []


async def test_without_a_session_an_action_fails_with_the_reason() -> None:
    robot = Robot(LIFT)
    robot.ros.active = False
    await robot.begin("lift", height=1)

    assert await robot.end() == ("FAILED", "the robot's ROS session is not active")


@pytest.mark.parametrize(
    ("call", "response", "end"),
    [
        ({}, {"success": True, "message": "closed"}, ("FINISHED", "closed")),
        ({}, {"success": False, "message": "jammed"}, ("FAILED", "jammed")),
        ({}, {"success": False, "message": ""}, ("FAILED", "clamp reported failure")),
        ({"expect": {"message": ["a", "b"]}}, {"success": False, "message": "b"}, ("FINISHED", "b")),
        ({"result": "success"}, {"success": True, "message": ""}, ("FINISHED", "True")),
    ],
)
async def test_a_service_is_called_and_its_response_checked(
    call: dict[str, Any], response: dict[str, Any], end: tuple[str, str]
) -> None:
    robot = Robot({**CLAMP, "call": {**CALL, **call}})
    robot.ros.services["clamp"] = response
    await robot.begin("clamp")

    assert await robot.end() == end
    assert robot.ros.called == [("clamp", {"data": True})]


async def test_charging_starts_when_the_battery_reports_it() -> None:
    robot = Robot({"kind": "charge", "call": {"service": "connect", "type": "std_srvs/srv/Trigger"}})
    robot.ros.services["connect"] = {"success": True, "message": "connected"}
    await robot.begin("startCharging")
    await until(lambda: robot.ros.called)
    robot.ros.say("battery_state", power_supply_status=2)
    assert not [each for each in robot.reports if each.status.ended]
    robot.ros.say("battery_state", power_supply_status=1)

    assert (await robot.end())[0] == "FINISHED"
    assert robot.reports[-1].charging is True


async def test_a_signal_is_awaited_and_a_latched_one_is_used() -> None:
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


async def test_a_turn_signal_of_an_edge_is_switched_off_at_its_end() -> None:
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
