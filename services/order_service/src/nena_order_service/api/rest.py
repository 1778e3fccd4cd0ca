"""The REST API: a route for each operation of the table, and the routes outside it.

Outside the table are the plant model (a file), the event stream, probes, and the description of the MQTT API.
"""

from __future__ import annotations

import re
from collections.abc import AsyncGenerator, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import APIRouter, FastAPI, Header, Query, Request, Response
from starlette.responses import HTMLResponse, PlainTextResponse, StreamingResponse
from starlette.routing import Mount
from starlette.types import ASGIApp

from nena_order_service.api import problems
from nena_order_service.api.body_limit import BodyLimit
from nena_order_service.api.documentation import DOCS, FILES, REDOC, describe_login, documentation
from nena_order_service.api.events import EventKind, EventStream, Interest
from nena_order_service.api.operation_routes import (
    READING,
    add_operation,
    known_query,
    refusals_of,
)
from nena_order_service.api.operations import HostOperations
from nena_order_service.api.plant import ChangePlant, plant_model_router
from nena_shared.fleet_api.base import ObjectName, Role
from nena_shared.fleet_api.operations import (
    CHANGE_PLANT,
    OPERATIONS,
    Operation,
)
from nena_shared.fleet_api.refusals import PROBLEMS, Refusal
from nena_shared.fleet_api.requests import Readiness
from nena_shared.settings import ConfigurationError
from nena_shared.web.access import RoleNeeded
from nena_shared.web.metrics import METRICS, metrics_response
from nena_shared.web.problem import describe_problems
from nena_shared.web.server_sent_events import HEADERS
from nena_shared.web.settings import HttpSettings

ALIVE = f"ok\nnena-order-service {version('nena-order-service')}\n"
"""Answer of ``/healthz``."""
OPEN = frozenset({"/", "/healthz", "/readyz", DOCS, REDOC})
GUARDED: tuple[Operation[Any], ...] = (*OPERATIONS, CHANGE_PLANT)
ROLES_KEPT = 1000
"""Number of paths whose roles are cached."""
OPENTCS_PLANT_CHANGES = ("/v1/locations/", "/energyLevelThresholdSet", "/envelopeKey")
"""Parts of the paths in openTCS's web API that change the plant model."""

