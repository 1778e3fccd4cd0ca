"""Vehicles of openTCS's web API, their drivers and routes, and path locks."""

from __future__ import annotations

from contextlib import suppress
from http import HTTPStatus
from typing import Annotated, Any, Final, Self

from fastapi import FastAPI, Query, Response
from pydantic import Field
from starlette.exceptions import HTTPException

from nena_order_service.api.hosts import HostServices
from nena_order_service.engine.engine import Engine
from nena_order_service.errors import NotReroutableError
from nena_order_service.extensions.opentcs.answers import Body, NotPossibleError
from nena_order_service.extensions.opentcs.events import ChangeLog, StateTimes, angle_of, position_of
from nena_order_service.extensions.opentcs.plant import json_of
from nena_order_service.routing.graph import NoRouteError
from nena_shared.fleet_api.base import Moment
from nena_shared.fleet_api.requests import InstantActionAnswer, InstantActionRequest
from nena_shared.fleet_api.transport_order import Property
from nena_shared.fleet_api.vehicle import (
    AcceptableOrderType,
    IntegrationLevel,
    OrderType,
    ProcessingState,
    ReroutingType,
    VehicleStatus,
)
from nena_shared.log import get_logger
from nena_shared.plant import Vehicle

log = get_logger(__name__)

VEHICLES: Final = "/v1/vehicles"
DRIVER: Final = "nena.vda5050"
"""Name of the only vehicle driver; openTCS names drivers by class."""


class Triple(Body):
    """A position in mm."""

    x: int
    y: int
    z: int = 0


class Size(Body):
    """Size of a vehicle, mm."""

    length: int
    width: int
    height: int
    reference_offset: dict[str, int]


class VehicleState(Body):
    """A vehicle in its current state."""

    name: str
    properties: dict[str, str]
    length: int
    bounding_box: Size
    energy_level_good: int
    energy_level_critical: int
    energy_level_sufficiently_recharged: int
    energy_level_fully_recharged: int
    energy_level: int
    integration_level: str
    paused: bool = False
    proc_state: str
    proc_state_timestamp: Moment
    transport_order: str | None
    current_position: str | None
    precise_position: Triple | None
    orientation_angle: float | str
    """Degrees; ``NaN`` if unknown."""
    state: str
    state_timestamp: Moment
    allocated_resources: tuple[tuple[str, ...], ...] = ()
    claimed_resources: tuple[tuple[str, ...], ...] = ()
    acceptable_order_types: tuple[AcceptableOrderType, ...]
    allowed_order_types: tuple[str, ...]
    """The same, as in openTCS up to 6.0."""
    envelope_key: str | None = None

    @classmethod
    def of(cls, status: VehicleStatus, model: Vehicle | None, times: StateTimes) -> Self:
        """Convert one of NeNa's vehicles, with its entry in the plant model."""
        shown = json_of("vehicle", model or Vehicle(name=status.name))
        return cls.model_validate(
            {
                **shown,
                "properties": dict(model.properties) if model else {},
                "length": shown["boundingBox"]["length"],
                "energyLevel": round(status.energy_level or 0),
                "integrationLevel": status.integration_level.value,
                "procState": status.processing_state.value,
                "procStateTimestamp": times.processing_state,
                "transportOrder": status.transport_order,
                "currentPosition": status.current_position,
                "precisePosition": position_of(status),
                "orientationAngle": angle_of(status),
                "state": status.state.value,
                "stateTimestamp": times.state,
                "acceptableOrderTypes": status.acceptable_order_types,
                "allowedOrderTypes": [accepted.name for accepted in status.acceptable_order_types],
            }
        )


class AcceptableOrderTypes(Body):
    """The types of orders that a vehicle is to accept."""

    acceptable_order_types: Annotated[tuple[AcceptableOrderType, ...], Field(max_length=100)]


class AllowedOrderTypes(Body):
    """The same without priorities, as in openTCS up to 6.0."""

    order_types: Annotated[tuple[OrderType, ...], Field(max_length=100)]


class RoutesRequest(Body):
    """Request for routes of a vehicle."""

    source_point: str | None = None
    destination_points: Annotated[tuple[str, ...], Field(max_length=100)]
    resources_to_avoid: Annotated[tuple[str, ...], Field(max_length=1000)] = ()


class DriverMessage(Body):
    """A message for a vehicle driver, which understands none."""

    type: str
    parameters: tuple[Property, ...]


def add_routes(app: FastAPI, hosts: HostServices, engine: Engine, changes: ChangeLog) -> None:
    """Add the routes of vehicles and paths; ``changes`` has the times of the vehicles' states."""
    models = engine.plant.vehicles_by_name

    def state_of(status: VehicleStatus) -> VehicleState:
        return VehicleState.of(status, models.get(status.name), changes.times_of(status.name))

    @app.get(VEHICLES)
    async def list_vehicles(
        proc_state: Annotated[ProcessingState | None, Query(alias="procState")] = None,
    ) -> list[VehicleState]:
        vehicles = hosts.vehicles.iterate_statuses()
        return [state_of(vehicle) for vehicle in vehicles if proc_state in (None, vehicle.processing_state)]

    _add_commands(app, hosts)
    _add_drivers(app, hosts)
    _add_route_query(app, hosts, engine)

    @app.get(f"{VEHICLES}/{{name:path}}")  # behind the longer paths, which it matches as well
    async def show(name: str) -> VehicleState:
        return state_of(hosts.vehicles.find_status(name))


