"""Vehicle drivers, routes, environmental entities and kernel in openTCS's web API."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from importlib.metadata import version as distribution_version
from typing import Annotated, Any

from fastapi import FastAPI, Query, Response
from pydantic import Field
from starlette.exceptions import HTTPException

from nena_order_service.api.opentcs_answers import Body, NotPossibleError, done
from nena_order_service.engine.engine import Engine
from nena_order_service.errors import UnknownVehicleError
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.transport_order import Property
from nena_shared.log import get_logger

log = get_logger(__name__)

OPENTCS_VERSION = "7.5.0"
"""Release of openTCS whose API documentation is followed."""

DRIVER = "nena.vda5050"
"""Name of the only vehicle driver; openTCS names drivers by class."""


class RoutesRequest(Body):
    """Request for routes of a vehicle."""

    source_point: str | None = None
    destination_points: Annotated[tuple[str, ...], Field(max_length=100)]
    resources_to_avoid: Annotated[tuple[str, ...], Field(max_length=1000)] = ()


class DriverMessage(Body):
    """A message for a vehicle driver, which understands none."""

    type: str
    parameters: tuple[Property, ...]


def _known(engine: Engine, name: str) -> FleetVehicle:
    vehicle = engine.registry.named(name)
    if vehicle is None:
        raise UnknownVehicleError(name)
    return vehicle


def _add_drivers(app: FastAPI, engine: Engine) -> None:
    """Serve the routes for vehicle drivers."""

    @app.get("/v1/vehicles/{name}/commAdapter/attachmentInformation")
    async def attachment(name: str) -> dict[str, Any]:
        _known(engine, name)
        return {"vehicleName": name, "availableCommAdapters": [DRIVER], "attachedCommAdapter": DRIVER}

    @app.put("/v1/vehicles/{name}/commAdapter/attachment", response_class=Response)
    async def attach(name: str, new_value: Annotated[str, Query(alias="newValue")]) -> Response:
        _known(engine, name)
        if new_value != DRIVER:
            text = f"Unknown vehicle driver class name: {new_value}. There is only {DRIVER}."
            raise NotPossibleError(text)
        return done()

    @app.put("/v1/vehicles/{name}/commAdapter/enabled", response_class=Response)
    async def enable(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        _known(engine, name)
        if not new_value:
            text = f"The driver of vehicle {name!r} is always enabled; set its integrationLevel instead."
            raise NotPossibleError(text)
        return done()

    @app.post("/v1/vehicles/{name}/commAdapter/message", response_class=Response)
    async def message(name: str, body: DriverMessage) -> Response:
        _known(engine, name)
        log.info("ignoring a message for a vehicle driver", vehicle=name, message_type=body.type)
        return done()


def _add_routes(app: FastAPI, engine: Engine) -> None:
    @app.post("/v1/vehicles/{name}/routeComputationQuery")
    async def routes(name: str, body: RoutesRequest) -> dict[str, Any]:
        """Compute the cheapest route to each point: only one, whatever ``maxRoutesPerDestinationPoint``."""
        vehicle = _known(engine, name)
        start = body.source_point or engine.status(vehicle).current_position
        if start is None:
            text = f"The position of vehicle {name!r} is unknown; name a sourcePoint."
            raise NotPossibleError(text)
        plant = engine.plant
        known = {*plant.points_by_name, *plant.paths_by_name, *plant.locations_by_name}
        unknown = [each for each in (start, *body.destination_points) if each not in plant.points_by_name]
        if unknown := [*unknown, *(each for each in body.resources_to_avoid if each not in known)]:
            raise HTTPException(HTTPStatus.NOT_FOUND, f"Unknown points or resources: {', '.join(unknown)}")
        avoid = frozenset(body.resources_to_avoid)
        found = []
        for point in body.destination_points:
            found.append(_route(engine, vehicle, start, point, avoid))
            await asyncio.sleep(0)  # each search blocks the event loop
        return {"routes": found}


def _route(
    engine: Engine, vehicle: FleetVehicle, start: str, end: str, avoid: frozenset[str]
) -> dict[str, Any]:
    router = engine.context.finder.router
    try:
        route = router.route(start, end, vehicle=vehicle.model, avoid=avoid)
    except NoRouteError:
        return {"destinationPoint": end, "costs": -1, "steps": None}
    steps = [
        {
            "path": step.path.name,
            "sourcePoint": step.edge.source,
            "destinationPoint": step.destination,
            "vehicleOrientation": step.edge.orientation.value,
        }
        for step in route.steps
    ]
    return {"destinationPoint": end, "costs": round(route.cost), "steps": steps}


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
    async def create_entity(name: str) -> Response:
        text = f"Environmental entity {name!r} cannot be created: NeNa's traffic control has none."
        raise NotPossibleError(text)

    @app.put("/v1/environmentalEntities/{name}/envelope", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/pose", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/integrationLevel", response_class=Response)
    @app.put("/v1/environmentalEntities/{name}/retired", response_class=Response)
    async def change_entity(name: str) -> Response:
        raise none_of(name)


def _add_kernel(app: FastAPI) -> None:
    @app.get("/v1/kernel/version")
    async def version() -> dict[str, str]:
        return {
            "baselineVersion": OPENTCS_VERSION,
            "customizationName": "NeNa",
            "customizationVersion": distribution_version("nena-order-service"),
        }

    @app.delete("/v1/kernel", response_class=Response)
    async def shut_down() -> Response:
        raise HTTPException(HTTPStatus.FORBIDDEN, "Hosts cannot shut down the order service.")


def add_routes(app: FastAPI, engine: Engine) -> None:
    """Add the paths for vehicle drivers, routes, environmental entities and the kernel."""
    _add_drivers(app, engine)
    _add_routes(app, engine)
    _add_environment(app)
    _add_kernel(app)
