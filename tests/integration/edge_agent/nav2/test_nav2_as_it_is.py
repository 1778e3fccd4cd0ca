"""What a real Nav2 does beside driving, and a robot that only obeys has never seen."""

from __future__ import annotations

from typing import Any

import pytest
from nav_msgs.msg import Odometry

from nena_edge_agent.nav2.settings import Navigation
from nena_shared.vda5050.topics import Topic
from support.action_types import needs_action_types
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import ROS, Bench, ready
from support.robot_core import action, order, position
from support.ros import BEST_EFFORT
from support.simulator import goal, publisher_to
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

QUICK: dict[str, Any] = {**ROS, "call_timeout": 0.5}
LONG_WAY = order("n0", "n3")


def be_at(action_id: str, x: float, node: str) -> Any:
    return action(action_id, "NONE", "initPosition", x=x, y=0.0, theta=0.0, mapId="hall", lastNodeId=node)


def localised(state: dict[str, Any]) -> bool:
    return bool(state.get("agvPosition", {}).get("positionInitialized"))


def texts(state: dict[str, Any]) -> str:
    return " ".join(each.get("errorDescription", "") for each in state["errors"])


async def test_agent_reports_that_it_is_starting(bench: Bench) -> None:
    async with bench.agent(ros=QUICK) as fleet:
        await fleet.state(lambda state: "is Nav2 running there?" in texts(state))
        told = [texts(state) for state in fleet.states if texts(state)]
        assert "just started" in told[0]
        assert not any("initial position" in text for text in told)


async def test_initial_position_is_accepted_while_a_goal_hangs(bench: Bench) -> None:
    async with bench.robot(ros={**QUICK, "navigation": "topics"}) as fleet:
        bench.fault("reject_goals")
        fleet.send(LONG_WAY)
        driving = await fleet.state(lambda state: state["driving"])
        bench.fault("bring_up")
        await fleet.state(
            lambda state: (
                state["headerId"] > driving["headerId"]  # the agent's own start says the same
                and (
                    "navigationError" in str(state["errors"])
                    or "not active" in texts(state)
                    or "does not answer" in texts(state)
                )
            )
        )
        fleet.instant(be_at("p", 0.0, "n0"))
        state = await fleet.state(lambda state: status_of(state, "p") in ("FINISHED", "FAILED"))
        assert status_of(state, "p") == "FINISHED"


async def test_restarted_localisation_has_lost_the_pose(bench: Bench) -> None:
    async with bench.robot(ros=QUICK) as fleet:
        assert localised(fleet.states[-1])
        bench.fault("server_died", server="amcl")
        lost = await fleet.state(lambda state: not localised(state) and "is not running" in texts(state))
        assert "localizationError" in str(lost["errors"]) or "LOCALIZATION_ERROR" in error_types(lost)
        bench.fault("server_died", server="amcl", active=False)
        fleet.send(order("n0", "n1", order_id="lost"))
        await fleet.state(lambda state: "its position is not known" in texts(state))
        fleet.instant(be_at("p", 0.0, "n0"))
        await fleet.state(lambda state: status_of(state, "p") == "FINISHED" and localised(state))
        fleet.send(order("n0", "n1"))
        state = await fleet.state(ended("o1"))
        assert (state["lastNodeId"], localised(state)) == ("n1", True)


async def test_localisation_crash_stops_the_driving_robot(bench: Bench) -> None:
    async with bench.robot(time_factor=2.0, ros=QUICK) as fleet:
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault("server_died", server="amcl")
        await fleet.state(lambda state: "is not running" in texts(state))
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        assert bench.places[-1] < 29.0


@needs_action_types
async def test_robot_in_recovery_behaviors_is_blocked(bench: Bench) -> None:
    walled_in = '[{"kind": "unreachable", "error_code": 208}]'
    patience = {"goals": {**ROS["goals"], "blocked_after": 7.0}, "navigation": "action"}
    options = ("--recovery_time", "300", "--faults", walled_in)
    with bench.simulator(*options, time_factor=1.0):
        async with bench.agent(ros={**QUICK, **patience}) as fleet:
            await fleet.state(ready)
            fleet.send(LONG_WAY)
            await until(lambda: bench.speed > 0.1, what="the robot backing up")
            state = await fleet.state(lambda state: "ROBOT_BLOCKED" in error_types(state))
            assert state["driving"]


@needs_action_types
async def test_abort_without_a_reason_names_likely_causes(bench: Bench) -> None:
    async with bench.robot(time_factor=2.0, ros={**QUICK, "navigation": "action"}) as fleet:
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault("inactive")
        state = await fleet.state(lambda state: "DRIVE_RETRIED" in error_types(state))
        assert "default_server_timeout" in str(state["errors"])


