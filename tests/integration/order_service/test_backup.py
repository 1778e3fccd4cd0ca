"""Back up, destroy, restore, continue: by docs/operations.md, during work, on both kinds of store."""

from __future__ import annotations

import json
import os
import runpy
import sqlite3
import stat
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_shared.mqtt import Inbound
from support.aggregator_process import AggregatorProcess
from support.broker import free_port
from support.keepers import Keeper
from support.order_service_fleet import Fleet, actions_done, every_order_ended
from support.order_service_work import (
    ended,
    every_order_finished_once,
    finished,
    in_mid_work,
    order,
    orders_of,
    started,
)
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e, pytest.mark.timeout(900)]

ROOT = Path(__file__).parents[3]
ORDERS = tuple(f"T-{number}" for number in range(6))


@pytest.mark.parametrize("keeper", ["sqlite"], indirect=True)
async def test_a_planned_move_in_mid_work_loses_nothing(fleet: Fleet, keeper: Keeper) -> None:
    wire = fleet.peer()
    program, _ = await in_mid_work(fleet, ORDERS)

    ended(program)
    keeper.back_up()
    keeper.destroy()
    keeper.restore()

    await every_order_finished_once(fleet, wire, ORDERS)


async def test_after_a_loss_the_site_continues_from_its_last_backup(fleet: Fleet, keeper: Keeper) -> None:
    wire = fleet.peer()
    names = ("--interface_name", fleet.interface, "--interface_name_v3", fleet.interface)
    options = (*names, "--topic_prefix", fleet.prefix, "--mqtt.port", str(fleet.broker.port))
    with AggregatorProcess(*options, "--http.port", "0") as aggregator:
        panel = httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE)
        program, client = await in_mid_work(fleet, ORDERS)
        keeper.back_up()
        for name in ("L-0", "L-1"):
            assert await order(client, name) == 201
        await finished(client, 3)
        program.kill()
        keeper.destroy()

        keeper.restore()
        seen = await robots_stand(panel)

    # without the broker no robot moves: what has gone on since the backup is withdrawn
    apart = fleet.order_service("--mqtt.port", free_port(), name="apart")
    client = await started(apart)
    stored = await orders_of(client)
    assert stored.keys() == set(ORDERS)
    moved = [name for name, each in stored.items() if seen[name]["version"] != each["version"]]
    assert moved, "nothing has gone on since the backup: it showed nothing"
    for name in moved:
        if not stored[name]["finished"]:
            answer = await client.post(f"/v1/transportOrders/{name}/withdrawal", json={"reason": "restored"})
            assert answer.is_success, answer.text
    ended(apart)

    client = await started(fleet.order_service())
    await robots_are_free_of_what_nobody_knows(
        client, lambda: wire.received(f"{fleet.interface}/v2/+/+/state")
    )
    done = {name for name, each in seen.items() if each["state"] == "FINISHED"}
    begun = {name for name, each in seen.items() if each["processingVehicle"]} - done
    for name in ("L-0", "L-1"):
        if name not in done | begun:
            assert await order(client, name) == 201
    for name in begun & {*moved, "L-0", "L-1"}:
        assert await order(client, f"{name}-again") == 201
    orders = {each["name"]: each for each in await every_order_ended(client)}
    done |= {name for name, each in orders.items() if each["state"] == "FINISHED"}
    missing = {name for name in (*ORDERS, "L-0", "L-1") if not {name, f"{name}-again"} & done}
    assert missing == set(), {name: orders.get(name) for name in missing}
    assert {name: times for name, times in actions_done(wire, fleet).items() if times > 1} == {}


async def robots_are_free_of_what_nobody_knows(
    client: httpx.AsyncClient, states: Callable[[], list[Inbound]]
) -> None:
    """Cancel the robots' orders that the store does not know: they would wait for updates for ever.

    A robot that has not reported yet may have an unknown order even if the store has an order for it.
    """

    async def look() -> dict[str, str]:
        found = (await client.get("/v1/vehicles")).json()["vehicles"]
        held = held_orders(states())
        busy: dict[str, str] = {}
        for each in found:
            name, order_id = each["name"], held.get(each["serialNumber"], "")
            if each["state"] == "UNKNOWN":
                busy[name] = "UNKNOWN"
            elif order_id and not order_id.startswith(f"{each['transportOrder']}-"):
                busy[name] = order_id
                await client.post(f"/v1/vehicles/{name}/instantActions", json={"actionType": "cancelOrder"})
        return busy

    await awaited(
        look,
        lambda busy: not busy,
        seconds=PATIENCE,
        what="no robot is at an order that the store does not know",
    )


def held_orders(states: Iterable[Inbound]) -> dict[str, str]:
    """Return the orders that robots have and have not come to the end of, by serial number."""
    last = map(json.loads, {each.topic: each.payload for each in states}.values())
    return {each["serialNumber"]: each["orderId"] for each in last if each["nodeStates"]}


async def robots_stand(panel: httpx.AsyncClient) -> dict[str, dict[str, Any]]:
    """Wait until each robot is at the end of its base; return the last statuses of the orders."""

    async def look() -> list[dict[str, Any]]:
        robots: list[dict[str, Any]] = (await panel.get("/api/v1/fleet")).json()["robots"]
        return [each for each in robots if each["driving"]]

    await awaited(look, lambda driving: not driving, seconds=PATIENCE, what="every robot stands")
    return {each["name"]: each for each in (await panel.get("/api/v1/orders")).json()}


def test_a_copy_is_private_to_its_owner_even_while_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, copy = tmp_path / "orders.db", tmp_path / "copy.db"
    sqlite3.connect(source).execute("CREATE TABLE orders (name TEXT)").connection.close()
    source.chmod(0o644)
    modes: set[int] = set()
    connect = sqlite3.connect

    def looked_at(*place: Any, **how: Any) -> Any:
        modes.update(stat.S_IMODE(each.stat().st_mode) for each in tmp_path.iterdir() if each != source)
        return connect(*place, **how)

    before = os.umask(0)
    monkeypatch.setattr(sqlite3, "connect", looked_at)
    monkeypatch.setattr(sys, "argv", ["backup", str(source), str(copy)])
    try:
        assert runpy.run_path(str(ROOT / "deploy" / "backup"))["main"]() == ""
    finally:
        os.umask(before)
    assert modes | {stat.S_IMODE(copy.stat().st_mode)} == {0o600}


def test_a_failed_copy_keeps_the_older_one(tmp_path: Path) -> None:
    (tmp_path / "orders.db").write_bytes(b"no database at all" * 100)
    (tmp_path / "copy.db").write_bytes(b"of yesterday")

    command = [sys.executable, str(ROOT / "deploy" / "backup"), "orders.db", "copy.db"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=False
    )

    assert done.returncode == 1
    assert "orders.db was not copied: file is not a database" in done.stderr
    assert {each.name: each.read_bytes()[:2] for each in tmp_path.iterdir()} == {
        "orders.db": b"no",
        "copy.db": b"of",
    }
