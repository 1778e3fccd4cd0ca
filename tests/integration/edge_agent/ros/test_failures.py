"""What fleet control sees of each failure: the agent, a broker, and a simulator process over DDS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped

from support.broker import Broker
from support.edge_agent import ended, error_types
from support.nav2_agent import Bench, failure_of
from support.robot_core import order
from support.ros import RosPeer
from support.simulator import goal, publisher_to

pytestmark = [pytest.mark.ros, pytest.mark.broker]


@pytest.fixture
def bench(
    broker: Broker, interface_name: str, peer: RosPeer, domain_id: int, tmp_path: Path
) -> Iterator[Bench]:
    bench = Bench(broker, interface_name, ros=peer, domain_id=domain_id, folder=tmp_path)
    with bench.mqtt:
        yield bench


async def test_an_external_goal_pauses_the_order_which_goes_on_after_it(bench: Bench) -> None:
    async with bench.robot() as fleet:
        rviz = publisher_to(bench.ros, PoseStamped, "goal_pose")
        fleet.send(order("n0", "n1"))
        await bench.moves()
        rviz.publish(goal(2.0, 4.0))
        waiting = await fleet.state(lambda state: "EXTERNAL_GOAL" in error_types(state))
        assert [each["infoType"] for each in waiting["information"]][-1] == "externalGoal"
        assert waiting["nodeStates"]
        done = await fleet.state(ended("o1"))
        assert error_types(done) == []
        assert all(failure_of(state) is None for state in fleet.states)


async def test_an_external_goal_fails_the_order_where_that_is_set(bench: Bench) -> None:
    async with bench.robot(drive={"external_goals": "fail"}) as fleet:
        rviz = publisher_to(bench.ros, PoseStamped, "goal_pose")
        fleet.send(order("n0", "n1"))
        await bench.moves()
        rviz.publish(goal(2.0, 4.0))
        await fleet.state(lambda state: failure_of(state) == "TAKEN_OVER")
        await fleet.state(
            lambda state: any("SUCCEEDED" in each["infoDescription"] for each in state["information"])
        )
        fleet.send(order("n1", "n2", update=1, first=2))
        assert failure_of(await fleet.state(ended("o1"))) is None
