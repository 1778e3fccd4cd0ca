"""Clients of the order service's REST API and event stream; they find the active one of several."""

from __future__ import annotations

import ssl
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Generator, Iterator, Sequence
from contextlib import aclosing, asynccontextmanager, closing, contextmanager
from itertools import chain
from typing import Self, Unpack

import httpx
from pydantic import BaseModel

from nena_client.exchange import (
    ANSWER,
    CONNECT_SECONDS,
    EVENTS,
    STREAM,
    A,
    Addresses,
    Attempt,
    Call,
    Event,
    EventReader,
    Options,
    P,
    Query,
    RefusedError,
    ServiceState,
    UnreachableError,
    next_page,
    params_of,
    problem_of,
    read,
)
from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.operations.orders import SHOW_ORDER
from nena_shared.fleet_api.operations.vehicles import LIST_VEHICLES
from nena_shared.fleet_api.transport_order import TransportOrderStatus

RETRY_FOR = 30.0
"""How long a client repeats a request by default, seconds: a takeover takes less."""
RETRY_PAUSE = 1.0
"""Delay before a request or a broken event stream is tried again, seconds."""
ORDER_EVENT = "transportOrder"


USER_AGENT = "nena-client"
"""Name of the client in the audit trail, unless the caller chooses one."""


def _request_headers(token: str | None, user_agent: str) -> dict[str, str]:
    return {"User-Agent": user_agent} | ({"Authorization": f"Bearer {token}"} if token else {})


def _trusted_authorities(urls: Sequence[str]) -> ssl.SSLContext | bool:
    """Return what httpx verifies certificates with; the system's authorities take time to load."""
    if any(url.lower().startswith("https:") for url in urls):
        return True
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # trusts no certificate


async def _pause() -> None:
    import asyncio  # noqa: PLC0415 - the blocking client starts faster without it

    await asyncio.sleep(RETRY_PAUSE)


def _may_pass(error: UnreachableError | RefusedError) -> bool:
    return isinstance(error, UnreachableError) or error.passing


