"""What vehicles are told to do, below ``/v1/vehicles/NAME``."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Response

from nena_order_service import vehicle_commands
from nena_order_service.host_requests import HostRequests
from nena_order_service.rest import responses
from nena_order_service.rest.responses import as_json
from nena_shared.fleet_api.requests import (
    DispatchRequest,
    InstantActionAnswer,
    InstantActionRequest,
    ReroutingRequest,
)
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import ReroutingAnswer


def make_router(requests: HostRequests) -> APIRouter:
    """Make the routes over what hosts may ask for."""
    router = APIRouter(prefix="/v1/vehicles/{name}", tags=["vehicles"])

    @router.post("/dispatch", status_code=HTTPStatus.CREATED, response_model=TransportOrderStatus)
    async def dispatch(name: str, request: DispatchRequest) -> Response:
        """Send a vehicle to a point, location or coordinate, by a transport order that is only for it."""
        order, new = await vehicle_commands.dispatch(requests, name, request)
        return responses.created(order, new=new)

    @router.post(
        "/instantActions",
        response_model=InstantActionAnswer,
        responses={HTTPStatus.ACCEPTED: {"model": InstantActionAnswer, "description": "It goes on."}},
    )
    async def instant_action(name: str, request: InstantActionRequest) -> Response:
        """Let a vehicle do something at once; waits a while for the end of it."""
        answer = await vehicle_commands.instant_action(requests, name, request)
        return as_json(answer, HTTPStatus.ACCEPTED if answer.status == "PENDING" else HTTPStatus.OK)

    @router.post("/rerouting", response_model=ReroutingAnswer)
    async def reroute(name: str, request: ReroutingRequest) -> Response:
        """Plan the way of the order that a vehicle works on anew; what its robot was told to drive stays."""
        return as_json(await requests.reroute(name, request.type))

    return router
