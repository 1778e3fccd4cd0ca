"""An order service that starts with its disk full: it reports that to people and probes, and continues
automatically.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.programs import ENDED_WITHIN
from support.small_disk import SmallDisk, small_disk
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
ORDERS = "/v1/transportOrders"
ORDERS_LIMIT = 300


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk", megabytes=4) as made:
        yield made


@pytest.fixture
def fleet_on_it(fleet: Fleet, disk: SmallDisk) -> Fleet:
    fleet.store_url = f"sqlite:///{disk.folder}/orders.db"
    return fleet


async def killed_with_a_full_disk(fleet: Fleet, disk: SmallDisk) -> None:
    """Kill an order service during an order, with no space on its disk."""
    fleet.agent(speed=0.01)
    program = fleet.order_service("--engine.commit_timeout", 1)
    async with await program.client() as client:
        await vehicle_idle(client)
        assert (await client.post(ORDERS, json=ORDER)).status_code == 201
        await order_in(client, "TO-1", "BEING_PROCESSED")
        disk.fill()
        for number in range(ORDERS_LIMIT):
            answer = await client.post(ORDERS, json={**ORDER, "name": f"Later-{number}"})
            if answer.status_code == 503:
                assert "full" in answer.json()["detail"]
                break
            assert answer.status_code == 201
        else:
            pytest.fail(f"there was room for {ORDERS_LIMIT} orders")
    program.kill()


@pytest.mark.long
async def test_starting_with_a_full_disk_is_reported_stoppable_and_continues_with_room(
    fleet_on_it: Fleet, disk: SmallDisk
) -> None:
    await killed_with_a_full_disk(fleet_on_it, disk)
    waiting = fleet_on_it.order_service()
    async with await waiting.client():
        waiting.process.send_signal(signal.SIGTERM)
        assert waiting.process.wait(ENDED_WITHIN) == 0, waiting.log

    program = fleet_on_it.order_service()
    async with await program.client() as client:
        assert (await client.get("/healthz")).status_code == 200
        ready = await client.get("/readyz")
        assert (ready.status_code, ready.json()["role"], "full" in ready.text) == (503, "starting", True)
        refused = await client.get(ORDERS)
        assert (refused.status_code, "full" in refused.json()["detail"]) == (503, True)

        disk.clear()

        async def order() -> httpx.Response:
            return await client.get(f"{ORDERS}/TO-1")

        found = await awaited(order, lambda told: told.is_success, seconds=PATIENCE, what="it goes on")
        assert found.json()["state"] == "BEING_PROCESSED"
        assert (await client.get("/readyz")).json()["role"] == "active"


async def test_without_room_for_a_new_store_it_exits_with_the_reason(
    fleet_on_it: Fleet, disk: SmallDisk
) -> None:
    disk.fill()
    program = fleet_on_it.order_service()

    assert program.process.wait(PATIENCE) == 1
    said = [line for line in program.log.splitlines() if line.startswith("nena-order-service: ")]
    assert len(said) == 1, program.log
    assert "store.url" in said[0]
    assert "Check the disk and its free space" in said[0]
