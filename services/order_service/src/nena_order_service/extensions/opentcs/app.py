"""openTCS's web API, version 1, under its own base URL. docs/opentcs-web-api.md lists the routes."""

from __future__ import annotations

from http import HTTPStatus
from importlib.metadata import version as distribution_version
from typing import Any, Final

from fastapi import FastAPI, Response
from starlette.exceptions import HTTPException

from nena_order_service.extension import Core
from nena_order_service.extensions.opentcs import answers, events, orders, peripherals, plant, vehicles
from nena_order_service.extensions.opentcs.answers import NotPossibleError
from nena_order_service.extensions.opentcs.audit import AuditedRoute

OPENTCS_VERSION: Final = "7.5.0"
"""Release of openTCS whose API documentation is followed."""


def make_app(core: Core, changes: events.ChangeLog) -> FastAPI:
    """Create the ASGI application."""
    hosts, engine = core.hosts, core.engine
    app = FastAPI(title="openTCS web API, version 1, as NeNa serves it", docs_url=None, redoc_url=None)
    app.state.trail = hosts.trail
    app.router.route_class = AuditedRoute
    answers.install_error_answers(app)

    @app.post("/v1/dispatcher/trigger", response_class=Response)
    @app.post("/v1/vehicles/dispatcher/trigger", response_class=Response)
    @app.post("/v1/transportOrders/dispatcher/trigger", response_class=Response)
    async def trigger() -> None:
        engine.run_checks()

    orders.add_routes(app, hosts, engine)
    vehicles.add_routes(app, hosts, engine, changes)
    plant.add_routes(app, engine.plant, hosts.locks, core.change_plant)
    peripherals.add_routes(app, hosts, engine)
    events.add_routes(app, changes)
    _add_environment(app)

    @app.get("/v1/kernel/version")
    async def version() -> dict[str, str]:
        return {
            "baselineVersion": OPENTCS_VERSION,
            "customizationName": "NeNa",
            "customizationVersion": distribution_version("nena-order-service"),
        }

    @app.delete("/v1/kernel", response_class=Response)
    async def shut_down() -> None:
        raise HTTPException(HTTPStatus.FORBIDDEN, "Hosts cannot shut down the order service.")

    return app


def _add_environment(app: FastAPI) -> None:
    """Answer like openTCS without environmental entities; none can be created."""

    def none_of(name: str) -> HTTPException:
        return HTTPException(HTTPStatus.NOT_FOUND, f"Could not find environmental entity {name!r}.")

    @app.get("/v1/environmentalEntities")
    async def list_entities() -> list[dict[str, Any]]:
        return []

    @app.get("/v1/environmentalEntities/{name}")
    async def show_entity(name: str) -> dict[str, Any]:
        raise none_of(name)

    @app.post("/v1/environmentalEntities/{name}", response_class=Response)
    async def create_entity(name: str) -> None:
        text = f"Environmental entity {name!r} cannot be created: NeNa's traffic control has none."
        raise NotPossibleError(text)

    @app.put("/v1/environmentalEntities/{name}/envelope", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/pose", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/integrationLevel", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/retired", response_class=Response)
    async def change_entity(name: str) -> None:
        raise none_of(name)
