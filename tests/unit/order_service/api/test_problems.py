from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import httpx
import pytest
from structlog.testing import capture_logs

from nena_order_service import errors
from nena_order_service.api.problems import problem_of
from nena_shared.fleet_api.operations import CHANGE_PLANT, OPERATIONS
from nena_shared.fleet_api.refusals import Refusal, by_status
from support.problems import problem

EVENT_STREAM = {Refusal.TOO_MANY_CLIENTS, Refusal.NOT_SAVED}
OF_VALIDATION = {Refusal.NOT_IN_PLANT, Refusal.UNKNOWN_IN_PLANT}


def test_each_error_is_a_refusal_of_the_table_and_each_refusal_is_used() -> None:
    sources = "".join(file.read_text() for file in Path(errors.__file__).parent.rglob("*.py"))
    declared = {refusal for each in (*OPERATIONS, CHANGE_PLANT) for refusal in each.refusals} | EVENT_STREAM
    assert declared == set(Refusal)
    raised = {Refusal[name] for name in re.findall(r"(?:Error|__init__)\(\s*Refusal\.(\w+)", sources)}
    assert raised == declared - OF_VALIDATION


def test_refusals_of_one_status_are_described_together() -> None:
    refusals = (Refusal.UNKNOWN_ORDER, Refusal.NOT_SAVED, Refusal.UNKNOWN_DEPENDENCY)
    assert by_status(refusals) == {
        404: "Unknown transport order. Unknown dependency.",
        503: "The database is unavailable; nothing was saved.",
    }


async def test_refusals_are_listed_over_rest_and_mqtt(client: httpx.AsyncClient) -> None:
    openapi = (await client.get("/openapi.json")).json()
    hold = openapi["paths"]["/v1/transportOrders/{name}/hold"]["post"]["responses"]
    assert {"404", "409", "412", "503", "4XX", "5XX"} < set(hold)
    assert hold["409"]["description"] == "The transport order has ended. The transport order is withdrawn."
    assert list(hold["409"]["content"]) == ["application/problem+json"]
    create = openapi["paths"]["/v1/transportOrders"]["post"]["responses"]
    assert "The request does not fit the plant model." in create["422"]["description"]

    asyncapi = (await client.get("/asyncapi.json")).json()
    assert "- 412: The object has another version." in asyncapi["operations"]["hold"]["description"]


def test_expected_errors_have_their_own_text() -> None:
    error = errors.UnknownError(Refusal.UNKNOWN_ORDER, "T-9")

    found = problem_of(error)

    assert (found.status, found.detail) == (404, str(error))
    assert (found.type, found.title) == ("/problems/unknown-order", "Not Found")
    assert "T-9" in found.detail


@pytest.mark.parametrize("error", [KeyError("secret"), RuntimeError("secret"), ValueError("secret")])
def test_unexpected_errors_reveal_no_internals(error: Exception) -> None:
    found = problem_of(error)

    assert found.status == 500
    assert "secret" not in found.model_dump_json()


ORDERS = "/v1/transportOrders"
BODY: dict[str, Any] = {"destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}


async def test_body_of_another_content_type_is_refused(client: httpx.AsyncClient) -> None:
    for headers in ({}, {"content-type": "application/x-www-form-urlencoded"}):
        answer = await client.post(ORDERS, content=b'{"destinations": []}', headers=headers)
        assert "Content-Type: application/json" in problem(answer, 415).detail


async def test_unknown_resources_are_problems(client: httpx.AsyncClient) -> None:
    assert "'T-9'" in problem(await client.get(f"{ORDERS}/T-9"), 404).detail
    problem(await client.post(f"{ORDERS}/T-9/withdrawal"), 404)
    problem(await client.get("/v2/everything"), 404)
    problem(await client.delete(ORDERS), 405)


async def test_service_faults_reveal_no_internals(client: httpx.AsyncClient, failing_create: str) -> None:
    with capture_logs() as logged:
        assert failing_create not in problem(await client.post(ORDERS, json=BODY), 500).model_dump_json()
    assert [(line["event"], line["path"]) for line in logged] == [("request failed", ORDERS)]
