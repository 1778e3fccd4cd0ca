"""An order can be followed through the logs of all programs by its name, and by the robot's."""

from __future__ import annotations

import json
from typing import Any

import httpx
import pytest

from support.order_service_fleet import Fleet, order_in
from support.programs import Program
from support.waiting import PATIENCE, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ORDER = {"name": "T-1", "destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}


async def line(program: Program, event: str) -> dict[str, Any]:
    """Return the first line of an event in a log of JSON, once it exists."""

    def look() -> dict[str, Any] | None:
        lines = [json.loads(each) for each in program.log.splitlines(keepends=True) if each.endswith("\n")]
        return next((each for each in lines if each["event"] == event), None)

    return await until(look, what=f"'{event}' in the log")


async def test_an_order_is_followed_through_the_logs(fleet: Fleet) -> None:
    service = fleet.order_service("--log.form", "json")
    url = (await service.logged(r'"url": "(http[^"]+)"')).group(1)
    text = fleet.agent_file(version="3.0.0")
    agent = fleet.agent_of(f'{text}[log]\nform = "json"\n')
    async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as client:
        assert (await client.post("/v1/transportOrders", json=ORDER)).is_success
        await order_in(client, "T-1", "FINISHED")

    assert (await line(service, "order created"))["order"] == "T-1"
    for event in ("order assigned", "order ended"):
        told = await line(service, event)
        assert (told["order"], told["vehicle"]) == ("T-1", "Robot-01")
    received = await line(agent, "order received")
    assert (received["order"], received["update"], received["robot"]) == ("T-1-0", 0, "NeNa/robot-01")
    assert (await line(agent, "broker connected"))["robot"] == "NeNa/robot-01", (
        "what is below the agent says it too"
    )
