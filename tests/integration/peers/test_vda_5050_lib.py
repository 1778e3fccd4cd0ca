"""The library vda-5050-lib (Node.js) as fleet control of the agent, and as a robot of the order service."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from support.broker import Broker
from support.edge_agent import MANUFACTURER, SERIAL, agent_settings, running_agent
from support.order_service_fleet import Fleet, order_in, running, vehicle_idle
from support.robot_core import MAP
from support.waiting import PATIENCE

MODULES = Path(os.environ.get("NENA_VDA_5050_LIB", ""))
SCRIPT = Path(__file__).parent / "node" / "peer.mjs"
Json = dict[str, Any]

pytestmark = [
    pytest.mark.skipif(
        "NENA_VDA_5050_LIB" not in os.environ, reason="needs the npm package vda-5050-lib: make peers-test"
    ),
    pytest.mark.broker,
]


@asynccontextmanager
async def peer(
    role: str, broker: Broker, interface: str, robot: tuple[str, str], content: Any
) -> AsyncIterator[Callable[[Callable[[Json], bool]], Any]]:
    """Run the library; yield what waits for an event and returns all events up to it."""
    script = shutil.copy(SCRIPT, MODULES / SCRIPT.name)
    url = f"mqtt://{broker.host}:{broker.port}"
    process = await asyncio.create_subprocess_exec(
        "node",
        script,
        role,
        url,
        interface,
        *robot,
        json.dumps(content),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert process.stdout
    assert process.stdin
    output = process.stdout

    async def until(wanted: Callable[[Json], bool]) -> list[Json]:
        events: list[Json] = []
        async with asyncio.timeout(PATIENCE):
            while not events or not wanted(events[-1]):
                line = await output.readline()
                assert line, f"it has ended after {events}"
                events.append(json.loads(line))
        return events

    try:
        yield until
    finally:
        process.stdin.close()
        await process.wait()


def order(order_id: str, *nodes: tuple[str, float], picks: bool = False) -> Json:
    pick = {"actionType": "pick", "actionId": f"{order_id}-pick", "blockingType": "HARD"}
    return {
        "orderId": order_id,
        "orderUpdateId": 0,
        "nodes": [
            {
                "nodeId": name,
                "sequenceId": 2 * number,
                "released": True,
                "nodePosition": {"x": x, "y": 0.0, "theta": 0.0, "mapId": MAP, "allowedDeviationTheta": 3.14},
                "actions": [pick] if picks and number == 1 else [],
            }
            for number, (name, x) in enumerate(nodes)
        ],
        "edges": [
            {
                "edgeId": f"{order_id}-e{number}",
                "sequenceId": 2 * number + 1,
                "released": True,
                "startNodeId": nodes[number][0],
                "endNodeId": nodes[number + 1][0],
                "actions": [],
            }
            for number in range(len(nodes) - 1)
        ],
    }


@pytest.mark.clause("6.1.1", "6.1.3", "6.2.1")
async def test_its_fleet_control_completes_and_cancels_orders(
    own_broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    settings = agent_settings(own_broker, interface_name, tmp_path, version="2.0.0")
    short = order("o1", ("n0", 0.0), ("n1", 10.0), ("n2", 20.0), picks=True)
    long = order("o2", ("n2", 20.0), ("n3", 20_000.0))
    async with (
        running_agent(settings),
        peer("master", own_broker, interface_name, (MANUFACTURER, SERIAL), [short, long]) as until,
    ):
        first = await until(lambda each: each["event"] == "processed")
        second = await until(lambda each: each["event"] == "processed")
    assert first[-1] | {"active": None} == {
        "event": "processed",
        "orderId": "o1",
        "error": None,
        "cancelled": False,
        "active": None,
    }
    assert {"event": "action", "actionId": "o1-pick", "status": "FINISHED"} in first
    assert (second[-1]["orderId"], second[-1]["error"], second[-1]["cancelled"]) == ("o2", None, True)


@pytest.mark.clause("6.1.2/confirm")
async def test_its_robot_executes_an_order(own_broker: Broker, interface_name: str, tmp_path: Path) -> None:
    start = {"mapId": "sample-hall", "x": 3.0, "y": 2.0, "theta": 0.0, "lastNodeId": "South 1"}
    robot = {"initialPosition": start, "vehicleSpeed": 5, "timeLapse": 20}
    fleet = Fleet(own_broker, interface_name, tmp_path)
    with fleet.stack:
        async with (
            running(fleet.settings()) as client,
            peer("robot", own_broker, interface_name, ("NeNa", "robot-01"), robot),
        ):
            await vehicle_idle(client)
            body = {
                "name": "T-1",
                "intendedVehicle": "Robot-01",
                "destinations": [{"locationName": "South 2", "operation": "MOVE"}],
            }
            assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
            done = await order_in(client, "T-1", "FINISHED", "FAILED")
            assert done["state"] == "FINISHED", done["reason"]
