"""What fleet control sees of each failure: the agent, a broker, and a simulator process over DDS."""

from __future__ import annotations

import pytest
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped

from support.action_types import HERE, needs_action_types
from support.edge_agent import ended, error_types
from support.nav2_agent import ROS, Bench, failure_of, ready
from support.nav2_driver import QUICK
from support.robot_core import action, order
from support.simulator import goal, publisher_to
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

BOTH_DOORS = pytest.mark.parametrize("door", ["topics", pytest.param("action", marks=needs_action_types)])
"""Goals given by topic, and by the action; the other tests take what there is."""
BLOCKED_SOON = {**ROS["goals"], "blocked_after": 0.5}


@BOTH_DOORS
async def test_external_goal_pauses_the_order_until_it_ends(bench: Bench, door: str) -> None:
    async with bench.robot(ros={"navigation": door}) as fleet:
        rviz = publisher_to(bench.ros, PoseStamped, "goal_pose")
        fleet.send(order("n0", "n3"))
        await bench.moves()
        rviz.publish(goal(2.0, 4.0))
        waiting = await fleet.state(lambda state: "EXTERNAL_GOAL" in error_types(state))
        assert "externalGoal" in [each["infoType"] for each in waiting["information"]]
        assert waiting["nodeStates"]
        done = await fleet.state(ended("o1"))
        assert error_types(done) == []
        assert all(failure_of(state) is None for state in fleet.states)


async def test_external_goal_fails_the_order_if_configured(bench: Bench) -> None:
    async with bench.robot(drive={"external_goals": "fail"}) as fleet:
        rviz = publisher_to(bench.ros, PoseStamped, "goal_pose")
        fleet.send(order("n0", "n3"))
        await bench.moves()
        rviz.publish(goal(2.0, 4.0))
        await fleet.state(lambda state: failure_of(state) == "TAKEN_OVER")
        await fleet.state(
            lambda state: any("SUCCEEDED" in each["infoDescription"] for each in state["information"])
        )
        fleet.send(order("n3", "n2", update=1, first=2))
        assert failure_of(await fleet.state(ended("o1"))) is None


@BOTH_DOORS
async def test_unreachable_goal_fails_and_an_update_retries(bench: Bench, door: str) -> None:
    async with bench.robot(ros={"navigation": door}) as fleet:
        bench.fault("unreachable", goals=1)
        fleet.send(order("n0", "n1"))
        state = await fleet.state(lambda state: failure_of(state) == "ABORTED")
        assert (state["nodeStates"][0]["nodeId"], state["lastNodeId"]) == ("n1", "n0")
        reason = "no path leads to the goal (error code 208)" in state["errors"][0]["errorDescription"]
        assert reason is HERE
        # it halts after each failure (Nav2's controller may drive on), and says so when it stands
        await fleet.state(lambda state: failure_of(state) == "ABORTED" and not state["driving"])
        fleet.send(order("n1", "n2", update=1, first=2))
        assert error_types(await fleet.state(ended("o1"))) == []


async def test_aborted_drive_is_retried_if_configured(bench: Bench) -> None:
    async with bench.robot(drive={"retries": 1, "retry_wait": 0.2}) as fleet:
        bench.fault("abort_halfway", goals=1)
        fleet.send(order("n0", "n1"))
        await fleet.state(lambda state: "DRIVE_RETRIED" in error_types(state))
        assert error_types(await fleet.state(ended("o1"))) == []
        assert all(failure_of(state) is None for state in fleet.states)


async def test_drive_fails_after_the_last_retry(bench: Bench) -> None:
    async with bench.robot(drive={"retries": 2, "retry_wait": 0.1}) as fleet:
        bench.fault("unreachable")
        fleet.send(order("n0", "n1"))
        state = await fleet.state(lambda state: failure_of(state) == "ABORTED")
        assert "DRIVE_RETRIED" not in error_types(state)
        bench.fault("unreachable", active=False)
        fleet.instant(action("c", "NONE", "cancelOrder"))
        await fleet.state(lambda state: not state["nodeStates"] and not state["errors"] and state["orderId"])


async def test_externally_cancelled_drive_fails_without_retry(bench: Bench) -> None:
    async with bench.robot(drive={"retries": 3, "retry_wait": 0.1}) as fleet:
        canceller = bench.ros.client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
        fleet.send(order("n0", "n3"))
        await bench.moves()
        bench.ros.call(canceller, CancelGoal.Request())
        await fleet.state(lambda state: failure_of(state) == "CANCELED_FROM_OUTSIDE")


@BOTH_DOORS
async def test_goal_that_is_never_accepted_fails(bench: Bench, door: str) -> None:
    async with bench.robot(ros={"navigation": door, "goals": QUICK.model_dump()}) as fleet:
        bench.fault("reject_goals")
        fleet.send(order("n0", "n1"))
        await fleet.state(lambda state: failure_of(state) == "NOT_TAKEN_UP")


async def test_blocked_robot_reports_it_until_it_moves(bench: Bench) -> None:
    async with bench.robot(ros={"goals": BLOCKED_SOON}) as fleet:
        fleet.send(order("n0", "n3"))
        await bench.moves()
        bench.fault("stuck")
        state = await fleet.state(lambda state: "ROBOT_BLOCKED" in error_types(state))
        assert state["driving"]
        (blocked,) = (each for each in state["errors"] if each["errorType"] == "ROBOT_BLOCKED")
        assert "'n3'" in blocked["errorDescription"]
        bench.fault("stuck", active=False)
        assert error_types(await fleet.state(ended("o1"))) == []


async def test_robot_stops_without_poses_and_continues_when_they_return(bench: Bench) -> None:
    localisation = {"pose_timeout": 0.5}
    async with bench.robot(ros={"localisation": localisation}) as fleet:
        fleet.send(order("n0", "n3"))
        await bench.moves()
        bench.fault("amcl_silent")
        state = await fleet.state(lambda state: "localizationError" in error_types(state))
        assert "no pose" in state["errors"][0]["errorDescription"]
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        bench.fault("amcl_silent", active=False)
        done = await fleet.state(ended("o1"))
        assert (error_types(done), done["lastNodeId"]) == ([], "n3")


async def test_delocalised_robot_stops_until_it_is_localised(bench: Bench) -> None:
    localisation = {"pose_timeout": 0.5}
    async with bench.robot(ros={"localisation": localisation}) as fleet:
        fleet.send(order("n0", "n3"))
        await bench.moves()
        bench.fault("localisation_lost")
        state = await fleet.state(lambda state: "localizationError" in error_types(state))
        assert "3.00 m" in state["errors"][0]["errorDescription"]
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        bench.fault("localisation_lost", active=False)
        assert error_types(await fleet.state(ended("o1"))) == []


async def test_order_waits_until_nav2_is_available(bench: Bench) -> None:
    async with bench.agent() as fleet:
        await fleet.state(lambda state: "navigationNotAvailable" in error_types(state))
        with bench.simulator():
            await fleet.state(ready)
            fleet.send(order("n0", "n1"))
            assert error_types(await fleet.state(ended("o1"))) == []