@needs_action_types
async def test_late_extension_through_poses_causes_no_delay(bench: Bench) -> None:
    through = {"strategy": "pass_through", "pass_radius": 0.5}
    nodes = ("n0", "n1", "n2", "n3", "n4")
    places = {name: position(2.0 * index, radius=0.5) for index, name in enumerate(nodes)}
    odometry = bench.ros.subscribe(Odometry, "odom", BEST_EFFORT)
    with bench.simulator("--replan_period", "1.0", time_factor=1.0):
        async with bench.agent(ros={**QUICK, "navigation": Navigation.THROUGH_POSES}, drive=through) as fleet:
            await fleet.state(ready)
            fleet.send(order(*nodes, released=3, positions=places))
            await until(lambda: bench.places and bench.places[-1] > 3.0, what="the robot near its base's end")
            fleet.send(order(*nodes[2:], update=1, first=4, positions=places))
            done = await fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n4", [])
    on_the_way = [each for each in odometry.messages if 1.0 < each.pose.pose.position.x < 7.0]
    stood = [each for each in on_the_way if abs(each.twist.twist.linear.x) < 0.05]
    assert len(stood) * 0.05 < 1.0, f"it stood for {len(stood) * 0.05:.1f} s"


@pytest.mark.long
@needs_action_types
async def test_operator_takes_over_during_navigate_through_poses(bench: Bench) -> None:
    ros = {**QUICK, "navigation": Navigation.THROUGH_POSES}
    async with bench.robot(time_factor=2.0, ros=ros, drive={"strategy": "pass_through"}) as fleet:
        rviz = publisher_to(bench.ros, type(goal(0.0, 0.0)), "goal_pose")
        fleet.send(order("n0", "n1", "n2", "n3"))
        await bench.moves()
        rviz.publish(goal(5.0, 5.0))
        await fleet.state(lambda state: "EXTERNAL_GOAL" in error_types(state))
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        rviz.publish(goal(5.0, 5.0))
        await bench.moves()
        done = await fleet.state(ended("o1"))
        assert (done["lastNodeId"], error_types(done)) == ("n3", [])
        assert any(each.pose.pose.position.y > 4.5 for each in bench.odometry)


async def test_nav2_goal_tolerance_is_checked_before_driving(bench: Bench) -> None:
    narrow = {"n1": position(10.0, radius=0.1)}
    with bench.simulator(tolerance={"xy": 0.4, "yaw": 0.2}):
        async with bench.agent(ros=QUICK) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", positions=narrow))
            state = await fleet.state(lambda state: "DEVIATION_TOO_SMALL" in error_types(state))
            assert "goal tolerance is 0.4 m" in texts(state)
            assert state["lastNodeId"] == "n0"
            await until(lambda: "at least 0.4 m" in factsheet(bench), what="the tolerance in the factsheet")
            assert "at least 0.2 rad" in factsheet(bench)


@pytest.mark.parametrize(
    "navigation",
    [
        Navigation.TOPICS,
        *(
            pytest.param(each, marks=needs_action_types)
            for each in (Navigation.ACTION, Navigation.THROUGH_POSES)
        ),
    ],
)
async def test_robot_off_its_heading_turns_at_the_node_where_it_stands(
    bench: Bench, navigation: Navigation
) -> None:
    facing = position(0.0, theta=0.0)
    with bench.simulator(start={"yaw": 1.5}):
        async with bench.agent(ros={**QUICK, "navigation": navigation}) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", positions={"n0": facing, "n1": facing}))
            done = await fleet.state(ended("o1"))
            assert (done["lastNodeId"], error_types(done)) == ("n1", [])
            assert abs(done["agvPosition"]["theta"]) < 0.35
            await until(
                lambda: abs(float(bench.odometry[-1].twist.twist.angular.z)) < 0.01, what="standstill"
            )
            assert max(map(abs, bench.places)) < 0.3


def factsheet(bench: Bench) -> str:
    return str(bench.fleet.peer.payloads(bench.fleet.topic(Topic.FACTSHEET))[-1:])


async def test_goal_tolerance_can_be_set_manually(bench: Bench) -> None:
    narrow = {"n1": position(10.0, radius=0.1)}
    ros = {**QUICK, "goals": {**ROS["goals"], "goal_tolerance": 0.05}}
    async with bench.robot(ros=ros) as fleet:
        fleet.send(order("n0", "n1", positions=narrow))
        await fleet.state(lambda state: state["orderId"] == "o1" and state["driving"])
        assert not any("DEVIATION_TOO_SMALL" in error_types(state) for state in fleet.states)
