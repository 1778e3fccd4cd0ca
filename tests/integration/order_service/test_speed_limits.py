"""Limits of the speed from the plant model to a robot's wheels, over a real broker."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable

import httpx
import pytest

from support.order_service_fleet import Fleet, order_in, vehicle_idle

pytestmark = [pytest.mark.broker, pytest.mark.clause("7.10")]

Start = Callable[..., Awaitable[httpx.AsyncClient]]


@pytest.mark.parametrize("version", ["2.1.0", "3.0.0"])
async def test_a_robot_that_lists_them_is_sent_the_speeds_of_paths_and_takes_them(
    fleet: Fleet, service: Start, version: str
) -> None:
    wire = fleet.peer()
    client = await service(speed_limits=True)
    fast = "[description]\nmaximum_speed = 2.0\n"
    fleet.agent_of(fleet.agent_file(x=21.0, y=12.0, speed=2.0, version=version) + fast)
    await vehicle_idle(client)

    to = {"destinations": [{"locationName": "Goods out stand"}], "name": "T-1"}
    assert (await client.post("/v1/transportOrders", json=to)).status_code == 201
    await order_in(client, "T-1", "FINISHED")

    wire.catch_up()
    (message,) = wire.received(f"{fleet.interface}/+/NeNa/robot-01/order")
    (edge,) = json.loads(message.payload)["edges"]
    assert edge["maximumSpeed" if version == "3.0.0" else "maxSpeed"] == 0.5
