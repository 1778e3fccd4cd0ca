"""The routes of openTCS's web API that a host uses; mounted where the settings say."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, FastAPI, Query, Response
from pydantic import BaseModel, TypeAdapter
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_order_service import vehicle_commands
from nena_order_service.errors import NameTakenError
from nena_order_service.host_requests import HostRequests, HostServices
from nena_order_service.rest.bodies import InstantActionRequest
from nena_order_service.rest.opentcs import errors, order_sequences
from nena_order_service.rest.opentcs.bodies import (
    AcceptableOrderTypes,
    AllowedOrderTypes,
    CreationRequest,
    TransportOrderState,
    VehicleState,
)
from nena_order_service.rest.opentcs.errors import NotPossibleError
from nena_order_service.routing.path_locks import PathLocks
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.fleet_api.vehicle import ProcessingState, ReroutingType
from nena_shared.plant import PlantModel

LISTED = 1000
"""Orders that a list has at most, the newest; openTCS has no pages."""

REASON = "withdrawn by a host of openTCS's web API"

KEY_HEADER = "x-api-access-key"

_ORDERS = TypeAdapter(list[TransportOrderState])
_VEHICLES = TypeAdapter(list[VehicleState])


class AccessKey:
    """ASGI middleware: takes openTCS's key for the token that this program asks for."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, with its key as its token."""
        if scope["type"] == "http":
            headers = MutableHeaders(scope=scope)
            key = headers.get(KEY_HEADER)
            if key and "authorization" not in headers:
                headers["authorization"] = f"Bearer {key}"
        await self._app(scope, receive, send)


def make_app(
    hosts: HostServices,
    *,
    plant: PlantModel,
    dispatch: Callable[[], None],
) -> FastAPI:
    """Make the ASGI application; ``dispatch`` has the dispatcher look again."""
    app = FastAPI(title="openTCS web API, version 1, as NeNa serves it", docs_url=None, redoc_url=None)
    errors.install(app)
    app.include_router(_orders(hosts.requests, dispatch), prefix="/v1/transportOrders")
    app.include_router(order_sequences.make_router(hosts.sequences), prefix="/v1/orderSequences")
    app.include_router(_vehicles(hosts.requests, plant), prefix="/v1/vehicles")
    app.include_router(_plant(hosts.locks, dispatch), prefix="/v1")
    return app


def _json(body: BaseModel) -> Response:
    return Response(body.model_dump_json(by_alias=True), media_type="application/json")


def _done() -> Response:
    return Response(status_code=HTTPStatus.OK)


def _orders(requests: HostRequests, dispatch: Callable[[], None]) -> APIRouter:
    router = APIRouter()

    @router.get("", response_model=list[TransportOrderState])
    async def list_orders(
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
    ) -> Response:
        found = await requests.orders(OrderFilter(intended_vehicle=intended_vehicle, limit=LISTED))
        orders = [TransportOrderState.of(each.status) for each in found]
        return Response(_ORDERS.dump_json(orders, by_alias=True), media_type="application/json")

    @router.post("/dispatcher/trigger", response_class=Response)
    async def trigger() -> Response:
        dispatch()
        return _done()

    @router.get("/{name}", response_model=TransportOrderState)
    async def show(name: str) -> Response:
        return _json(TransportOrderState.of(await requests.order(name)))

    @router.post("/{name}", response_model=TransportOrderState)
    async def create(name: str, body: CreationRequest) -> Response:
        order, new = await requests.create(TransportOrderRequest.model_validate(body.request(name)))
        if not new:
            raise NameTakenError(name)
        return _json(TransportOrderState.of(order))

    @router.post("/{name}/withdrawal", response_class=Response)
    async def withdraw(name: str) -> Response:
        await requests.withdraw(name, REASON)
        return _done()

    return router


def _vehicles(requests: HostRequests, plant: PlantModel) -> APIRouter:
    router = APIRouter()
    models = {vehicle.name: vehicle for vehicle in plant.vehicles}

    @router.get("", response_model=list[VehicleState])
    async def list_vehicles(
        proc_state: Annotated[ProcessingState | None, Query(alias="procState")] = None,
    ) -> Response:
        chosen = (v for v in requests.vehicles() if proc_state in (None, v.processing_state))
        states = [VehicleState.of(each, models.get(each.name)) for each in chosen]
        return Response(_VEHICLES.dump_json(states, by_alias=True), media_type="application/json")

    @router.get("/{name}", response_model=VehicleState)
    async def show(name: str) -> Response:
        return _json(VehicleState.of(requests.vehicle(name), models.get(name)))

    @router.post("/{name}/withdrawal", response_class=Response)
    async def withdraw(name: str) -> Response:
        order = requests.vehicle(name).transport_order
        if order is not None:
            await requests.withdraw(order, REASON)
        return _done()

    @router.post("/{name}/rerouteRequest", response_class=Response)
    async def reroute(name: str, *, forced: bool = False) -> Response:
        await requests.reroute(name, ReroutingType.FORCED if forced else ReroutingType.REGULAR)
        return _done()

    @router.put("/{name}/paused", response_class=Response)
    async def pause(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        request = InstantActionRequest(action_type="pause" if new_value else "resume")
        told = await vehicle_commands.instant_action(requests, name, request)
        if told.status == "FAILED":
            raise NotPossibleError(told.reason)
        return _done()

    _add_order_types(router, requests)
    return router


def _add_order_types(router: APIRouter, requests: HostRequests) -> None:
    @router.put("/{name}/acceptableOrderTypes", response_class=Response)
    async def accept(name: str, body: AcceptableOrderTypes) -> Response:
        await requests.accept_order_types(name, body.acceptable_order_types)
        return _done()

    @router.put("/{name}/allowedOrderTypes", response_class=Response)
    async def allow(name: str, body: AllowedOrderTypes) -> Response:
        await requests.accept_order_types(name, body.acceptable())
        return _done()


def _plant(locks: PathLocks, dispatch: Callable[[], None]) -> APIRouter:
    router = APIRouter()

    @router.post("/dispatcher/trigger", response_class=Response)
    async def trigger() -> Response:
        dispatch()
        return _done()

    @router.put("/paths/{name:path}/locked", response_class=Response)
    async def lock(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        await locks.set(name, locked=new_value)
        return _done()

    return router
