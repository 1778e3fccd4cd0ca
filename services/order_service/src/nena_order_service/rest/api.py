"""The REST door: its resources put together, and what concerns the service itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from http import HTTPStatus

from fastapi import APIRouter, FastAPI, Response
from starlette.responses import PlainTextResponse
from starlette.routing import Mount
from starlette.types import ASGIApp

from nena_order_service.api import problems
from nena_order_service.api.events import EventStream
from nena_order_service.host_requests import HostServices
from nena_order_service.rest import (
    events,
    order_sequences,
    paths,
    plant_model,
    transport_orders,
    vehicle_commands,
    vehicles,
    zone_sets,
)
from nena_order_service.rest.body_limit import BodyLimit
from nena_order_service.rest.responses import as_json
from nena_order_service.serving import ChangePlant
from nena_shared.fleet_api.requests import Readiness
from nena_shared.web.problem import describe_problems

NOT_READY: dict[int | str, dict[str, object]] = {
    503: {"model": Readiness, "description": "What is missing, and what that means."}
}


def make_app(
    hosts: HostServices,
    stream: EventStream,
    *,
    plant_json: bytes,
    change_plant: ChangePlant | None,
    asyncapi: bytes,
    readiness: Callable[[], Readiness],
    max_body: int,
    mounted: Mapping[str, ASGIApp],
) -> FastAPI:
    """Make the ASGI application; ``mounted`` are other ones, by the paths below which they answer."""
    app = FastAPI(
        title="NeNa order service",
        description="Transport orders and vehicles. Every error is a problem (RFC 9457).",
        version="1",
        docs_url=None,
        redoc_url=None,
    )
    app.add_middleware(BodyLimit, limit=max_body, larger={plant_model.PATH: plant_model.MAX_BYTES})
    problems.install(app)
    app.include_router(transport_orders.make_router(hosts.requests))
    app.include_router(order_sequences.make_router(hosts.sequences))
    app.include_router(vehicles.make_router(hosts.requests))
    app.include_router(vehicle_commands.make_router(hosts.requests))
    app.include_router(paths.make_router(hosts.locks))
    app.include_router(events.make_router(stream))
    app.include_router(plant_model.make_router(plant_json, change_plant))
    app.include_router(zone_sets.make_router(hosts.zones))
    app.include_router(_service(asyncapi, readiness))
    for path, other in mounted.items():
        app.router.routes.append(_mounted(path, other))
    describe_problems(app)
    return app


def _mounted(path: str, app: ASGIApp) -> Mount:
    mount = Mount(path, app)
    # By itself it leaves out names with line ends, which would be answered in another form.
    mount.path_regex = re.compile(mount.path_regex.pattern, re.DOTALL)
    return mount


def _service(asyncapi: bytes, readiness: Callable[[], Readiness]) -> APIRouter:
    router = APIRouter()

    @router.get("/asyncapi.json", tags=["service"])
    async def mqtt_door() -> Response:
        """Describe the MQTT door (AsyncAPI 3.0)."""
        return Response(asyncapi, media_type="application/json")

    @router.get("/healthz", tags=["service"], response_class=PlainTextResponse)
    async def alive() -> Response:
        """Tell that the process runs."""
        return Response("ok\n", media_type="text/plain")

    @router.get("/readyz", tags=["service"], response_model=Readiness, responses=NOT_READY)
    async def ready() -> Response:
        """Tell whether broker and store are there."""
        now = readiness()
        return as_json(now, HTTPStatus.OK if now.ready else HTTPStatus.SERVICE_UNAVAILABLE)

    return router