PAGES = {
    DOCS: "REST API: try requests",
    REDOC: "REST API: read",
    "/openapi.json": "REST API (OpenAPI 3.1)",
    "/asyncapi.json": "MQTT API (AsyncAPI 3.0)",
    "/v1/transportOrders": "transport orders",
    "/v1/vehicles": "vehicles",
    "/v1/points": "points",
    "/v1/locations": "locations",
    "/v1/plantModel": "plant model",
    METRICS: "metrics for Prometheus",
    "/readyz": "what is ready",
}
"""Where the start page leads."""
START_PAGE = f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>NeNa order service</title>
<h1>NeNa order service</h1>
<p>The control panel is served by the status aggregator.</p>
<ul>{"".join(f'<li><a href="{path}">{path}</a>: {text}' for path, text in PAGES.items())}</ul>
</html>
"""
NOT_READY: dict[int | str, dict[str, object]] = {
    503: {"model": Readiness, "description": "What is missing, and its effect."}
}


@dataclass(frozen=True, slots=True)
class Service:
    """What the application needs from the service around it."""

    plant_json: bytes
    change_plant: ChangePlant | None
    """Replaces the plant model; None: it is read-only."""
    asyncapi: Callable[[], bytes]
    """Returns the AsyncAPI document; called on request, because few clients need it."""
    readiness: Callable[[], Readiness]
    max_body: int
    """Maximum size of a request body, bytes."""
    metrics: Callable[[], bytes]
    """Returns the metrics in the Prometheus text format."""
    routers: Sequence[APIRouter]
    """Routes of extensions."""
    mounted: Mapping[str, ASGIApp]
    """Other applications by the paths under which they are mounted."""


def make_app(operations: HostOperations, stream: EventStream, service: Service) -> FastAPI:
    """Create the ASGI application."""
    app = FastAPI(
        title="NeNa order service",
        description="Transport orders and vehicles. Errors are problems (RFC 9457) of documented types.",
        version="1",
        servers=[{"url": "/", "description": "The order service that serves this document."}],
        docs_url=None,
        redoc_url=None,
    )
    larger = {
        f"{prefix}{operation.prefix}": operation.max_body
        for operation in GUARDED
        if operation.max_body is not None
        for prefix in ("", *service.mounted)
    }
    app.add_middleware(BodyLimit, limit=service.max_body, larger=larger)
    problems.install(app)
    for operation in iterate_operations(operations):
        add_operation(app, operations, operation)
    for router in service.routers:
        app.include_router(router)
    app.include_router(_event_routes(stream))
    app.include_router(plant_model_router(service.plant_json, service.change_plant, operations.trail))
    app.include_router(_probe_routes(service))
    app.include_router(documentation())
    for path, other in service.mounted.items():
        mount = Mount(path, other)
        # Starlette's pattern excludes names with line breaks, which would get an answer in another form.
        mount.path_regex = re.compile(mount.path_regex.pattern, re.DOTALL)
        app.router.routes.append(mount)
    describe_problems(app)
    describe_login(app)
    return app


def iterate_operations(operations: HostOperations) -> Iterator[Operation[Any]]:
    """Yield the operations with a handler: those of the table, then other ones of extensions.

    Raises:
        ConfigurationError: only administrators may use another one; :func:`role_needed` knows only the table.
    """
    yield from (operation for operation in OPERATIONS if operation.name in operations.handlers)
    for handler in operations.handlers.values():
        if handler.operation in OPERATIONS:
            continue
        if handler.operation.admin:
            raise ConfigurationError([f"the operation {handler.operation.name} must not set admin"])
        yield handler.operation


@lru_cache(ROLES_KEPT)
def role_needed(method: str, path: str) -> Role | None:
    """Return the role that a request needs; None: no login needed.

    Operations are found by the part of their path before a name, so no spelling of a name can bypass the role
    of an operation.
    """
    reads = method in READING
    if path in OPEN or (reads and path.startswith((f"{FILES}/", f"{PROBLEMS}/"))):
        return None
    if not reads and any(part in path for part in OPENTCS_PLANT_CHANGES):
        return Role.ADMIN
    inner = path[max(path.rfind("/v1/"), 0) :]  # as seen by a mounted application, such as openTCS's web API
    needs_admin = any(
        operation.admin and (operation.method in READING) == reads
        for operation in GUARDED
        if any(part.startswith(operation.prefix) for part in (path, inner))
    )
    return Role.ADMIN if needs_admin else Role.VIEWER if reads else Role.OPERATOR


def rule_of(settings: HttpSettings) -> RoleNeeded:
    """Return which role a request needs under these settings."""

    def needed(method: str, path: str) -> Role | None:
        return None if path == METRICS and settings.open_metrics else role_needed(method, path)

    return needed


def _event_routes(stream: EventStream) -> APIRouter:
    router = APIRouter(prefix="/v1", tags=["events"])

    @router.get(
        "/events",
        operation_id="events",
        response_class=StreamingResponse,
        responses=refusals_of((Refusal.TOO_MANY_CLIENTS, Refusal.NOT_SAVED)),
        dependencies=[known_query("kind", "transportOrder", "vehicle", "after")],
    )
    async def events(
        kind: Annotated[list[EventKind] | None, Query(description="Only events of these kinds.")] = None,
        transport_order: Annotated[
            ObjectName | None, Query(alias="transportOrder", description="Only this order.")
        ] = None,
        vehicle: Annotated[ObjectName | None, Query(description="Only this vehicle and its orders.")] = None,
        last_event_id: Annotated[
            str | None, Header(alias="Last-Event-ID", description="ID of the last event received.")
        ] = None,
        after: Annotated[
            str | None, Query(max_length=100, description="The same, for clients that cannot set headers.")
        ] = None,
    ) -> StreamingResponse:
        """Follow orders and vehicles as server-sent events.

        `transportOrder` and `vehicle` contain the object as it is now. `synced`: the client is up to date.
        `gap`: too many events were missed, or the ID is unknown (a store restored from a backup). All
        unfinished objects follow; look up the others in the lists. `heartbeat`: the connection is alive. A
        client that reconnects with the ID of its last event receives the events that it missed.
        """
        interest = Interest(frozenset(kind or EventKind), transport_order, vehicle)
        frames = stream.follow(last_event_id or after, interest)
        first = await anext(frames)  # an error before the first event is answered as a problem
        return StreamingResponse(
            _resume_stream(first, frames), media_type="text/event-stream", headers=HEADERS
        )

    return router


async def _resume_stream(first: bytes, rest: AsyncGenerator[bytes, None]) -> AsyncGenerator[bytes, None]:
    try:
        yield first
        async for frames in rest:
            yield frames
    finally:
        await rest.aclose()


def _probe_routes(service: Service) -> APIRouter:
    router = APIRouter(tags=["service"])

    @router.get("/", include_in_schema=False)
    async def start_page() -> Response:
        """Lead a person who opens the address in a browser to what there is."""
        return HTMLResponse(START_PAGE)

    @router.get("/asyncapi.json", operation_id="asyncapi")
    async def asyncapi() -> Response:
        """Describe the MQTT API (AsyncAPI 3.0)."""
        return Response(service.asyncapi(), media_type="application/json")

    @router.get(METRICS, operation_id="metrics", response_class=PlainTextResponse)
    async def metrics(request: Request) -> Response:
        """Return all metrics in the Prometheus text format, compressed for clients that accept gzip."""
        return metrics_response(request, service.metrics())

    @router.get("/healthz", operation_id="healthz", response_class=PlainTextResponse)
    async def alive() -> Response:
        """Return 200 and the version while the process runs."""
        return Response(ALIVE, media_type="text/plain")

    @router.get("/readyz", operation_id="readyz", response_model=Readiness, responses=NOT_READY)
    async def ready() -> Response:
        """Return whether the broker is connected and the store can be written."""
        readiness = service.readiness()
        status = HTTPStatus.OK if readiness.ready else HTTPStatus.SERVICE_UNAVAILABLE
        return Response(readiness.model_dump_json(by_alias=True), status, media_type="application/json")

    return router
