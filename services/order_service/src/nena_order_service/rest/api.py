"""The REST door's resources and methods."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, FastAPI, Header, Query, Response
from pydantic import BaseModel

from nena_order_service.kernel.host_requests import HostRequests
from nena_order_service.rest import problems
from nena_order_service.rest.bodies import (
    DispatchRequest,
    InstantActionAnswer,
    InstantActionRequest,
    Readiness,
    TransportOrderPage,
    VehicleList,
    WithdrawalRequest,
)
from nena_order_service.rest.body_limit import BodyLimit
from nena_order_service.rest.instant_actions import answer_of, parameters_of, type_of
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.transport_order import (
    Problem,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus

PROBLEMS: dict[int | str, dict[str, object]] = {
    "4XX": {"model": Problem, "description": "What is wrong with the request, and what to do."},
    "5XX": {"model": Problem, "description": "What failed, and what to do."},
}

IdempotencyKey = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


def make_app(
    requests: HostRequests, *, plant_json: bytes, readiness: Callable[[], Readiness], max_body: int
) -> FastAPI:
    """Make the ASGI application."""
    app = FastAPI(
        title="NeNa order service",
        description="Transport orders and vehicles. Every error is a problem (RFC 9457).",
        version="1",
        docs_url=None,
        redoc_url=None,
        responses=PROBLEMS,
    )
    app.add_middleware(BodyLimit, limit=max_body)
    problems.install(app)
    app.include_router(_orders(requests), prefix="/v1/transportOrders", tags=["transport orders"])
    app.include_router(_vehicles(requests), prefix="/v1/vehicles", tags=["vehicles"])
    app.include_router(_service(plant_json, readiness))
    return app


def _json(body: BaseModel, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> Response:
    return Response(body.model_dump_json(by_alias=True), status, headers, "application/json")


def _created(order: TransportOrderStatus, *, new: bool) -> Response:
    status = HTTPStatus.CREATED if new else HTTPStatus.OK
    return _json(order, status, Location=f"/v1/transportOrders/{quote(order.name)}")


def _orders(requests: HostRequests) -> APIRouter:
    router = APIRouter()

    @router.post(
        "",
        status_code=HTTPStatus.CREATED,
        response_model=TransportOrderStatus,
        responses={HTTPStatus.OK: {"model": TransportOrderStatus, "description": "Made before by the key."}},
    )
    async def create(request: TransportOrderRequest, idempotency_key: IdempotencyKey = None) -> Response:
        """Create a transport order; it is committed when the answer comes."""
        if idempotency_key and request.idempotency_key is None:
            request = request.model_copy(update={"idempotency_key": idempotency_key})
        order, new = await requests.create(request)
        return _created(order, new=new)

    @router.get("", response_model=TransportOrderPage)
    async def list_orders(
        state: Annotated[list[TransportOrderState] | None, Query()] = None,
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 100,
        after: Annotated[str | None, Query(pattern=r"^[0-9]{1,18}$")] = None,
    ) -> Response:
        """List transport orders, newest first."""
        wanted = OrderFilter(tuple(state or ()), intended_vehicle, int(after) if after else None, limit + 1)
        found = await requests.orders(wanted)
        page = found[:limit]
        following = str(page[-1].number) if len(found) > limit else None
        return _json(TransportOrderPage(transport_orders=tuple(each.status for each in page), next=following))

    @router.get("/{name}", response_model=TransportOrderStatus)
    async def show(name: str) -> Response:
        """Show a transport order with its history."""
        return _json(await requests.order(name))

    @router.post("/{name}/withdrawal", response_model=TransportOrderStatus)
    async def withdraw(name: str, request: WithdrawalRequest | None = None) -> Response:
        """Withdraw a transport order: it fails at once, or when its vehicle has let it go."""
        return _json(await requests.withdraw(name, (request or WithdrawalRequest()).reason))

    return router


def _vehicles(requests: HostRequests) -> APIRouter:
    router = APIRouter()

    @router.get("", response_model=VehicleList)
    async def list_vehicles() -> Response:
        """List the vehicles, and robots that are not in the plant model."""
        return _json(VehicleList(vehicles=requests.vehicles()))

    @router.get("/{name}", response_model=VehicleStatus)
    async def show(name: str) -> Response:
        """Show a vehicle."""
        return _json(requests.vehicle(name))

    @router.post("/{name}/dispatch", status_code=HTTPStatus.CREATED, response_model=TransportOrderStatus)
    async def dispatch(name: str, request: DispatchRequest) -> Response:
        """Send a vehicle to a point, location or coordinate, by a transport order that is only for it."""
        requests.vehicle(name)
        order, new = await requests.create(
            TransportOrderRequest(
                destinations=(request.destination(),),
                intended_vehicle=name,
                priority=request.priority,
                idempotency_key=request.idempotency_key,
            )
        )
        return _created(order, new=new)

    @router.post(
        "/{name}/instantActions",
        response_model=InstantActionAnswer,
        responses={HTTPStatus.ACCEPTED: {"model": InstantActionAnswer, "description": "It goes on."}},
    )
    async def instant_action(name: str, request: InstantActionRequest) -> Response:
        """Let a vehicle do something at once; waits a while for the end of it."""
        parameters = parameters_of(request, requests, name)
        action, end = await requests.instant_action(name, type_of(request), parameters, request.blocking_type)
        return _json(answer_of(action, end), HTTPStatus.OK if end else HTTPStatus.ACCEPTED)

    return router


def _service(plant_json: bytes, readiness: Callable[[], Readiness]) -> APIRouter:
    router = APIRouter()

    @router.get("/v1/plantModel", tags=["plant model"])
    async def plant_model() -> Response:
        """Give the plant model; lengths in mm, angles in degrees."""
        return Response(plant_json, media_type="application/json")

    @router.get("/healthz", tags=["service"])
    async def alive() -> Response:
        """Tell that the process runs."""
        return Response("ok\n", media_type="text/plain")

    @router.get("/readyz", tags=["service"], response_model=Readiness)
    async def ready() -> Response:
        """Tell whether broker and store are there."""
        now = readiness()
        return _json(now, HTTPStatus.OK if now.ready else HTTPStatus.SERVICE_UNAVAILABLE)

    return router
