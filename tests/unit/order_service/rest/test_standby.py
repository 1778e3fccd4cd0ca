from __future__ import annotations

import httpx
import pytest

from nena_order_service.api.server import make_standby_app
from nena_shared.fleet_api.transport_order import Problem


def client(active_url: str, problem: str = "") -> httpx.AsyncClient:
    app = make_standby_app(lambda: active_url, lambda: problem)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://standby")


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE"])
async def test_every_request_is_told_where_to_go(method: str) -> None:
    async with client("http://active.example") as standby:
        answer = await standby.request(method, "/v1/vehicles/Robot-01")
    problem = Problem.model_validate_json(answer.content)
    assert (answer.status_code, problem.status) == (503, 503)
    assert "http://active.example/v1/vehicles/Robot-01" in problem.detail
    assert answer.headers["link"] == '<http://active.example/v1/vehicles/Robot-01>; rel="alternate"'
    assert answer.headers["retry-after"] == "1"


@pytest.mark.parametrize("name", ["Auftrag%20Ж", "%3E;%20rel=%22self%22"])
async def test_a_name_is_passed_on_as_it_came(name: str) -> None:
    async with client("http://active.example") as standby:
        answer = await standby.get(f"/v1/transportOrders/{name}")
    place = f"http://active.example{answer.request.url.raw_path.decode()}"
    assert (answer.status_code, answer.headers["link"]) == (503, f'<{place}>; rel="alternate"')
    assert place in answer.json()["detail"]


async def test_where_nobody_is_known_to_be_active_it_says_so() -> None:
    async with client("", problem="connection refused") as standby:
        answer = await standby.get("/v1/vehicles")
        ready = await standby.get("/readyz")
        assert (await standby.get("/healthz")).status_code == 200
    assert "not known yet" in answer.json()["detail"]
    assert "link" not in answer.headers
    assert (ready.status_code, ready.json()["role"], ready.json()["storeReady"]) == (503, "standby", False)
    assert "connection refused" in " ".join(ready.json()["problems"])
