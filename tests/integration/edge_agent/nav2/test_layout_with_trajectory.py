"""A layout with a trajectory (LIF 2.0), a host's order over it, and the path of Nav2's controller."""

from __future__ import annotations

from math import dist
from pathlib import Path
from typing import Any

import pytest

from nena_order_service.settings import OrderServiceSettings
from nena_plant_formats import files
from nena_shared.plant import Vehicle
from nena_shared.plant import property_keys as keys
from support.action_types import needs_action_types
from support.broker import Broker, free_port
from support.edge_agent import MANUFACTURER, SERIAL
from support.lif_files import lif_2_0_of, robot_edge, robot_node
from support.nav2_agent import Bench, ready
from support.order_service_fleet import order_in, running

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_action_types]

BEND = {
    "degree": 2,
    "knotVector": [0, 0, 0, 1, 1, 1],
    "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 6.0, "y": 0.0}, {"x": 6.0, "y": 6.0}],
}
CURVE = [(12.0 * t - 6.0 * t * t, 6.0 * t * t) for t in (i / 300 for i in range(301))]


def plant_in(folder: Path, interface_name: str) -> Path:
    """Write the layout as a plant model with the robot, as after ``nena plant import``."""
    nodes = [
        robot_node(name, *place) | {"mapId": "hall"} for name, place in (("A", (0.0, 0.0)), ("B", (6.0, 6.0)))
    ]
    report = files.read(lif_2_0_of(*nodes, robot_edge("A B", trajectory=BEND)))
    properties = {
        keys.VDA5050_INTERFACE_NAME: interface_name,
        keys.VDA5050_MANUFACTURER: MANUFACTURER,
        keys.VDA5050_SERIAL_NUMBER: SERIAL,
        keys.VDA5050_VERSION: "2.1",
        keys.VDA5050_MAP_ID: "hall",
    }
    robot = Vehicle(name="Robot", max_velocity_mm_s=4000, properties=properties)
    file = folder / "plant.json"
    file.write_text(report.model.model_copy(update={"vehicles": (robot,)}).model_dump_json())
    return file


async def test_trajectory_of_a_layout_is_sent_to_the_controller(
    bench: Bench, broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    fields: dict[str, Any] = {
        "plant": plant_in(tmp_path, interface_name),
        "store": {"url": f"sqlite:///{tmp_path}/orders.db"},
        "mqtt": broker.settings,
        "interface_name": interface_name,
        "interface_name_v3": interface_name,
        "topic_prefix": f"{interface_name}/hosts",
        "http": {"port": free_port()},
    }
    ros = {"nav2": {"follow_path": True}, "call_timeout": 1.0}
    settings = OrderServiceSettings.model_validate(fields)
    async with running(settings) as host, bench.robot(time_factor=2.0, ros=ros) as fleet:
        await fleet.state(ready)
        wanted = {"name": "T", "destinations": [{"locationName": "B"}], "intendedVehicle": "Robot"}
        created = await host.post("/v1/transportOrders", json=wanted)
        assert created.is_success, created.text
        order = await order_in(host, "T", "FINISHED", "FAILED", "UNROUTABLE")
        states = [*fleet.states]
    assert order["state"] == "FINISHED", order
    shown = next(each for each in states if each["edgeStates"])
    assert shown["edgeStates"][0]["trajectory"]["degree"] == 2
    errors = [each for state in states if state["orderId"] for each in state["errors"]]
    # a busy machine: the order came before navigation had reported, which the robot says until then
    assert [each for each in errors if "the agent is starting" not in each["errorDescription"]] == []
    driven = [(each.pose.pose.position.x, each.pose.pose.position.y) for each in bench.odometry]
    assert max(min(dist(place, each) for each in CURVE) for place in driven) < 0.3
    assert dist(driven[-1], (6.0, 6.0)) < 0.4
