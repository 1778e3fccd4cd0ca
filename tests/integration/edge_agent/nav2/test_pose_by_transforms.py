"""A robot whose localisation publishes transforms alone drives, and is not localised without them."""

from __future__ import annotations

from typing import Any

import pytest

from support.action_types import needs_nav2_types
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import Bench, ready
from support.robot_core import action, order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]

NO_TOPIC: dict[str, Any] = {"localisation": {"pose_topic": False}}


@pytest.mark.parametrize("navigation", ["action", "topics"])
async def test_robot_drives_by_transforms_without_a_pose_topic(bench: Bench, navigation: str) -> None:
    with bench.simulator(**NO_TOPIC):
        async with bench.agent(ros={"navigation": navigation}) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", positions={"n1": position(3.0, radius=0.4)}))
            done = await fleet.state(ended("o1"))
    assert error_types(done) == []
    assert abs(done["agvPosition"]["x"] - 3.0) < 0.4


async def test_localisation_crash_makes_the_pose_unknown_until_it_is_set(bench: Bench) -> None:
    with bench.simulator(**NO_TOPIC):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            bench.fault("server_died", server="amcl")
            lost = await fleet.state(lambda state: "localizationError" in error_types(state))
            (told,) = (each for each in lost["errors"] if each["errorType"] == "localizationError")
            assert "no transform from the frame map to odom" in told["errorDescription"]
            assert not lost["agvPosition"]["positionInitialized"]

            bench.fault("server_died", server="amcl", active=False)
            place: dict[str, Any] = {"x": 1.0, "y": 1.0, "theta": 0.0, "mapId": "hall", "lastNodeId": "n1"}
            fleet.instant(action("p", "NONE", "initPosition", retriable=None, **place))
            await fleet.state(lambda state: status_of(state, "p") == "FINISHED")
            await until(lambda: ready(fleet.states[-1]), what="a robot that knows where it is")
            assert abs(fleet.states[-1]["agvPosition"]["x"] - 1.0) < 0.2


async def test_pose_topic_takes_precedence_over_transforms(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent() as fleet:
            await fleet.state(ready)
            await until(lambda: bench.ros.node.count_publishers("tf") == 1, what="transforms")
            # While the pose topic is not discovered yet, transforms are used.
            await until(lambda: bench.ros.node.count_subscribers("tf") == 0, what="its end")
