"""Stopping a driving robot: what is reported as finished, and when, with a simulator process over DDS."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.broker import Broker
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import Bench
from support.robot_core import action, order
from support.ros import RosPeer
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

FAST = 1.5
"""m/s from which a robot takes a while to stop."""


@pytest.mark.clause("6.1.3", "6.2.3")
@pytest.mark.parametrize("action_type", ["cancelOrder", "startPause"])
async def test_stopping_finishes_only_when_the_robot_stands(bench: Bench, action_type: str) -> None:
    async with bench.robot(time_factor=2.0) as fleet:
        fleet.send(order("n0", "n3"))
        await until(lambda: bench.speed > FAST, what="a fast robot")
        fleet.instant(action("a", "NONE", action_type))
        running = await fleet.state(lambda state: status_of(state, "a") == "RUNNING")
        assert await bench.speed_at(running) > 0.0

        state = await fleet.state(lambda state: status_of(state, "a") == "FINISHED")

        assert await bench.speed_at(state) == 0.0
        assert not state["driving"]
        assert bool(state["nodeStates"]) is (action_type == "startPause")


@pytest.mark.clause("6.2.3")
async def test_goal_is_resent_after_a_pause(bench: Bench) -> None:
    async with bench.robot() as fleet:
        fleet.send(order("n0", "n3"))
        await bench.moves()
        fleet.instant(action("p", "NONE", "startPause"))
        await fleet.state(lambda state: status_of(state, "p") == "FINISHED")
        fleet.instant(action("s", "NONE", "stopPause"))
        done = await fleet.state(ended("o1"))
        assert (done["lastNodeId"], error_types(done)) == ("n3", [])


async def test_preventive_robot_stops_while_its_broker_is_away(
    own_broker: Broker, interface_name: str, peer: RosPeer, domain_id: int, tmp_path: Path
) -> None:
    bench = Bench(own_broker, interface_name, ros=peer, domain_id=domain_id, folder=tmp_path)
    preventive = {"link_loss": "preventive_at_once", "link_loss_patience": 0.2}
    with bench.mqtt:
        async with bench.robot(drive=preventive) as fleet:
            fleet.send(order("n0", "n3"))
            await until(lambda: bench.speed > FAST, what="a fast robot")
            own_broker.kill()
            await until(lambda: bench.speed == 0.0, what="the robot at rest")
            own_broker.start()
            await bench.moves()
            done = await fleet.state(ended("o1"))
            assert (done["lastNodeId"], error_types(done)) == ("n3", [])
