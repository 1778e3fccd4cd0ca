from __future__ import annotations

import inspect
from typing import Any

import httpx
import pytest
from structlog.testing import capture_logs

from nena_order_service import errors
from nena_order_service.api.problems import FORESEEN, STATUS, problem_of
from support.problems import problem


def test_each_error_of_the_service_has_one_status() -> None:
    own = {
        each for _, each in inspect.getmembers(errors, inspect.isclass) if each.__module__ == errors.__name__
    }
    assert {each for each in own if issubclass(each, Exception)} == set(STATUS)
    assert set(STATUS) < set(FORESEEN)


def test_what_is_foreseen_says_what_to_do_in_its_own_words() -> None:
    error = errors.UnknownOrderError("T-9")

    found = problem_of(error)

    assert (found.status, found.detail) == (404, str(error))
    assert "T-9" in found.detail


@pytest.mark.parametrize("error", [KeyError("secret"), RuntimeError("secret"), ValueError("secret")])
def test_what_nobody_foresaw_gives_no_inside_view(error: Exception) -> None:
    found = problem_of(error)

    assert found.status == 500
    assert "secret" not in found.model_dump_json()


ORDERS = "/v1/transportOrders"
BODY: dict[str, Any] = {"destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}


async def test_body_of_another_content_type_is_refused(client: httpx.AsyncClient) -> None:
    for headers in ({}, {"content-type": "application/x-www-form-urlencoded"}):
        answer = await client.post(ORDERS, content=b'{"destinations": []}', headers=headers)
        assert "Content-Type: application/json" in problem(answer, 415).detail


async def test_what_is_not_there_is_a_problem(client: httpx.AsyncClient) -> None:
    assert "'T-9'" in problem(await client.get(f"{ORDERS}/T-9"), 404).detail
    problem(await client.post(f"{ORDERS}/T-9/withdrawal"), 404)
    problem(await client.get("/v2/everything"), 404)
    problem(await client.delete(ORDERS), 405)


async def test_fault_of_the_service_gives_no_inside_view(
    client: httpx.AsyncClient, failing_create: str
) -> None:
    with capture_logs() as logged:
        assert failing_create not in problem(await client.post(ORDERS, json=BODY), 500).model_dump_json()
    assert [(line["event"], line["path"]) for line in logged] == [("request failed", ORDERS)]
