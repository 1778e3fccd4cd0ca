"""The audit trail of openTCS's web API: a row for each request that may change something."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import parse_qsl

from pydantic_core import from_json
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from nena_order_service.api.audit import ChangingRequest, Trail, kind_of, masked, origin_of
from nena_shared.fleet_api.audit import AuditInterface, AuditResult
from nena_shared.fleet_api.operations import INSTANT_ACTION, OPERATIONS, Operation

READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
WITHOUT_EFFECT: Final = ("/trigger", "/routeComputationQuery")
"""Ends of the paths of other requests that change nothing."""
BODY_LIMIT: Final = 65_536
"""Maximum size of a recorded body, bytes: of longer ones only the size is recorded."""
REASON_LIMIT: Final = 500
"""Maximum size of the recorded part of a refusal, bytes."""

_BY_ROUTE: Final[Mapping[str, Operation[Any]]] = {
    route: operation for operation in OPERATIONS for route in operation.opentcs
}


@dataclass(slots=True)
class _Exchange:
    """The body of a request and its answer, as far as they have passed."""

    receive: Receive
    send: Send
    query: bytes
    body: bytearray = field(default_factory=bytearray)
    size: int = 0
    status: int = 0
    answer: bytearray = field(default_factory=bytearray)

    async def received(self) -> Message:
        """Receive a part of the body."""
        message = await self.receive()
        part = message.get("body", b"")
        self.size += len(part)
        if self.size <= BODY_LIMIT:
            self.body += part
        return message

    async def sent(self, message: Message) -> None:
        """Send a part of the answer."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
        elif self.status >= HTTPStatus.BAD_REQUEST:
            self.answer += message.get("body", b"")[: REASON_LIMIT - len(self.answer)]
        await self.send(message)

    def text(self) -> str:
        """Return query and body of the request as JSON."""
        query = dict(parse_qsl(self.query.decode("ascii", "replace")))
        content: dict[str, Any] = {"query": query} if query else {}
        if self.size:
            try:
                content["body"] = from_json(bytes(self.body)) if self.size <= BODY_LIMIT else None
            except ValueError:
                content["body"] = None
            if content["body"] is None:
                content["body"] = f"{self.size} bytes"
        return masked(content) if content else ""


class AuditedRoutes:
    """ASGI middleware that records requests; ``routes`` are those of the application behind it."""

    def __init__(self, app: ASGIApp, trail: Trail, routes: Iterable[BaseRoute]) -> None:
        self._app = app
        self._trail = trail
        self._routes = routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request."""
        route, parameters = self._find(scope)
        if route is None:
            await self._app(scope, receive, send)
            return
        exchange = _Exchange(receive, send, scope.get("query_string", b""))
        operation = _BY_ROUTE.get(route)
        path = route.partition(" ")[2]
        asked = ChangingRequest(
            origin=origin_of(HTTPConnection(scope), AuditInterface.OPENTCS),
            operation=operation.name if operation else route,
            kind=kind_of(path),
            name=str(parameters.get("name", "")),
            body=exchange.text,
            creates=kind_of(operation.creates) if operation and operation.creates else "",
            joins=operation is not INSTANT_ACTION,
        )
        with self._trail.recorded(asked) as request:
            await self._app(scope, exchange.received, exchange.sent)
            if exchange.status >= HTTPStatus.BAD_REQUEST:
                failed = exchange.status == HTTPStatus.INTERNAL_SERVER_ERROR  # not 503: it is foreseen
                result = AuditResult.FAILED if failed else AuditResult.REFUSED
                request.end(result, f"HTTP {exchange.status}: {exchange.answer.decode('utf-8', 'replace')}")

    def _find(self, scope: Scope) -> tuple[str | None, Mapping[str, Any]]:
        """Return method and path of a changing request's route, and its parameters; None: another request."""
        if scope["type"] != "http" or scope["method"] in READING:
            return None, {}
        for each in self._routes:
            match, found = each.matches(scope)
            if match is Match.FULL:
                path = str(getattr(each, "path", ""))
                if path.endswith(WITHOUT_EFFECT):
                    break
                return f"{scope['method']} {path}", found.get("path_params", {})
        return None, {}
