"""A real order service and an issuer on loopback in place of Keycloak and the like."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_shared.clock import SystemClock
from nena_shared.fleet_api.base import Role
from nena_shared.web.server_sent_events import HEARTBEAT
from nena_shared.web.users import User, hash_of, write_users
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.settings import (
    AggregatorHttpSettings,
    AggregatorSettings,
    HistorySettings,
    OrderServiceSettings,
    PanelOidcSettings,
)
from support.broker import free_port
from support.oidc_issuer import AUDIENCE, DISCOVERY, OidcIssuer, ec_key
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker

ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
ORDERS = "/v1/transportOrders"
Start = Callable[..., Awaitable[httpx.AsyncClient]]


def http_of(issuer: OidcIssuer, **more: Any) -> dict[str, Any]:
    return {"port": free_port(), "oidc": {"issuer": issuer.address, "audience": AUDIENCE, **more}}


def as_(token: str) -> dict[str, str]:
    return {"authorization": f"Bearer {token}"}


async def test_issuer_roles_are_mapped(service: Start, issuer: OidcIssuer) -> None:
    client = await service(http=http_of(issuer))
    assert (await client.get(ORDERS)).status_code == 401

    refused = await client.post(ORDERS, json=ORDER, headers=as_(issuer.token("vic")))
    assert (refused.status_code, "requires the role operator" in refused.json()["detail"]) == (403, True)
    made = await client.post(ORDERS, json=ORDER, headers=as_(issuer.token("ann")))
    assert made.status_code == 201, made.text
    plant = await client.put("/v1/plantModel", json={}, headers=as_(issuer.token("ann")))
    assert (plant.status_code, "requires the role admin" in plant.json()["detail"]) == (403, True)
    shown = await client.get(ORDERS, headers=as_(issuer.token("vic")))
    assert [each["name"] for each in shown.json()["transportOrders"]] == ["TO-1"]


async def test_a_hosts_key_of_opentcs_may_be_a_token_too(service: Start, issuer: OidcIssuer) -> None:
    client = await service(http=http_of(issuer))
    answer = await client.get("/opentcs/v1/vehicles", headers={"X-Api-Access-Key": issuer.token("vic")})

    assert answer.status_code == 200


@pytest.mark.parametrize(
    ("claims", "reason"),
    [
        ({"iss": "https://evil.example"}, "another issuer"),
        ({"aud": "nena-panel"}, "another audience"),
        ({"exp": 1}, "expired"),
        ({"nbf": 9_999_999_999}, "not valid yet"),
    ],
)
async def test_an_invalid_token_creates_no_order(
    service: Start, issuer: OidcIssuer, claims: dict[str, Any], reason: str
) -> None:
    client = await service(http=http_of(issuer))
    answer = await client.post(ORDERS, json=ORDER, headers=as_(issuer.token("ann", **claims)))

    assert (answer.status_code, reason in answer.json()["detail"]) == (401, True), answer.text
    assert (await client.get(ORDERS, headers=as_(issuer.token("vic")))).json()["transportOrders"] == []


async def test_custom_tables_and_changing_keys(service: Start, issuer: OidcIssuer) -> None:
    table = {"roles_claim": "realm_access.roles", "roles": {"driver": "operator"}}
    client = await service(http=http_of(issuer, **table))
    claims: dict[str, Any] = {"realm_access": {"roles": ["driver"]}, "roles": ["nena-admin"]}
    first = await client.post(ORDERS, json=ORDER, headers=as_(issuer.token("ann", **claims)))
    assert first.status_code == 201, first.text

    issuer.keys = [ec_key("next")]
    again = {**ORDER, "name": "TO-2"}
    second = await client.post(ORDERS, json=again, headers=as_(issuer.token("ann", **claims)))
    assert second.status_code == 201, second.text
    without = await client.get(ORDERS, headers=as_(issuer.token("ann")))
    assert (without.status_code, "driver" in without.json()["detail"]) == (403, True)


async def test_without_its_issuer_it_starts_and_serves_its_own_users(
    service: Start, issuer: OidcIssuer, tmp_path: Path
) -> None:
    issuer.broken[DISCOVERY] = b"gone"
    users = tmp_path / "users.toml"
    write_users(users, [User(name="host", role=Role.OPERATOR, token_sha256=hash_of("its own"))])
    client = await service(http={**http_of(issuer), "users": users})

    away = await client.get(ORDERS, headers=as_(issuer.token("ann")))
    assert (away.status_code, "issuer is unavailable" in away.json()["detail"]) == (503, True)
    assert (await client.post(ORDERS, json=ORDER, headers=as_("its own"))).status_code == 201
    assert (await client.get("/readyz")).status_code == 200
    issuer.broken.clear()
    assert (await client.get(ORDERS, headers=as_(issuer.token("ann")))).status_code == 200


async def test_a_hold_by_a_person_names_them(service: Start, issuer: OidcIssuer) -> None:
    client = await service(http=http_of(issuer))
    await client.post(ORDERS, json=ORDER, headers=as_(issuer.token("ann")))
    held = await client.post(f"{ORDERS}/TO-1/hold", headers=as_(issuer.token("ann")))

    assert held.json()["held"]["by"] == "ann (subject id-of-ann)"


async def test_an_event_stream_ends_with_the_token(service: Start, issuer: OidcIssuer) -> None:
    """The token has just ended: as clocks may differ it counts for a little while still."""
    client = await service(http=http_of(issuer, leeway=HEARTBEAT))
    ended = issuer.token("vic", exp=int(time.time()))
    async with client.stream("GET", "/v1/events", headers=as_(ended)) as answer:
        assert answer.status_code == 200
        async with asyncio.timeout(PATIENCE):
            lines = [line async for line in answer.aiter_lines()]

    assert "event: heartbeat" not in lines


async def test_commands_of_the_panel_carry_its_users_name(service: Start, issuer: OidcIssuer) -> None:
    client = await service(http=http_of(issuer))
    oidc = PanelOidcSettings(issuer=issuer.address, audience=AUDIENCE)
    http = AggregatorHttpSettings(port=0, oidc=oidc)
    aggregator = Aggregator(AggregatorSettings(history=HistorySettings(url=None), http=http), SystemClock())
    door = OrderServiceSettings.model_validate({"url": str(client.base_url)})
    transport = httpx.ASGITransport(make_app(aggregator, http, door))
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8080") as panel:
        for name, status in (("vic", 403), ("ann", 201)):
            await panel.post("/api/v1/session", headers=as_(issuer.token(name)))
            answer = await panel.post("/api/v1/control/transportOrders", json=ORDER)
            assert answer.status_code == status, answer.text
