"""Operations are answered without FastAPI's layers, with few function calls, and alike below another path."""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import replace
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from pydantic import model_validator
from starlette.routing import Mount, Router
from starlette.types import Message

from nena_order_service.api.operation_routes import OperationRoute, RestApp
from nena_order_service.api.operations import Call, Reply
from nena_order_service.service import OrderService
from nena_shared.fleet_api.operations import CREATE_ORDER, OPERATIONS, Operation
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from support.order_service import dispatchable_order
from support.problems import problem

ORDERS = "/v1/transportOrders"
BODY: dict[str, Any] = {"name": "T-1", "destinations": [{"locationName": "Goods in"}]}
CALLS = 250
"""Maximum number of function calls of a request, apart from its operation; with FastAPI, 655."""

validated: Counter[str] = Counter()


class Counted(TransportOrderRequest):
    """A body that counts how often it is validated."""

    @model_validator(mode="after")
    def _count(self) -> Counted:
        validated[self.name or ""] += 1
        return self


MADE = Reply(dispatchable_order().status)


async def create(_: Call[Any]) -> Reply:
    return MADE


async def post(app: FastAPI) -> tuple[int, int]:
    """Create an order; return the status of the answer, and the number of function calls."""
    scope = {
        "type": "http",
        "method": "POST",
        "path": ORDERS,
        "raw_path": ORDERS.encode(),
        "query_string": b"",
        "headers": [(b"host", b"x"), (b"content-type", b"application/json")],
        "state": {},
    }
    sent: list[Message] = []
    calls = 0

    async def receive() -> Message:
        return {"type": "http.request", "body": json.dumps(BODY).encode(), "more_body": False}

    async def send(message: Message) -> None:
        sent.append(message)

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        await app(scope, receive, send)
    finally:
        sys.setprofile(None)
    return sent[0]["status"], calls


async def test_a_request_is_validated_once_and_takes_few_function_calls() -> None:
    operation = replace(CREATE_ORDER, request=Counted)
    app = RestApp([OperationRoute(operation, create, max_body=4096)])
    await post(app)
    validated.clear()

    status, calls = await post(app)

    assert status == 200
    assert validated == {"T-1": 1}
    assert calls < CALLS


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda each: each.name)
async def test_fastapi_does_not_answer_operations(
    client: httpx.AsyncClient, operation: Operation[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    passed_on: list[str] = []

    async def note(_app: FastAPI, scope: Any, *_: object) -> None:
        passed_on.append(scope["path"])

    monkeypatch.setattr(FastAPI, "__call__", note)
    path = operation.path_of("Robot-01")
    await client.request(operation.method, path, headers={"content-type": "text/plain"}, content=b"-")
    assert passed_on == []


async def test_below_another_path_operations_are_answered_alike(service: OrderService) -> None:
    transport = httpx.ASGITransport(Router([Mount("/site", service.app)]))
    async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
        made = await client.post(f"/site{ORDERS}", json=BODY)
        assert (made.status_code, made.headers["location"]) == (201, f"{ORDERS}/T-1")
        problem(await client.post(f"/site{ORDERS}", json=[]), 422)
        problem(await client.get(f"/site{ORDERS}/T-9"), 404)
