"""An order service that starts with its disk full: it says so to people and probes, and goes on by itself."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.order_service_fleet import Fleet, awaited
from support.programs import ENDED_WITHIN
from support.small_disk import SmallDisk, small_disk
from support.waiting import PATIENCE

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
ORDERS = "/v1/transportOrders"


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk", megabytes=4) as made:
        yield made


@pytest.fixture
def fleet_on_it(fleet: Fleet, disk: SmallDisk) -> Fleet:
    fleet.store_url = f"sqlite:///{disk.folder}/orders.db"
    return fleet


async def killed_with_an_order_and_a_full_disk(fleet: Fleet, disk: SmallDisk) -> None:
    program = fleet.order_service()
    async with await program.client() as client:
        assert (await client.post(ORDERS, json=ORDER)).status_code == 201
    disk.fill()
    program.kill()


async def test_it_says_what_it_waits_for_and_goes_on_when_there_is_room(
    fleet_on_it: Fleet, disk: SmallDisk
) -> None:
    await killed_with_an_order_and_a_full_disk(fleet_on_it, disk)
    program = fleet_on_it.order_service()
    async with await program.client() as client:
        assert (await client.get("/healthz")).status_code == 200
        ready = await client.get("/readyz")
        assert (ready.status_code, ready.json()["role"], "full" in ready.text) == (503, "starting", True)
        refused = await client.get(ORDERS)
        assert (refused.status_code, "full" in refused.json()["detail"]) == (503, True)

        disk.clear()

        async def orders() -> list[str] | None:
            answer = await client.get(ORDERS)
            return [each["name"] for each in answer.json()["transportOrders"]] if answer.is_success else None

        found = await awaited(orders, lambda names: names is not None, seconds=PATIENCE, what="it goes on")
        assert found == ["TO-1"]
        assert (await client.get("/readyz")).json()["role"] == "active"


async def test_it_ends_in_order_while_it_waits(fleet_on_it: Fleet, disk: SmallDisk) -> None:
    await killed_with_an_order_and_a_full_disk(fleet_on_it, disk)
    program = fleet_on_it.order_service()
    async with await program.client():
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(ENDED_WITHIN) == 0, program.log


async def test_without_room_for_a_new_store_it_ends_and_says_why(fleet_on_it: Fleet, disk: SmallDisk) -> None:
    disk.fill()
    program = fleet_on_it.order_service()

    assert program.process.wait(PATIENCE) == 1
    said = [line for line in program.log.splitlines() if line.startswith("nena-order-service: ")]
    assert len(said) == 1, program.log
    assert "store.url" in said[0]
    assert "full" in said[0]
