"""A plant and a map that lies scaled, turned and shifted to it: over DDS, from host to Nav2 and back."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from math import pi, remainder, tau
from pathlib import Path
from typing import Any

import httpx
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped

from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.ros import yaw_of
from nena_shared.vda5050.topics import Topic
from support.broker import Broker
from support.edge_agent import ended, error_types, running_agent
from support.nav2_agent import Bench, ready
from support.order_service_fleet import Fleet, order_in, running, vehicle_idle
from support.robot_core import action, order
from support.ros import LATCHED, Inbox
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

TRANSFORM = "scale=2 rotation=90 x=20 y=0"
"""(x, y, θ) of the plant is (20 - 2y, 2x, θ + 90°) on the map."""
HALL = "sample-hall"


@pytest.fixture
def version() -> str:
    return "3.0.0"


def on_map(x: float, y: float) -> dict[str, float]:
    """Return where a place of the plant, with the heading 0, is on the map."""
    return {"x": 20.0 - 2.0 * y, "y": 2.0 * x, "yaw": pi / 2}


def poses_on_map(bench: Bench) -> Inbox[Any]:
    """Listen to where the robot's localisation has it."""
    return bench.ros.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)


def read_pose(message: Any) -> tuple[float, float, float]:
    pose = message.pose.pose
    turn = pose.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    assert yaw is not None
    return pose.position.x, pose.position.y, yaw


def close(x: float, y: float, theta: float) -> Any:
    """Compare a pose on the map with one of the plant."""
    place = on_map(x, y)
    return pytest.approx((place["x"], place["y"], remainder(theta + pi / 2, tau)), abs=0.3)


async def test_goals_are_sent_in_map_and_poses_returned_in_plant_coordinates(bench: Bench) -> None:
    poses = poses_on_map(bench)
    with bench.simulator(start=on_map(0.0, 0.0)):
        async with bench.agent(map_transforms={"hall": TRANSFORM}) as fleet:
            first = await fleet.state(ready)
            assert first["mobileRobotPosition"]["x"] == pytest.approx(0.0, abs=0.1)
            assert first["mobileRobotPosition"]["theta"] == pytest.approx(0.0, abs=0.1)
            fleet.send(order("n0", "n1"))
            done = await fleet.state(ended("o1"))
    assert read_pose(poses.messages[-1])[:2] == pytest.approx((20.0, 20.0), abs=0.8)
    assert error_types(done) == []
    position = done["mobileRobotPosition"]
    assert (position["x"], position["y"]) == pytest.approx((10.0, 0.0), abs=0.5)
    assert position["mapId"] == "hall"
    shown = map(json.loads, bench.mqtt.payloads(bench.fleet.topic(Topic.VISUALIZATION)))
    ways = [each["intermediatePath"]["polyline"] for each in shown if each.get("intermediatePath")]
    assert (ways[0][-1]["x"], ways[0][-1]["y"]) == pytest.approx((10.0, 0.0), abs=0.6)


async def test_initial_position_is_sent_and_confirmed_in_map_coordinates(bench: Bench) -> None:
    poses = poses_on_map(bench)
    with bench.simulator(start=on_map(0.0, 0.0), localisation={"known_at_start": False}):
        async with bench.agent(map_transforms={"hall": TRANSFORM}) as fleet:
            await fleet.state()
            pose: dict[str, Any] = {"x": 1.0, "y": 2.0, "theta": -2.0, "mapId": "hall", "lastNodeId": ""}
            fleet.instant(action("p1", action_type="initializePosition", **pose))
            done = await fleet.state(lambda state: instant_status(state, "p1") == "FINISHED")
        assert read_pose(poses.wait_for()) == close(1.0, 2.0, -2.0)  # as long as there is who says it
    position = done["mobileRobotPosition"]
    assert (position["x"], position["y"], position["theta"]) == pytest.approx((1.0, 2.0, -2.0), abs=0.2)


def instant_status(state: dict[str, Any], action_id: str) -> str | None:
    found = (each["actionStatus"] for each in state["instantActionStates"] if each["actionId"] == action_id)
    return next(found, None)


@asynccontextmanager
async def driven_by_hosts(bench: Bench, fleet: Fleet, **agent: Any) -> AsyncIterator[httpx.AsyncClient]:
    """Run an order service with the sample plant on its own map, and a robot."""
    model = read(sample_plant_path().read_bytes()).model
    plant = fleet.folder / "plant.json"
    properties = {**model.properties, f"nena:mapTransform.{HALL}": TRANSFORM}
    plant.write_text(model.model_copy(update={"properties": properties}).to_json())
    robot = {"manufacturer": "NeNa", "serial_number": "robot-01", "map_id": HALL}
    with bench.simulator(start=on_map(3.0, 2.0)):
        async with (
            running_agent(bench.settings(**{**robot, **agent})),
            running(fleet.settings(plant=plant)) as client,
        ):
            await vehicle_idle(client)
            yield client


@pytest.mark.parametrize(
    "transforms",
    [pytest.param({}, marks=pytest.mark.long), {HALL: TRANSFORM}],
    ids=["fleet control", "the robot itself"],
)
async def test_coordinates_are_transformed_once_by_either_side(
    bench: Bench, broker: Broker, interface_name: str, tmp_path: Path, transforms: dict[str, str]
) -> None:
    poses = poses_on_map(bench)
    fleet = Fleet(broker, interface_name, tmp_path)
    async with driven_by_hosts(bench, fleet, map_transforms=transforms) as client:

        async def vehicle() -> Any:
            return (await client.get("/v1/vehicles/Robot-01")).json()

        at_start = await awaited(
            vehicle, lambda found: found.get("precisePosition"), seconds=PATIENCE, what="a position"
        )
        assert at_start["currentPosition"] == "South 1"
        assert at_start["precisePosition"]["x"] == pytest.approx(3.0, abs=0.1)

        body = {"coordinate": {"x": 6.0, "y": 2.0, "theta": pi / 2}}
        name = (await client.post("/v1/vehicles/Robot-01/dispatch", json=body)).json()["name"]
        await order_in(client, name, "FINISHED", "FAILED")
        assert (await client.get(f"/v1/transportOrders/{name}")).json()["state"] == "FINISHED"
        at_goal = pytest.approx((16.0, 12.0, pi), abs=0.8)
        await until(
            lambda: (*read_pose(poses.messages[-1])[:2], abs(read_pose(poses.messages[-1])[2])) == at_goal
        )
        there = (await vehicle())["precisePosition"]
        assert (there["x"], there["y"], there["theta"]) == pytest.approx((6.0, 2.0, pi / 2), abs=0.4)

        pose = {"actionType": "initializePosition", "pose": {"x": 8.0, "y": 3.0, "theta": -1.5}}
        answer = (await client.post("/v1/vehicles/Robot-01/instantActions", json=pose)).json()
        assert answer["status"] == "FINISHED"
        await until(lambda: read_pose(poses.messages[-1]) == close(8.0, 3.0, -1.5), what="the pose")