def _add_commands(app: FastAPI, hosts: HostServices) -> None:
    vehicles = hosts.vehicles

    @app.post(f"{VEHICLES}/{{name:path}}/rerouteRequest", response_class=Response)
    async def reroute(name: str, *, forced: bool = False) -> None:
        with suppress(NotReroutableError):  # as in openTCS, not an error
            await vehicles.reroute_vehicle(name, ReroutingType.FORCED if forced else ReroutingType.REGULAR)

    @app.put(f"{VEHICLES}/{{name:path}}/paused", response_class=Response)
    async def pause(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> None:
        request = InstantActionRequest(action_type="pause" if new_value else "resume")
        reply = await vehicles.send_instant_action(name, request)
        # Not 200, from which hosts would conclude that the robot has stopped.
        if isinstance(reply.body, InstantActionAnswer) and reply.body.status == "FAILED":
            raise NotPossibleError(reply.body.reason)

    @app.put(f"{VEHICLES}/{{name:path}}/integrationLevel", response_class=Response)
    async def integrate(name: str, level: Annotated[IntegrationLevel, Query(alias="newValue")]) -> None:
        # openTCS refuses to ignore or only notice a vehicle with an order; here it gives up its order.
        await vehicles.set_integration_level(name, level)

    @app.put(f"{VEHICLES}/{{name:path}}/acceptableOrderTypes", response_class=Response)
    async def accept(name: str, body: AcceptableOrderTypes) -> None:
        await vehicles.accept_order_types(name, body.acceptable_order_types)

    @app.put(f"{VEHICLES}/{{name:path}}/allowedOrderTypes", response_class=Response)
    async def allow(name: str, body: AllowedOrderTypes) -> None:
        types = tuple(AcceptableOrderType(name=name) for name in dict.fromkeys(body.order_types))
        await vehicles.accept_order_types(name, types)

    @app.put("/v1/paths/{name:path}/locked", response_class=Response)
    async def lock(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> None:
        # Affects routes at once; openTCS waits for a topology update by default.
        await hosts.locks.set(name, locked=new_value)


def _add_drivers(app: FastAPI, hosts: HostServices) -> None:
    """Serve the routes for vehicle drivers: each vehicle has the same one, always."""
    require = hosts.vehicles.find_status

    @app.get(f"{VEHICLES}/{{name:path}}/commAdapter/attachmentInformation")
    async def attachment(name: str) -> dict[str, Any]:
        require(name)
        return {"vehicleName": name, "availableCommAdapters": [DRIVER], "attachedCommAdapter": DRIVER}

    @app.put(f"{VEHICLES}/{{name:path}}/commAdapter/attachment", response_class=Response)
    async def attach(name: str, new_value: Annotated[str, Query(alias="newValue")]) -> None:
        require(name)
        if new_value != DRIVER:
            raise NotPossibleError(f"Unknown vehicle driver class name: {new_value}. There is only {DRIVER}.")

    @app.put(f"{VEHICLES}/{{name:path}}/commAdapter/enabled", response_class=Response)
    async def enable(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> None:
        require(name)
        if not new_value:
            text = f"The driver of vehicle {name!r} is always enabled; set its integrationLevel instead."
            raise NotPossibleError(text)

    @app.post(f"{VEHICLES}/{{name:path}}/commAdapter/message", response_class=Response)
    async def message(name: str, body: DriverMessage) -> None:
        require(name)
        log.info("ignoring a message for a vehicle driver", vehicle=name, message_type=body.type)


def _add_route_query(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    plant = engine.plant

    @app.post(f"{VEHICLES}/{{name:path}}/routeComputationQuery")
    async def routes(name: str, body: RoutesRequest) -> dict[str, Any]:
        """Compute the cheapest route to each point: only one, whatever ``maxRoutesPerDestinationPoint``."""
        position = hosts.vehicles.find_status(name).current_position
        start = body.source_point or position
        if start is None:
            raise NotPossibleError(f"The position of vehicle {name!r} is unknown; name a sourcePoint.")
        resources = {*plant.points_by_name, *plant.paths_by_name, *plant.locations_by_name}
        unknown = [point for point in (start, *body.destination_points) if point not in plant.points_by_name]
        if unknown := [
            *unknown,
            *(resource for resource in body.resources_to_avoid if resource not in resources),
        ]:
            raise HTTPException(HTTPStatus.NOT_FOUND, f"Unknown points or resources: {', '.join(unknown)}")
        return {"routes": [route_to(name, start, end, body) for end in body.destination_points]}

    def route_to(name: str, start: str, end: str, body: RoutesRequest) -> dict[str, Any]:
        model, avoid = plant.vehicles_by_name.get(name), frozenset(body.resources_to_avoid)
        try:
            route = engine.context.finder.router.route(start, end, vehicle=model, avoid=avoid)
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
