"""Connections to real servers: the active one of several is used, and errors are reported."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from dataclasses import replace
from datetime import datetime
from itertools import chain, islice
from typing import Any

import pytest
from fastapi import FastAPI, Response

from nena_client import AsyncClient, Client, Event, RefusedError, UnreachableError, client
from nena_client.exchange import Call, EventReader, Query
from nena_order_service.api.server import make_standby_app
from nena_shared.fleet_api.operations import (
    CREATE_ORDER,
    CREATE_ORDERS,
    DELIVERY,
    DISPATCH,
    LIST_ORDERS,
    Operation,
)
from nena_shared.fleet_api.transport_order import (
    DeliveryPhase,
    DeliveryStatus,
    Destination,
    Problem,
    TransportOrderBatch,
    TransportOrderRequest,
)
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.broker import free_port
from support.waiting import PATIENCE


def at(path: str) -> Operation[DeliveryStatus]:
    """Return an operation whose answer is at this path."""
    return replace(DELIVERY, path=path)


@asynccontextmanager
async def served(app: FastAPI) -> AsyncIterator[str]:
    server = HttpServer(app, HttpSettings(port=0))
    task = asyncio.create_task(server.run())
    yield server.url
    server.stop()
    await asyncio.wait_for(task, PATIENCE)


def active(seen: list[str | None]) -> FastAPI:
    app = FastAPI()

    @app.get("/here")
    async def here() -> Response:
        body = DeliveryStatus(transport_order="T-1", phase=DeliveryPhase.NONE)
        return Response(body.model_dump_json(by_alias=True), media_type="application/json")

    @app.get("/refused")
    async def refused() -> Response:
        problem = Problem(title="Conflict", status=409, detail="It has ended.", errors=("one", "two"))
        return Response(problem.model_dump_json(), 409, media_type="application/problem+json")

    @app.get("/strange")
    async def strange() -> Response:
        return Response("<html>", 404)

    @app.middleware("http")
    async def note(request: Any, call_next: Callable[[Any], Any]) -> Any:
        seen.append(request.headers.get("authorization"))
        return await call_next(request)

    return app


async def test_the_active_one_is_found_and_asked_first_from_then_on() -> None:
    seen: list[str | None] = []
    async with AsyncExitStack() as stack:
        standby = await stack.enter_async_context(served(make_standby_app(lambda: "", lambda: "")))
        url = await stack.enter_async_context(served(active(seen)))
        connection = Client([f"http://127.0.0.1:{free_port()}", standby, url + "/"], "secret", retry_for=0)
        for _ in range(2):
            found = await asyncio.to_thread(connection.call, at("/here"))
            assert found.transport_order == "T-1"
        assert connection._addresses.urls[0] == url
        assert seen == ["Bearer secret"] * 2
        connection.close()


async def test_missing_active_service_lists_all_queried_urls() -> None:
    away = f"http://127.0.0.1:{free_port()}"
    async with served(make_standby_app(lambda: "", lambda: "")) as standby:
        connection = Client([away, standby], retry_for=0)
        with pytest.raises(UnreachableError) as caught:
            await asyncio.to_thread(connection.call, at("/here"))
        assert away in str(caught.value)
        assert standby in str(caught.value)
        connection.close()


async def test_refusal_lists_all_errors() -> None:
    async with served(active([])) as url:
        connection = Client(url)
        with pytest.raises(RefusedError, match=r"It has ended\.\n- one\n- two"):
            await asyncio.to_thread(connection.call, at("/refused"))
        with pytest.raises(RefusedError, match="check the URL"):
            await asyncio.to_thread(connection.call, at("/strange"))
        connection.close()


STREAM = """\
retry: 1000

id: 3
event: transportOrder
data: {"name": "T-1 \u2028"}

event: heartbeat
data: {}

id: 4
event: synced
data: {}

