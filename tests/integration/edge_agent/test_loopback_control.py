"""The control door of a loopback robot: what people and the world do shows in its state, in each version."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import pytest

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import EmergencyStop, OperatingMode, State
from support.broker import Broker
from support.loopback_bench import BenchRobot, action_state, errors, idle, place, shared_robot
from support.robot_core import action, order
from support.waiting import until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

VERSIONS = ("2.1.0", "3.0.0")


def stands(state: State) -> bool:
    return not state.driving and bool(state.node_states)


def charged(percent: float) -> Callable[[State], bool]:
    return lambda state: state.power_supply.state_of_charge == percent


@pytest.fixture(scope="module", params=VERSIONS)
def robot(
    request: pytest.FixtureRequest, broker: Broker, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[BenchRobot]:
    """Yield a robot shared by all tests of this module: each leaves it in order."""
    with shared_robot(broker, tmp_path_factory.mktemp("journal"), request.param) as made:
        yield made


@pytest.mark.clause("6.6.6")
async def test_manual_mode_is_entered_and_left(robot: BenchRobot) -> None:
    answer = await robot.command("operatingMode", mode="MANUAL")
    assert answer["accepted"]
    assert answer["command"] == "operatingMode"
    await robot.state(lambda state: state.operating_mode is OperatingMode.MANUAL)

    await robot.command("operatingMode", mode="AUTOMATIC")
    await robot.state(lambda state: state.operating_mode is OperatingMode.AUTOMATIC)


@pytest.mark.clause("6.6.5.4/localisation", "7.8/position")
async def test_lost_position_stops_the_robot_until_it_is_localised(robot: BenchRobot) -> None:
    await robot.begin("n0", "n9")
    await robot.command("localization", localized=False)
    lost = await robot.state(lambda state: not place(state).localized and not state.driving)
    assert "LOCALIZATION_ERROR" in errors(lost)
    assert lost.node_states

    await robot.command("localization", localized=True)
    assert not errors(await robot.finish("n9"))


@pytest.mark.clause("6.6.5.4/unreachable", "6.6.5.1/keeps")
async def test_unreachable_node_is_an_error_and_the_order_stays_active(robot: BenchRobot) -> None:
    await robot.command("speed", speed=50)
    await robot.command("unreachable", x=20, y=0)
    await robot.begin("n0", "n1", "n2")
    stuck = await robot.state(lambda state: "NODE_UNREACHABLE" in errors(state))
    assert [node.node_id for node in stuck.node_states] == ["n2"]
    assert stuck.last_node_id == "n1"

    await robot.command("unreachable", x=20, y=0, active=False)
    await robot.cancel()
    await robot.begin("n0", "n1", "n2")
    await robot.finish("n2")


@pytest.mark.clause("6.1.4.8")
async def test_order_without_a_route_is_rejected(robot: BenchRobot) -> None:
    await robot.begin("n0")
    await robot.command("noRoute", x=20, y=0)
    robot.fleet.send(order("n0", "n1", "n2", order_id="nowhere"))
    refused = await robot.state(errors)
    assert errors(refused) == ["NO_ROUTE_TO_TARGET" if robot.version == "3.0.0" else "NO_ROUTE_ERROR"]
    assert "n2" in str(refused.errors)
    assert refused.order_id != "nowhere"

    await robot.command("noRoute", x=20, y=0, active=False)
    await robot.begin("n0", "n2")
    assert not errors(await robot.finish("n2"))


async def test_order_continues_when_navigation_is_back(robot: BenchRobot) -> None:
    await robot.begin("n0", "n5")
    await robot.command("navigation", available=False, reason="the map server is restarted")
    gone = await robot.state(lambda state: "NAVIGATION_NOT_AVAILABLE" in errors(state))
    assert "the map server is restarted" in str(gone.errors)

    await robot.command("navigation", available=True)
    assert not errors(await robot.finish("n5"))


@pytest.mark.clause("6.6.5.1", "6.6.5")
@pytest.mark.parametrize("level", ErrorLevel)
async def test_errors_of_each_level_are_reported_and_withdrawn(robot: BenchRobot, level: ErrorLevel) -> None:
    wrong: dict[str, Any] = {"errorType": "bumperWorn", "errorReferences": {"part": "left"}}
    await robot.command("error", **wrong, errorLevel=level, errorDescription="worn")

    state = await robot.state(lambda state: "BUMPER_WORN" in errors(state))
    (entry,) = state.errors
    mild = level in (ErrorLevel.WARNING, ErrorLevel.URGENT)
    two = ErrorLevel.WARNING if mild else ErrorLevel.FATAL
    assert entry.error_level is (level if state.version.startswith("3") else two)
    assert [(each.reference_key, each.reference_value) for each in entry.error_references] == [
        ("part", "left")
    ]

    await robot.command("error", **wrong, active=False)
    await robot.state(lambda state: not errors(state))


@pytest.mark.clause("6.6.5.1")
async def test_a_critical_error_stops_the_robot_until_it_is_withdrawn(robot: BenchRobot) -> None:
    await robot.begin("n0", "n9")
    await robot.command("error", errorType="brakeHot", errorLevel="CRITICAL")
    assert (await robot.state(stands)).node_states

    await robot.command("error", errorType="brakeHot", active=False)
    await robot.finish("n9")


@pytest.mark.clause("7.8/safety")
async def test_a_field_violation_stops_the_robot_until_the_field_is_clear(robot: BenchRobot) -> None:
    await robot.begin("n0", "n9")
    await robot.command("fieldViolation", active=True)
    assert (await robot.state(stands)).safety_state.field_violation

    await robot.command("fieldViolation", active=False)
    done = await robot.finish("n9")
    assert not done.safety_state.field_violation


@pytest.mark.clause("7.8/safety")
@pytest.mark.parametrize("stop", [EmergencyStop.MANUAL, EmergencyStop.REMOTE])
async def test_an_emergency_stop_lasts_until_it_is_acknowledged(
    robot: BenchRobot, stop: EmergencyStop
) -> None:
    await robot.begin("n0", "n9")
    await robot.command("emergencyStop", stop=stop)
    stopped = await robot.state(stands)
    assert stopped.safety_state.active_emergency_stop is stop
    there = place(stopped)
    await robot.command("battery", stateOfCharge=80)
    assert place(await robot.state(charged(80))) == there

    await robot.command("acknowledgeEmergencyStop")
    done = await robot.finish("n9")
    assert done.safety_state.active_emergency_stop is EmergencyStop.NONE


@pytest.mark.clause("7.8/paused")
async def test_the_pause_button_stops_the_robot(robot: BenchRobot) -> None:
    await robot.begin("n0", "n9")
    await robot.command("pauseButton", pressed=True)
    await robot.state(lambda state: stands(state) and state.paused)

    await robot.command("pauseButton", pressed=False)
    assert not (await robot.finish("n9")).paused


@pytest.mark.clause("7.8/power")
async def test_charging_increases_the_charge_and_driving_ends_it(robot: BenchRobot) -> None:
    await robot.command("battery", stateOfCharge=12)
    await robot.state(charged(12))
    await robot.command("charging", charging=True)
    await robot.state(lambda state: state.power_supply.charging and state.power_supply.state_of_charge > 12)

    await robot.begin("n0", "n1")
    done = await robot.state(lambda state: idle(state) and state.last_node_id == "n1")
    assert not done.power_supply.charging


@pytest.mark.clause("6.2.3/startCharging")
async def test_a_charging_action_charges_the_simulated_battery(robot: BenchRobot) -> None:
    await robot.command("battery", stateOfCharge=20)
    await robot.begin("n0", node_actions={"n0": [action(f"charge-{id(robot)}", "HARD", "startCharging")]})
    await robot.state(lambda state: state.power_supply.charging and state.power_supply.state_of_charge > 20)

    await robot.command("charging", charging=False)
    await robot.state(lambda state: not state.power_supply.charging)


async def test_robot_is_moved_by_hand(robot: BenchRobot) -> None:
    await robot.command("pose", x=-3.5, y=2, theta=1)

    state = await robot.state(lambda state: place(state).x == -3.5)
    assert (place(state).y, place(state).theta) == (2, 1)


async def test_robot_keeps_to_the_set_speed(robot: BenchRobot) -> None:
    await robot.command("speed", speed=2.5)
    await robot.begin("n0", "n1")
    await robot.state(lambda state: state.velocity is not None and state.velocity.vx == 2.5)

    await robot.finish("n1")


@pytest.mark.clause("4.1/will", "4.1")
async def test_silent_robot_is_reported_as_broken_until_it_is_back(robot: BenchRobot) -> None:
    await robot.command("linkSilence", seconds=0.3)

    broken = "CONNECTION_BROKEN" if robot.version == "3.0.0" else "CONNECTIONBROKEN"
    await until(lambda: robot.fleet.connections[-2:] == [broken, "ONLINE"])
    await robot.state(lambda _: True)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"command": "fly"}, "fly"),
        ({"command": "speed", "speed": 0}, "speed.speed: Input should be greater than 0"),
        ({"command": "speed", "speed": "3"}, "speed.speed: Input should be a valid number"),
        ({"command": "pauseButton", "pressed": True, "hard": True}, "hard: unknown field"),
        ({"command": "operatingMode", "mode": "LUNCH"}, "operatingMode.mode: Input should be"),
        ({"command": "emergencyStop", "stop": "NONE"}, "emergencyStop.stop: Input should be"),
    ],
)
async def test_invalid_command_is_answered_with_the_reason_and_changes_nothing(
    robot: BenchRobot, fields: dict[str, Any], problem: str
) -> None:
    answer = await robot.send(fields | {"id": f"wrong-{uuid4()}"})

    assert not answer["accepted"]
    assert answer["command"] == fields["command"]
    assert problem in str(answer["problems"])
    state = await robot.state(lambda _: True)
    assert state.operating_mode is OperatingMode.AUTOMATIC
    assert not state.paused


@pytest.mark.parametrize("payload", [b"{", b"[]", b"\xff", b"[" * 5000, b'"' + b"x" * 20_000 + b'"'])
async def test_malformed_command_is_answered_too(robot: BenchRobot, payload: bytes) -> None:
    await robot.command("pauseButton", pressed=False)
    robot.publish(payload)

    answer = await until(
        lambda: next((each for each in robot.answers if not each["accepted"]), None), what="a refusal"
    )
    assert answer["problems"]


@pytest.mark.clause("6.6.9/failed", "6.2.3/pick")
async def test_rehearsed_actions_fail_and_succeed_as_configured(robot: BenchRobot) -> None:
    await robot.command("pauseButton", pressed=False)
    run = uuid4().hex
    kinds = ("failAlways", "failOnce", "failOnce", "waitUninterrupted", "pick", "drop")
    actions = [action(f"{run}-{index}", "HARD", kind) for index, kind in enumerate(kinds)]
    await robot.begin("n0", node_actions={"n0": actions})

    done = await robot.state(idle)
    ends = [action_state(done, each.action_id) for each in actions]
    finished = [each is not None and each.action_status is ActionStatus.FINISHED for each in ends]
    assert finished == [False, False, True, True, True, True]
    assert done.loads == ()


@pytest.mark.clause("6.1.4.3")
@pytest.mark.parametrize("parameters", [{}, {"count": "three"}])
async def test_order_without_a_required_action_parameter_is_rejected(
    robot: BenchRobot, parameters: dict[str, Any]
) -> None:
    await robot.command("pose", x=0, y=0)
    wrong = action(f"{uuid4()}", "HARD", "needParameter", **parameters)
    robot.fleet.send(order("n0", order_id="refused", node_actions={"n0": [wrong]}))
    state = await robot.state(lambda state: "count" in str(state.errors))
    assert state.order_id != "refused"

    right = action(f"{uuid4()}", "HARD", "needParameter", count=3)
    await robot.begin("n0", node_actions={"n0": [right]})
    done = await robot.state(lambda state: idle(state) and not state.errors)
    assert action_state(done, right.action_id)
