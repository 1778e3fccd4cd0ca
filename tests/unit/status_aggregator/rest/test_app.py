from __future__ import annotations

import httpx


async def test_files_outside_the_page_are_out_of_reach(client: httpx.AsyncClient) -> None:
    assert (await client.get("/..%2f__init__.py")).status_code == 404


async def test_the_interface_is_described(client: httpx.AsyncClient) -> None:
    described = (await client.get("/api/v1/openapi.json")).json()
    assert {
        "/api/v1/fleet",
        "/api/v1/robots/{manufacturer}/{serial}",
        "/api/v1/robots/{manufacturer}/{serial}/actions",
        "/api/v1/robots/{manufacturer}/{serial}/map",
        "/api/v1/orders",
        "/api/v1/plant",
        "/api/v1/session",
        "/api/v1/session/oidc",
        "/api/v1/control",
        "/api/v1/control/{path}",
        "/api/v1/events",
        "/healthz",
        "/api/v1/history",
        "/api/v1/history.csv",
        "/api/v1/history.jsonl",
        "/readyz",
        "/metrics",
    } == set(described["paths"])
    assert "stateAge" in described["components"]["schemas"]["RobotResource"]["properties"]