"""


def test_events_are_read_and_half_an_event_is_none() -> None:
    expected = [
        Event("transportOrder", "3", {"name": "T-1 \u2028"}),
        Event("heartbeat", None, {}),
        Event("synced", "4", {}),
    ]
    for size in (1, 7, len(STREAM)):
        reader = EventReader()
        parts = (STREAM[start : start + size] for start in range(0, len(STREAM), size))
        assert list(chain.from_iterable(map(reader.read, parts))) == expected
    assert list(EventReader().read("event: synced\r\ndata: {}\r\n")) == []


class Breaking(Client):
    """Its streams break after the content from the test."""

    def __init__(self, *streams: list[str] | None) -> None:
        super().__init__("http://127.0.0.1:1")
        self._streams = iter(streams)
        self.asked: list[str | None] = []

    @contextmanager
    def _follow_stream(self, _query: Query | None, last_id: str | None) -> Iterator[Iterator[str]]:
        self.asked.append(last_id)
        lines = next(self._streams)
        if lines is None:
            raise UnreachableError("away")
        yield iter(lines)


def test_broken_stream_resumes_after_the_last_event(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "RETRY_PAUSE", 0.0)
    connection = Breaking([STREAM], None, [STREAM])
    told: list[str] = []
    kinds = [each.kind for each in islice(connection.events(on_break=told.append), 6)]
    assert kinds == ["transportOrder", "heartbeat", "synced"] * 2
    assert connection.asked == [None, "4", "4"]
    assert told == ["away"]


def test_unreachable_service_at_the_first_attempt_is_an_error() -> None:
    with pytest.raises(UnreachableError):
        next(Breaking(None).events())


ORDER = TransportOrderRequest(destinations=(Destination(location_name="Packing", operation="NOP"),))


def test_a_creation_gets_a_key_and_keeps_the_one_it_has() -> None:
    made = Call.of(CREATE_ORDER, "", ORDER, {})
    assert made.repeatable
    assert made.arguments["json"]["destinations"] == [{"locationName": "Packing", "operation": "NOP"}]
    assert made.arguments["json"]["idempotencyKey"]
    keyed = Call.of(CREATE_ORDER, "", ORDER.model_copy(update={"idempotency_key": "WMS-7"}), {})
    assert keyed.arguments["json"]["idempotencyKey"] == "WMS-7"


def test_a_query_has_what_is_stated_and_times_with_their_zone() -> None:
    since = datetime(2026, 1, 31, 10)  # noqa: DTZ001 - local
    made = Call.of(LIST_ORDERS, "", None, {"query": {"since": since, "intendedVehicle": None, "limit": 3}})
    assert made.arguments["params"] == {"since": since.astimezone().isoformat(), "limit": 3}


def test_each_order_of_a_batch_gets_a_key() -> None:
    made = Call.of(CREATE_ORDERS, "", TransportOrderBatch(transport_orders=(ORDER, ORDER)), {})
    keys = [each["idempotencyKey"] for each in made.arguments["json"]["transportOrders"]]
    assert made.repeatable
    assert len(set(keys)) == 2


@pytest.mark.parametrize(
    ("operation", "body", "repeatable"),
    [
        (LIST_ORDERS, None, True),
        (CREATE_ORDER, {"idempotencyKey": "WMS-7"}, True),
        (CREATE_ORDER, {"name": "WMS-7"}, False),
        (DISPATCH, None, False),
    ],
)
def test_only_requests_without_a_second_effect_are_repeated(
    operation: Operation[Any], body: Any, *, repeatable: bool
) -> None:
    assert Call.of(operation, "", None, {"body": body}).repeatable is repeatable


async def test_requests_wait_for_an_order_service_that_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "RETRY_PAUSE", 0.01)
    port = free_port()
    async with AsyncClient(f"http://127.0.0.1:{port}", retry_for=PATIENCE) as patient:
        waiting = asyncio.create_task(patient.call(at("/here")))
        server = HttpServer(active([]), HttpSettings(port=port))
        task = asyncio.create_task(server.run())
        assert (await waiting).transport_order == "T-1"
        server.stop()
        await asyncio.wait_for(task, PATIENCE)


async def test_a_refusal_is_not_repeated() -> None:
    seen: list[str | None] = []
    async with served(active(seen)) as url, AsyncClient(url, "secret", retry_for=PATIENCE) as patient:
        with pytest.raises(RefusedError, match="It has ended"):
            await patient.call(at("/refused"))
    assert seen == ["Bearer secret"]


async def test_a_starting_order_service_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "RETRY_PAUSE", 0.01)
    app, answers = active([]), iter((503, 504))

    @app.middleware("http")
    async def starting(request: Any, call_next: Callable[[Any], Any]) -> Any:
        status = next(answers, None)
        return await call_next(request) if status is None else Response("starting", status)

    async with served(app) as url, AsyncClient(url, retry_for=PATIENCE) as patient:
        assert (await patient.call(at("/here"))).transport_order == "T-1"


async def test_a_request_with_a_second_effect_is_sent_to_one_order_service_only() -> None:
    hanging = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
    seen: list[str | None] = []
    port = hanging.sockets[0].getsockname()[1]
    async with hanging, served(active(seen)) as url:
        impatient = AsyncClient([f"http://127.0.0.1:{port}", url], retry_for=0)
        with pytest.raises(UnreachableError, match="may have been executed"):
            await impatient.call(replace(at("/here"), method="POST"))
        await impatient.close()
    assert seen == []
