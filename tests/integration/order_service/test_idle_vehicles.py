"""A loopback robot that has nothing to do, over a real broker: it parks, recharges, and is called away."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from nena_order_service.dispatching.settings import (
    DispatchSettings,
    EnergySettings,
    ParkingSettings,
    RechargingSettings,
)
from nena_order_service.engine.context import EngineSettings
from support.order_service_fleet import Fleet, order_in
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]

CHARGES = """
[[operations]]
action_type = "startCharging"
seconds = 0.1
charging = true
"""
"""What is added to the robot's settings."""

SETTINGS = EngineSettings(
    dispatch=DispatchSettings(
        energy=EnergySettings(until_fully_recharged=False),
        recharging=RechargingSettings(enabled=True),
        parking=ParkingSettings(enabled=True, delay=0.0),
    )
)


def robot(fleet: Fleet) -> None:
    content = fleet.agent_file()
    content = content.replace("[loopback]", "[loopback]\ncontrol = true\ncharge_rate = 0.01")
    fleet.agent_of(content.replace("[mqtt]", "[interval]\nstate_maximum = 0.5\n[mqtt]") + CHARGES)


async def vehicle(
    client: httpx.AsyncClient, what: str, accept: Callable[[dict[str, Any]], bool]
) -> dict[str, Any]:
    async def look() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get("/v1/vehicles/Robot-01")).json()
        return found

    return await awaited(look, accept, seconds=PATIENCE, what=what)


async def orders(client: httpx.AsyncClient, kind: str) -> list[dict[str, Any]]:
    found = (await client.get("/v1/transportOrders")).json()["transportOrders"]
    return [order for order in found if order["type"] == kind]


async def ended(client: httpx.AsyncClient, kind: str) -> list[dict[str, Any]]:
    """Return the ended orders of a kind: vehicles are shown as they are, orders as they are stored."""

    def finished(found: list[dict[str, Any]]) -> bool:
        return bool(found) and all(each["state"] == "FINISHED" for each in found)

    return await awaited(lambda: orders(client, kind), finished, seconds=PATIENCE, what=f"the end of {kind}")


async def test_an_idle_robot_parks_recharges_and_is_reassigned(fleet: Fleet, service: Start) -> None:
    client = await service(engine=SETTINGS)
    robot(fleet)

    def set_battery(percent: float) -> None:
        command = {"command": "battery", "stateOfCharge": percent}
        peer.publish(f"{fleet.interface}/loopback/NeNa/robot-01/control", json.dumps(command))

    peer = fleet.peer()
    await vehicle(
        client,
        "it parks",
        lambda each: each["currentPosition"] == "Parking bay" and not each["transportOrder"],
    )
    assert [each["dispensable"] for each in await ended(client, "Park")] == [True]

    set_battery(15)
    await vehicle(
        client, "it recharges", lambda each: each["state"] == "CHARGING" and not each["transportOrder"]
    )
    assert [each["dispensable"] for each in await ended(client, "Charge")] == [False]

    destination = {"locationName": "Goods in", "operation": "Load cargo"}
    await client.post("/v1/transportOrders", json={"name": "T-1", "destinations": [destination]})
    assert "recharging until its energy is 70 %" in (await order_in(client, "T-1", "DISPATCHABLE"))["reason"]
    asked = (await client.get("/v1/transportOrders/T-1/assignment")).json()
    reasons = {each["vehicle"]: each["reason"] for each in asked["vehicles"]}
    assert reasons["Robot-01"].startswith("recharging until")
    assert "never connected" in reasons["Robot-02"]

    set_battery(72)
    await order_in(client, "T-1", "FINISHED")
    await vehicle(client, "it parks again", lambda each: each["currentPosition"] == "Parking bay")