class Client:
    """Blocking client. Use it as a context manager, or call :meth:`close`.

    Args:
        urls: of the order service, or of all of a fleet.
        token: of a user; None: the order service requires none.
        retry_for: how long requests are repeated while no order service answers, seconds; only requests that
            may be repeated, to which the client adds idempotency keys.
        user_agent: name of the client in the audit trail.
    """

    def __init__(
        self,
        urls: str | Sequence[str],
        token: str | None = None,
        *,
        retry_for: float = RETRY_FOR,
        user_agent: str = USER_AGENT,
    ) -> None:
        self._addresses = Addresses.of(urls)
        trust = _trusted_authorities(self._addresses.urls)
        self._client = httpx.Client(headers=_request_headers(token, user_agent), timeout=ANSWER, verify=trust)
        self._retry_for = retry_for

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close all connections."""
        self.close()

    def close(self) -> None:
        """Close all connections."""
        self._client.close()

    def call(
        self,
        operation: Operation[A],
        name: str = "",
        request: BaseModel | None = None,
        **options: Unpack[Options],
    ) -> A:
        """Call an operation on the object of this name; raises RefusedError and UnreachableError."""
        return read(operation, self._send_call(Call.of(operation, name, request, options)))

    def pages(self, operation: Operation[P], query: Query | None = None) -> Iterator[P]:
        """Yield the pages of a list; raises RefusedError and UnreachableError."""
        page = self.call(operation, query=next_page(None, query))
        yield page
        while page.next is not None:
            page = self.call(operation, query=next_page(page.next, query))
            yield page

    def readiness(self) -> dict[str, ServiceState]:
        """Return the state of the order service at each URL."""
        return {url: self._state_of(url) for url in self._addresses.urls}

    def events(
        self, query: Query | None = None, *, on_break: Callable[[str], None] = lambda _: None
    ) -> Generator[Event]:
        """Follow the events endlessly; resume after the last one when the connection breaks.

        Raises RefusedError, and UnreachableError if the first attempt fails.
        """
        last_id: str | None = None
        ever = False
        while True:
            try:
                with self._follow_stream(query, last_id) as parts:
                    for event in chain.from_iterable(map(EventReader().read, parts)):
                        ever = True
                        last_id = event.id or last_id
                        yield event
            except (UnreachableError, RefusedError) as error:
                if not ever or not _may_pass(error):
                    raise
                on_break(str(error))
            time.sleep(RETRY_PAUSE)

    def wait_for(self, order: str, timeout: float | None = None) -> TransportOrderStatus:
        """Wait until a transport order has ended, and return it.

        Raises:
            TimeoutError: it has not ended after ``timeout`` seconds, which are looked at with each event or
                heartbeat.
        """
        end = None if timeout is None else time.monotonic() + timeout
        with closing(self.events({"kind": ORDER_EVENT, ORDER_EVENT: order})) as events:
            status = self.call(SHOW_ORDER, order)
            while not status.state.final:
                if end is not None and time.monotonic() >= end:
                    raise TimeoutError(
                        f"order {order!r} has not ended after {timeout:g} s; it is {status.state.value}"
                    )
                next(events)  # also a heartbeat: an order that ended before the stream began has no event
                status = self.call(SHOW_ORDER, order)
        return status

    def _send_call(self, call: Call) -> httpx.Response:
        give_up = time.monotonic() + self._retry_for
        while True:
            try:
                return self._send_once(call)
            except (UnreachableError, RefusedError) as error:
                over = time.monotonic() + RETRY_PAUSE > give_up
                if over or not call.repeatable or not _may_pass(error):
                    raise
            time.sleep(RETRY_PAUSE)

    def _send_once(self, call: Call) -> httpx.Response:
        attempt = Attempt(self._addresses, call)
        for url in attempt.urls():
            try:
                answer = self._client.request(call.method, url + call.path, **call.arguments)
            except httpx.TransportError as error:
                attempt.failed(url, error)
                continue
            if attempt.accepts(url, answer):
                break
        return answer

    def _state_of(self, url: str) -> ServiceState:
        try:
            return ServiceState.of(self._client.get(f"{url}/readyz", timeout=CONNECT_SECONDS))
        except httpx.TransportError as error:
            return ServiceState(f"not reachable: {error}", healthy=False)

    def _active_url(self) -> str:
        """Return the URL of the active order service; a single one counts as active."""
        if len(self._addresses.urls) > 1:
            self.call(LIST_VEHICLES, query={"limit": 1})
        return self._addresses.urls[0]

    @contextmanager
    def _follow_stream(self, query: Query | None, last_id: str | None) -> Iterator[Iterator[str]]:
        """Follow the parts of the event stream; raises as :meth:`call` does, also while it is followed."""
        url = self._active_url()
        params = params_of(query)
        headers = {"Last-Event-ID": last_id} if last_id else {}
        following = self._client.stream("GET", url + EVENTS, params=params, headers=headers, timeout=STREAM)
        try:
            with following as answer:
                if not answer.is_success:
                    answer.read()
                    raise RefusedError(problem_of(answer))
                yield answer.iter_text()
        except httpx.TransportError as error:
            raise UnreachableError(f"{url}: {error}") from error


class AsyncClient:
    """The same for asyncio. Use it as an asynchronous context manager, or call :meth:`close`."""

    def __init__(
        self,
        urls: str | Sequence[str],
        token: str | None = None,
        *,
        retry_for: float = RETRY_FOR,
        user_agent: str = USER_AGENT,
    ) -> None:
        self._addresses = Addresses.of(urls)
        trust = _trusted_authorities(self._addresses.urls)
        self._client = httpx.AsyncClient(
            headers=_request_headers(token, user_agent), timeout=ANSWER, verify=trust
        )
        self._retry_for = retry_for

    async def __aenter__(self) -> Self:
        """Return the client."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close all connections."""
        await self.close()

    async def close(self) -> None:
        """Close all connections."""
        await self._client.aclose()

    async def call(
        self,
        operation: Operation[A],
        name: str = "",
        request: BaseModel | None = None,
        **options: Unpack[Options],
    ) -> A:
        """Call an operation on the object of this name; raises RefusedError and UnreachableError."""
        return read(operation, await self._send_call(Call.of(operation, name, request, options)))

    async def pages(self, operation: Operation[P], query: Query | None = None) -> AsyncIterator[P]:
        """Yield the pages of a list; raises RefusedError and UnreachableError."""
        page = await self.call(operation, query=next_page(None, query))
        yield page
        while page.next is not None:
            page = await self.call(operation, query=next_page(page.next, query))
            yield page

    async def readiness(self) -> dict[str, ServiceState]:
        """Return the state of the order service at each URL."""
        return {url: await self._state_of(url) for url in self._addresses.urls}

    async def events(
        self, query: Query | None = None, *, on_break: Callable[[str], None] = lambda _: None
    ) -> AsyncGenerator[Event]:
        """Follow the events endlessly; resume after the last one when the connection breaks.

        Raises RefusedError, and UnreachableError if the first attempt fails.
        """
        last_id: str | None = None
        ever = False
        while True:
            try:
                async with self._follow_stream(query, last_id) as parts:
                    reader = EventReader()
                    async for part in parts:
                        for event in reader.read(part):
                            ever = True
                            last_id = event.id or last_id
                            yield event
            except (UnreachableError, RefusedError) as error:
                if not ever or not _may_pass(error):
                    raise
                on_break(str(error))
            await _pause()

    async def wait_for(self, order: str) -> TransportOrderStatus:
        """Wait until a transport order has ended, and return it; limit it by ``asyncio.timeout``."""
        async with aclosing(self.events({"kind": ORDER_EVENT, ORDER_EVENT: order})) as events:
            status = await self.call(SHOW_ORDER, order)
            while not status.state.final:
                await anext(events)
                status = await self.call(SHOW_ORDER, order)
        return status

    async def _send_call(self, call: Call) -> httpx.Response:
        give_up = time.monotonic() + self._retry_for
        while True:
            try:
                return await self._send_once(call)
            except (UnreachableError, RefusedError) as error:
                over = time.monotonic() + RETRY_PAUSE > give_up
                if over or not call.repeatable or not _may_pass(error):
                    raise
            await _pause()

    async def _send_once(self, call: Call) -> httpx.Response:
        attempt = Attempt(self._addresses, call)
        for url in attempt.urls():
            try:
                answer = await self._client.request(call.method, url + call.path, **call.arguments)
            except httpx.TransportError as error:
                attempt.failed(url, error)
                continue
            if attempt.accepts(url, answer):
                break
        return answer

    async def _state_of(self, url: str) -> ServiceState:
        try:
            return ServiceState.of(await self._client.get(f"{url}/readyz", timeout=CONNECT_SECONDS))
        except httpx.TransportError as error:
            return ServiceState(f"not reachable: {error}", healthy=False)

    async def _active_url(self) -> str:
        """Return the URL of the active order service; a single one counts as active."""
        if len(self._addresses.urls) > 1:
            await self.call(LIST_VEHICLES, query={"limit": 1})
        return self._addresses.urls[0]

    @asynccontextmanager
    async def _follow_stream(
        self, query: Query | None, last_id: str | None
    ) -> AsyncIterator[AsyncIterator[str]]:
        """Follow the parts of the event stream; raises as :meth:`call` does, also while it is followed."""
        url = await self._active_url()
        params = params_of(query)
        headers = {"Last-Event-ID": last_id} if last_id else {}
        following = self._client.stream("GET", url + EVENTS, params=params, headers=headers, timeout=STREAM)
        try:
            async with following as answer:
                if not answer.is_success:
                    await answer.aread()
                    raise RefusedError(problem_of(answer))
                yield answer.aiter_text()
        except httpx.TransportError as error:
            raise UnreachableError(f"{url}: {error}") from error
