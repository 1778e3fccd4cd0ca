"""The audit trail of openTCS's web API: a row for each request that may change something."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import parse_qsl

from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic_core import from_json

from nena_order_service.api.audit import ChangingRequest, Trail, kind_of_path, origin_of, to_masked_json
from nena_order_service.api.operation_routes import READING
from nena_order_service.extensions.opentcs.answers import FORESEEN, response_to
from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api.audit import AuditInterface, AuditResult

WITHOUT_EFFECT: Final = ("/trigger", "/routeComputationQuery")
"""Ends of the paths of other requests that change nothing."""
BODY_LIMIT: Final = 65_536
"""Maximum size of a recorded body, bytes: of longer ones only the size is recorded."""
REASON_LIMIT: Final = 500
"""Maximum size of the recorded part of a refusal, bytes."""
OPERATIONS: Final[Mapping[str, table.Operation[Any]]] = {
    "POST /v1/transportOrders/{name}": table.CREATE_ORDER,
    "POST /v1/transportOrders/{name}/withdrawal": table.WITHDRAW,
    "POST /v1/vehicles/{name}/withdrawal": table.WITHDRAW,
    "POST /v1/orderSequences/{name}": table.CREATE_SEQUENCE,
    "PUT /v1/orderSequences/{name}/complete": table.COMPLETE_SEQUENCE,
    "PUT /v1/vehicles/{name}/integrationLevel": table.INTEGRATION_LEVEL,
    "PUT /v1/vehicles/{name}/acceptableOrderTypes": table.ORDER_TYPES,
    "PUT /v1/vehicles/{name}/allowedOrderTypes": table.ORDER_TYPES,
    "PUT /v1/vehicles/{name}/paused": table.INSTANT_ACTION,
    "POST /v1/vehicles/{name}/rerouteRequest": table.REROUTE,
    "PUT /v1/paths/{name}/locked": table.LOCK_PATH,
}
"""NeNa's operations by the routes that do the same; other requests are recorded under their route."""

Handle = Callable[[Request], Coroutine[Any, Any, Response]]


class AuditedRoute(APIRoute):
    """A route that records its requests in the trail of the application's state."""

    def get_route_handler(self) -> Handle:
        """Return what answers requests."""
        handle = super().get_route_handler()
        (method,) = tuple(self.methods or ())
        if method in READING or self.path.endswith(WITHOUT_EFFECT):
            return handle

        async def recorded(request: Request) -> Response:
            body = b""
            trail: Trail = request.app.state.trail
            route = f"{method} {self.path_format}"
            with trail.record_request(_changing_request(route, request, lambda: body)) as entry:
                try:
                    body = await request.body()
                    response = await handle(request)
                except FORESEEN as error:  # the application's handlers would answer too late for the row
                    response = response_to(request, error)
                if response.status_code >= HTTPStatus.BAD_REQUEST:
                    reason = bytes(response.body)[:REASON_LIMIT].decode("utf-8", "replace")
                    entry.end(AuditResult.REFUSED, f"HTTP {response.status_code}: {reason}")
            return response

        return recorded


def _changing_request(route: str, request: Request, body: Callable[[], bytes]) -> ChangingRequest:
    operation = OPERATIONS.get(route)
    return ChangingRequest(
        origin=origin_of(request, AuditInterface.OPENTCS),
        operation=operation.name if operation else route,
        kind=kind_of_path(route.partition(" ")[2]),
        name=str(request.path_params.get("name", "")),
        body=lambda: _content_of(request, body()),
        creates=kind_of_path(operation.creates) if operation and operation.creates else "",
        # As in api/operations: what an instant action has done is known only when the robot answers.
        joins=operation is not table.INSTANT_ACTION,
    )


def _content_of(request: Request, body: bytes) -> str:
    """Return query and body of a request as JSON."""
    query = dict(parse_qsl(request.url.query))
    content: dict[str, Any] = {"query": query} if query else {}
    if body:
        try:
            content["body"] = from_json(body if len(body) <= BODY_LIMIT else b"")
        except ValueError:
            content["body"] = f"{len(body)} bytes"
    return to_masked_json(content) if content else ""
