"""Commands, calls and answers of ready-made actions, one after the other."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.protocol.events import CancelAction, PauseAction, ResumeAction
from nena_shared.vda5050.action import ActionStatus
from support.ready_made import CALL, CLAMP, LIFT, STEERED, Robot
from support.waiting import until


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
    robot = Robot({**LIFT, "timeout": 1.0})
    await robot.begin("lift", height=1)

    status, result = await robot.end()
    assert status == "FAILED"
    assert "took longer than 1 s; the last that it told: waits for lift/result" in str(result)
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
    await until(lambda: robot.ros.called)
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
