"""Who may do what at a real order service: over TLS, by token, each refusal shown."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Awaitable, Callable
from pathlib import Path

import httpx
import pytest

from nena_order_service.app import serve
from nena_shared.fleet_api.base import Role
from nena_shared.settings import ConfigurationError
from nena_shared.web.users import User, hash_of, read_users, write_users
from support.broker import free_port
from support.certificates import Authority
from support.order_service_fleet import Fleet, running
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker

ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
Start = Callable[..., Awaitable[httpx.AsyncClient]]


def users_in(folder: Path) -> Path:
    file = folder / "users.toml"
    write_users(file, [User(name=each.name, role=each, token_sha256=hash_of(each.name)) for each in Role])
    return file


def as_(role: str) -> dict[str, str]:
    return {"authorization": f"Bearer {role}"}


@pytest.fixture
async def client(service: Start, tmp_path: Path) -> httpx.AsyncClient:
    return await service(http={"port": free_port(), "users": users_in(tmp_path)})


async def test_a_viewer_reads_orders_and_creates_none(client: httpx.AsyncClient) -> None:
    refused = await client.post("/v1/transportOrders", json=ORDER, headers=as_("VIEWER"))
    assert refused.status_code == 403
    assert refused.json()["detail"] == "VIEWER is viewer; this requires the role operator."

    shown = await client.get("/v1/transportOrders", headers=as_("VIEWER"))
    assert (shown.status_code, shown.json()["transportOrders"]) == (200, [])


async def test_a_viewer_cannot_withdraw_what_an_operator_has_ordered(client: httpx.AsyncClient) -> None:
    made = await client.post("/v1/transportOrders", json=ORDER, headers=as_("OPERATOR"))
    assert made.status_code == 201, made.text

    path = "/v1/transportOrders/TO-1/withdrawal"
    assert (await client.post(path, json={}, headers=as_("VIEWER"))).status_code == 403
    order = (await client.get("/v1/transportOrders/TO-1", headers=as_("VIEWER"))).json()
    assert order["state"] == made.json()["state"]

    assert (await client.post(path, json={}, headers=as_("OPERATOR"))).status_code == 200


@pytest.mark.parametrize("headers", [{}, as_("NOBODY"), {"authorization": "Basic T1BFUkFUT1I="}])
async def test_other_clients_receive_nothing(client: httpx.AsyncClient, headers: dict[str, str]) -> None:
    for method, path in (("GET", "/v1/vehicles"), ("POST", "/v1/transportOrders"), ("GET", "/openapi.json")):
        assert (await client.request(method, path, headers=headers)).status_code == 401

    assert (await client.get("/healthz", headers=headers)).status_code == 200


async def test_removed_listeners_receive_no_events(service: Start, tmp_path: Path) -> None:
    users = users_in(tmp_path)
    client = await service(http={"port": free_port(), "users": users})
    async with client.stream("GET", "/v1/events", headers=as_("VIEWER")) as answer:
        lines = answer.aiter_lines()
        async for line in lines:
            if line == "event: synced":
                break
        write_users(users, [each for each in read_users(users) if each.role is not Role.VIEWER])

        async with asyncio.timeout(PATIENCE):
            rest = [line async for line in lines]

    assert "event: heartbeat" not in rest
    assert (await client.get("/v1/vehicles", headers=as_("OPERATOR"))).status_code == 200


async def test_tls_hides_tokens_in_transit(fleet: Fleet, tmp_path: Path) -> None:
    authority, port = Authority(tmp_path), free_port()
    files = authority.sign("order-service")
    tls = {"tls_certificate": files.certificate, "tls_key": files.key}
    settings = fleet.settings(http={"port": port, "users": users_in(tmp_path), **tls})
    trusting = ssl.create_default_context(cafile=authority.ca)
    async with running(settings, trust=trusting) as client:
        assert (await client.get("/v1/vehicles", headers=as_("VIEWER"))).status_code == 200
        async with httpx.AsyncClient(base_url=client.base_url, timeout=PATIENCE) as other:
            with pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
                await other.get("/v1/vehicles")


@pytest.mark.parametrize(
    ("http", "complaint"),
    [
        ({}, "without TLS"),
        ({"reverse_proxy": True}, "without a login"),
        ({"users": "none.toml"}, "No such file"),
    ],
)
async def test_an_unprotected_api_does_not_start_on_public_interfaces(
    fleet: Fleet, http: dict[str, object], complaint: str
) -> None:
    settings = fleet.settings(http={"host": "0.0.0.0", "port": 0, **http})
    with pytest.raises(ConfigurationError, match=complaint):
        await asyncio.wait_for(serve(settings, asyncio.Event()), PATIENCE)
