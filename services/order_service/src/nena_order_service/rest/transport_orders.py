"""Transport orders at ``/v1/transportOrders``."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response

from nena_order_service.host_requests import VEHICLES_EXPLAINED, HostRequests
from nena_order_service.rest import responses
from nena_order_service.rest.responses import IfMatch, IfNoneMatch, as_json
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.requests import (
    BY_LIMIT,
    SOMEBODY,
    HoldRequest,
    ResumeRequest,
    TransportOrderPage,
    WithdrawalRequest,
)
from nena_shared.fleet_api.transport_order import (
    AssignmentStatus,
    DeliveryStatus,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.web.access import KnownUser

IdempotencyKey = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


def make_router(requests: HostRequests) -> APIRouter:
    """Make the routes over what hosts may ask for."""
    router = APIRouter(prefix="/v1/transportOrders", tags=["transport orders"])
    _add_creation(router, requests)

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
        return as_json(
            TransportOrderPage(transport_orders=tuple(each.status for each in page), next=following)
        )

    @router.get("/{name}", response_model=TransportOrderStatus)
    async def show(name: str, if_none_match: IfNoneMatch = None) -> Response:
        """Show a transport order with its history; its version is the ETag."""
        return responses.order(await requests.order(name), if_none_match=if_none_match)

    @router.get("/{name}/delivery", response_model=DeliveryStatus)
    async def delivery(name: str) -> Response:
        """Tell how far a transport order has come on its way to its robot."""
        return as_json(await requests.delivery(name))

    @router.get("/{name}/assignment", response_model=AssignmentStatus)
    async def assignment(
        name: str, limit: Annotated[int, Query(ge=1, le=1000)] = VEHICLES_EXPLAINED
    ) -> Response:
        """Tell of each vehicle why it does not do a transport order, or that it could."""
        return as_json(await requests.assignment(name, limit))

    @router.post("/{name}/withdrawal", response_model=TransportOrderStatus)
    async def withdraw(
        name: str, request: WithdrawalRequest | None = None, if_match: IfMatch = None
    ) -> Response:
        """Withdraw a transport order: it fails at once, or when its vehicle has let it go."""
        asked, seen = request or WithdrawalRequest(), responses.seen(if_match)
        order = await requests.withdraw(name, asked.reason, seen=seen, immediate=asked.immediate)
        return responses.order(order)

    _add_holding(router, requests)
    return router


def _add_holding(router: APIRouter, requests: HostRequests) -> None:
    @router.post("/{name}/hold", response_model=TransportOrderStatus)
    async def hold(
        name: str, http: Request, request: HoldRequest | None = None, if_match: IfMatch = None
    ) -> Response:
        """Let a transport order wait until it is resumed; it keeps its vehicle, which stands."""
        asked, seen = request or HoldRequest(), responses.seen(if_match)
        order = await requests.hold(
            name, _who(http, asked.by), asked.reason, seen=seen, immediate=asked.immediate
        )
        return responses.order(order)

    @router.post("/{name}/resume", response_model=TransportOrderStatus)
    async def resume(
        name: str, http: Request, request: ResumeRequest | None = None, if_match: IfMatch = None
    ) -> Response:
        """Let a held transport order go on from where its vehicle stands."""
        asked, seen = request or ResumeRequest(), responses.seen(if_match)
        return responses.order(await requests.resume(name, _who(http, asked.by), asked.reason, seen=seen))


def _who(http: Request, by: str | None) -> str:
    """Name who asks, as far as anybody says; a long subject of an issuer is cut."""
    user: KnownUser | None = getattr(http.state, "user", None)
    return by or (user.known_as[:BY_LIMIT] if user else SOMEBODY)


def _add_creation(router: APIRouter, requests: HostRequests) -> None:
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
        return responses.created(order, new=new)
