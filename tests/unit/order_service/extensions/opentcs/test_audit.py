"""The audit trail of openTCS's web API."""

from __future__ import annotations

import json
from typing import Any

import httpx
import pytest

from nena_order_service.extensions.opentcs.audit import BODY_LIMIT
from nena_order_service.service import OrderService
from support.opentcs_routes import FOR_ROBOT
from support.waiting import awaited

API = "/opentcs/v1"


async def rows(client: httpx.AsyncClient, number: int) -> list[dict[str, Any]]:
    """Return all rows, the newest first, when there are this many."""

    async def read() -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = (await client.get("/v1/audit")).json()["entries"]
        return found

    found = await awaited(read, lambda each: len(each) >= number, seconds=20, what="rows")
    assert len(found) == number, found
    return found


async def test_order_and_withdrawal_are_recorded(client: httpx.AsyncClient) -> None:
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    await client.post(f"{API}/transportOrders/T-1/withdrawal")
    withdrawn, created = await rows(client, 2)
    assert (created["interface"], created["operation"], created["object"]) == (
        "openTCS",
        "createTransportOrder",
        "T-1",
    )
    assert json.loads(created["request"]) == {"body": FOR_ROBOT}
    assert (withdrawn["operation"], withdrawn["result"]) == ("withdraw", "DONE")
    assert json.loads(withdrawn["before"]) != json.loads(withdrawn["after"])


async def test_completed_name_is_recorded(client: httpx.AsyncClient) -> None:
    answer = await client.post(f"{API}/transportOrders/T", json={**FOR_ROBOT, "incompleteName": True})
    (created,) = await rows(client, 1)
    assert created["object"] == answer.json()["name"] != "T"


async def test_query_and_states_are_recorded(client: httpx.AsyncClient) -> None:
    url = f"{API}/vehicles/Robot-01/integrationLevel"
    await client.put(url, params={"newValue": "TO_BE_IGNORED"})
    (found,) = await rows(client, 1)
    assert (found["operation"], found["objectKind"], found["object"]) == (
        "integrationLevel",
        "vehicle",
        "Robot-01",
    )
    assert json.loads(found["request"]) == {"query": {"newValue": "TO_BE_IGNORED"}}
    assert json.loads(found["after"]) == {"integrationLevel": "TO_BE_IGNORED"}


@pytest.mark.parametrize(
    ("method", "path", "operation", "reason"),
    [
        ("POST", "/transportOrders/none/withdrawal", "withdraw", "HTTP 404: "),
        ("PUT", "/vehicles/Robot-01/paused?newValue=true", "instantAction", "HTTP 409: "),
        (
            "PUT",
            "/vehicles/Robot-01/commAdapter/enabled?newValue=false",
            "PUT /v1/vehicles/{name}/commAdapter/enabled",
            "HTTP 400: ",
        ),
    ],
)
async def test_refused_request_is_recorded_with_the_answer(
    client: httpx.AsyncClient, method: str, path: str, operation: str, reason: str
) -> None:
    answer = await client.request(method, API + path)
    (found,) = await rows(client, 1)
    assert (found["operation"], found["result"]) == (operation, "REFUSED")
    assert found["reason"] == reason + answer.text


async def test_failed_request_is_recorded(client: httpx.AsyncClient, failing_create: str) -> None:
    assert (await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)).status_code == 500
    (found,) = await rows(client, 1)
    assert (found["result"], found["reason"]) == ("FAILED", "KeyError")
    assert failing_create not in json.dumps(found)


async def test_request_without_a_database_is_refused_as_over_rest(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    service.store.problem = "gone"
    assert (await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)).status_code == 503
    (found,) = await rows(client, 1)
    assert found["result"] == "REFUSED"


async def test_bodies_that_are_no_json_or_long_are_recorded_by_size(client: httpx.AsyncClient) -> None:
    await client.put(f"{API}/plantModel", content=b"{password")
    await client.put(f"{API}/plantModel", content=b'{"a":"' + b"x" * BODY_LIMIT + b'"}')
    long, wrong = await rows(client, 2)
    assert json.loads(wrong["request"]) == {"body": "9 bytes"}
    assert json.loads(long["request"]) == {"body": f"{BODY_LIMIT + 8} bytes"}


async def test_requests_without_effect_are_not_recorded(client: httpx.AsyncClient) -> None:
    await client.get(f"{API}/vehicles")
    await client.post(f"{API}/dispatcher/trigger")
    await client.post(
        f"{API}/vehicles/Robot-01/routeComputationQuery", json={"destinationPoints": ["Middle 1"]}
    )
    await client.post(f"{API}/nowhere")
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    (found,) = await rows(client, 1)
    assert found["operation"] == "createTransportOrder"
