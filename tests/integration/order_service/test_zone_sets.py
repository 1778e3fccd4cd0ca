"""Zone sets from the order service to robots of 3.0, over a real broker."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from support.order_service_fleet import Fleet, running, vehicle_idle
from support.waiting import awaited

pytestmark = [pytest.mark.broker, pytest.mark.clause("6.4/fleet", "7.6")]

Start = Callable[..., Awaitable[httpx.AsyncClient]]
URL = "/v1/zoneSets"


def zones(name: str, **fields: Any) -> dict[str, Any]:
    corners = [{"x": x, "y": y} for x, y in ((30, 30), (31, 30), (31, 31), (30, 31))]
    zone = {"zoneId": "z", "zoneType": "BLOCKED", "vertices": corners, **fields}
    return {"mapId": "sample-hall", "zoneSetId": name, "zones": [zone]}


async def stands(client: httpx.AsyncClient, name: str, vehicle: str, phase: str) -> dict[str, Any]:
    async def look() -> dict[str, Any]:
        found = (await client.get(f"{URL}/{name}")).json()["vehicles"]
        return next((each for each in found if each["vehicle"] == vehicle), {})

    return await awaited(look, lambda at: at.get("phase") == phase, what=f"{name} {phase} at {vehicle}")


async def test_zone_sets_are_sent_enabled_and_deleted_on_3_0_robots(fleet: Fleet) -> None:
    async with running(fleet.settings()) as client:
        fleet.agent("robot-01", version="3.0.0")
        await vehicle_idle(client)
        answer = await client.post(URL, json=zones("day"))
        assert (answer.status_code, answer.json()["zones"]) == (200, 1), answer.text
        await stands(client, "day", "Robot-01", "DISABLED")
        assert (await client.post(f"{URL}/day/enable")).json()["enabled"] is True
        await stands(client, "day", "Robot-01", "ENABLED")
        assert (await client.post(URL, json=zones("night"))).status_code == 200
        assert (await client.post(f"{URL}/night/enable")).status_code == 200
        await stands(client, "night", "Robot-01", "ENABLED")
        assert (await client.delete(f"{URL}/day")).json()["deleted"] is True
        await stands(client, "day", "Robot-01", "MISSING")
    fleet.agent("robot-02", x=3.0, y=12.0, version="3.0.0")
    async with running(fleet.settings()) as client:
        await stands(client, "night", "Robot-02", "ENABLED")
        await stands(client, "day", "Robot-02", "MISSING")


async def test_invalid_zone_set_requests_are_refused(fleet: Fleet, service: Start) -> None:
    client = await service()
    assert (await client.post(URL, json=zones("day"))).status_code == 200
    assert (await client.post(URL, json=zones("day"))).status_code == 200
    changed = await client.post(URL, json=zones("day", zoneType="RELEASE"))
    assert (changed.status_code, "never changes" in changed.json()["detail"]) == (409, True)
    assert (await client.post(URL, json=zones("slow", zoneType="SPEED_LIMIT"))).status_code == 422
    assert (await client.get(f"{URL}/other")).status_code == 404
    assert [each["zoneSetId"] for each in (await client.get(URL)).json()["zoneSets"]] == ["day"]
    fleet.agent("robot-01", version="2.1.0")
    await vehicle_idle(client)
    assert "Robot-01" not in str((await client.get(URL)).json())
