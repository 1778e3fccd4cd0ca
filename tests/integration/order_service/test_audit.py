"""The audit trail of a real order service with users and a broker, and what `nena audit` finds in it."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from collections.abc import Awaitable, Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner, Result

from nena_cli.__main__ import app
from nena_demo.plants import sample_plant_path
from nena_shared.fleet_api.base import Role
from nena_shared.web.users import User, hash_of, write_users
from support.broker import free_port
from support.order_service_fleet import Fleet
from support.waiting import awaited

pytestmark = pytest.mark.broker

ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
Start = Callable[..., Awaitable[httpx.AsyncClient]]


def as_(user: str) -> dict[str, str]:
    return {"authorization": f"Bearer {user}"}


async def nena(client: httpx.AsyncClient, *arguments: str) -> Result:
    command = ["audit", *arguments, "--url", str(client.base_url), "--token", "ADMIN"]
    return await asyncio.to_thread(lambda: CliRunner().invoke(app, command))


async def rows(client: httpx.AsyncClient, number: int) -> list[dict[str, Any]]:
    """Return all rows, the newest first, when there are this many."""

    async def read() -> list[dict[str, Any]]:
        answer = await client.get("/v1/audit", headers=as_("ADMIN"))
        found: list[dict[str, Any]] = answer.json()["entries"]
        return found

    return await awaited(read, lambda found: len(found) >= number, what=f"{number} rows")


async def test_changes_of_users_and_hosts_are_recorded_and_verified(
    service: Start, fleet: Fleet, tmp_path: Path
) -> None:
    users = tmp_path / "users.toml"
    known = [User(name=each.name, role=each, token_sha256=hash_of(each.name)) for each in Role]
    write_users(users, known)
    client = await service(http={"port": free_port(), "users": users})
    await client.post("/v1/transportOrders", json=ORDER, headers=as_("OPERATOR"))
    refused = await client.put("/v1/paths/none/lock", json={"locked": True}, headers=as_("ADMIN"))
    assert refused.status_code == 404
    for role in ("VIEWER", "OPERATOR"):
        assert (await client.get("/v1/audit", headers=as_(role))).status_code == 403

    topics = f"{fleet.prefix}/hosts/wms"
    host = fleet.peer(f"{topics}/#")
    host.publish(f"{topics}/transportOrders/create", json.dumps({**ORDER, "name": "TO-2"}))
    await host.wait_for(f"{topics}/transportOrders/answer")
    host.publish(f"{topics}/commands/withdraw", json.dumps({"transportOrder": "TO-2"}))
    await host.wait_for(f"{topics}/commands/withdraw/answer")

    found = await rows(client, 4)
    assert [(each["user"], each["interface"], each["operation"], each["result"]) for each in found[::-1]] == [
        ("OPERATOR", "REST", "createTransportOrder", "DONE"),
        ("ADMIN", "REST", "lockPath", "REFUSED"),
        ("wms", "MQTT", "createTransportOrder", "DONE"),
        ("wms", "MQTT", "withdraw", "DONE"),
    ]
    assert (await nena(client, "verify")).exit_code == 0
    listed = await nena(client, "list", "--user", "wms", "--json")
    lines = [
        line for line in listed.stdout.splitlines() if line.startswith("{")
    ]  # others: this process's log
    assert [json.loads(line)["object"] for line in lines] == ["TO-2", "TO-2"]

    with closing(sqlite3.connect(tmp_path / "orders.db")) as store, store:
        store.execute("UPDATE audit SET user_name = 'somebody else' WHERE sequence = 3")
    tampered = await nena(client, "verify")
    assert tampered.exit_code == 1
    assert "row 3 (createTransportOrder by somebody else" in tampered.output


async def test_plant_model_is_recorded_and_the_chain_goes_on(service: Start) -> None:
    client = await service()
    model = sample_plant_path().read_bytes()
    checked = await client.put("/v1/plantModel", content=model, params={"check": True})
    assert checked.status_code == 200
    document = (await client.get("/v1/plantModel")).json()
    document["paths"][0]["locked"] = True
    assert (await client.put("/v1/plantModel", json=document)).status_code == 200
    assert (await client.put("/v1/plantModel", content=b"<model/>")).status_code == 422
    assert (await client.post("/v1/transportOrders", json=ORDER)).status_code == 201

    created, wrong, changed = await rows(client, 3)
    assert (changed["operation"], changed["object"]) == ("changePlantModel", "Sample hall")
    assert json.loads(changed["request"]).keys() == {"bytes", "sha256"}
    assert json.loads(changed["before"]) == json.loads(changed["after"])
    assert (wrong["result"], wrong["reason"].partition(":")[0]) == ("REFUSED", "INVALID_PLANT")
    assert (created["sequence"], created["object"]) == (3, "TO-1")
    assert (await nena(client, "verify")).exit_code == 0
