"""Stops, ``/api/v1/control/stops``: begun by the order service, or without it if it does not answer."""

from __future__ import annotations

from http import HTTPStatus
from typing import Final

from fastapi import APIRouter, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from nena_shared.fleet_api.audit import ANONYMOUS
from nena_shared.fleet_api.stops import StopEndRequest, StopRequest
from nena_shared.web.access import user_of
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.control import PREFIX, OrderServiceClient, own_page, read_body
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError, as_json
from nena_status_aggregator.settings import OrderServiceSettings

DIRECT_AFTER: Final = 2.0
"""Seconds after which all robots are paused without the order service."""


def make_router(
    client: OrderServiceClient, settings: OrderServiceSettings, aggregator: Aggregator
) -> APIRouter:
    """Create the routes; include them before those of other commands."""
    router = APIRouter(prefix=PREFIX, tags=["control"], dependencies=[own_page(settings.trusted_hosts)])
    direct = aggregator.direct_stops

    @router.post("/stops")
    async def stop(request: Request) -> Response:
        """Begin a stop. That of all robots pauses them directly if the order service does not answer."""
        body = await read_body(request)
        wanted = _read_stop(body)
        if wanted is None or not (settings.direct_stop and client.enabled):
            return await client.forward(request, body)
        answer = await _answer_within(DIRECT_AFTER, client, request, body)
        # The order service may have stored the stop, but without the broker it reaches no robot.
        is_heard = aggregator.model.order_service.is_up(aggregator.now()) is not False
        if answer and (is_heard or answer.status_code >= HTTPStatus.BAD_REQUEST):
            return answer
        if not direct.can_send:
            detail = "No robot was told to stop: neither the order service nor the MQTT broker can be "
            detail += "reached. Walk to the robots and press their emergency stop buttons."
            raise ProblemError(Rejection.STOP_NOT_SENT, detail)
        return as_json(direct.begin(wanted, _user_of(request)))

    @router.post("/stops/{name}/end")
    async def end_stop(request: Request, name: str) -> Response:
        """End a stop: the robots that it has paused continue, unless another one pauses them."""
        body = await read_body(request)
        active = direct.find(name)
        if active is None:
            return await client.forward(request, body)
        try:
            wanted = StopEndRequest.model_validate_json(body)
        except ValidationError as error:
            raise RequestValidationError(error.errors()) from error
        return as_json(direct.end(active, wanted, _user_of(request)))

    return router


async def _answer_within(
    seconds: float, client: OrderServiceClient, request: Request, body: bytes
) -> Response | None:
    """Return the order service's answer; None without one, or if it cannot execute anything now."""
    try:
        answer = await client.forward(request, body, within=seconds)
    except ProblemError:
        return None
    is_standby = HTTPStatus.MULTIPLE_CHOICES <= answer.status_code < HTTPStatus.BAD_REQUEST
    return None if is_standby or answer.status_code >= HTTPStatus.INTERNAL_SERVER_ERROR else answer


def _read_stop(body: bytes) -> StopRequest | None:
    """Return a request to stop all robots; None for an area, and for what the order service will refuse."""
    try:
        wanted = StopRequest.model_validate_json(body)
    except ValidationError:
        return None
    return None if wanted.area else wanted


def _user_of(request: Request) -> str:
    user = user_of(request.scope)
    return user.known_as if user else ANONYMOUS
