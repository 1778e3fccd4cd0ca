"""Vehicles at ``/v1/vehicles``: how they stand, and what counts of them."""

from __future__ import annotations

from itertools import islice
from typing import Annotated

from fastapi import APIRouter, Query, Response

from nena_order_service.errors import UnknownVehicleError
from nena_order_service.host_requests import HostRequests
from nena_order_service.rest.responses import as_json
from nena_shared.fleet_api.base import ObjectName
from nena_shared.fleet_api.requests import IntegrationLevelRequest, OrderTypesRequest, VehicleList
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus


def make_router(requests: HostRequests) -> APIRouter:
    """Make the routes over what hosts may ask for."""
    router = APIRouter(prefix="/v1/vehicles", tags=["vehicles"])

    @router.get("", response_model=VehicleList)
    async def list_vehicles(
        state: Annotated[list[VehicleState] | None, Query()] = None,
        processing_state: Annotated[list[ProcessingState] | None, Query(alias="processingState")] = None,
        limit: Annotated[int, Query(ge=1, le=10_000)] = 10_000,
        after: Annotated[ObjectName | None, Query()] = None,
    ) -> Response:
        """List the vehicles, and robots that are not in the plant model."""
        states, processing = state or tuple(VehicleState), processing_state or tuple(ProcessingState)
        chosen = (each for each in _behind(after, requests) if each.state in states)
        found = [*islice((each for each in chosen if each.processing_state in processing), limit + 1)]
        page = tuple(found[:limit])
        return as_json(VehicleList(vehicles=page, next=page[-1].name if len(found) > limit else None))

    @router.get("/{name}", response_model=VehicleStatus)
    async def show(name: str) -> Response:
        """Show a vehicle."""
        return as_json(requests.vehicle(name))

    @router.put("/{name}/integrationLevel", response_model=VehicleStatus)
    async def integration_level(name: str, request: IntegrationLevelRequest) -> Response:
        """Say how much a vehicle counts: whether it gets orders, and whether others keep away from it."""
        return as_json(await requests.set_integration_level(name, request.integration_level))

    @router.put("/{name}/acceptableOrderTypes", response_model=VehicleStatus)
    async def order_types(name: str, request: OrderTypesRequest) -> Response:
        """Say which types of orders a vehicle accepts; one that it has it does to the end."""
        return as_json(await requests.accept_order_types(name, request.acceptable_order_types))

    return router


def _behind(name: str | None, requests: HostRequests) -> tuple[VehicleStatus, ...]:
    """Give the vehicles behind the one of this name; None: all."""
    vehicles = requests.vehicles()
    if name is None:
        return vehicles
    names = [each.name for each in vehicles]
    if name not in names:
        raise UnknownVehicleError(name)
    return vehicles[names.index(name) + 1 :]
