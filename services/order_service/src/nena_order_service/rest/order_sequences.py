"""Order sequences at ``/v1/orderSequences``."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Query, Response

from nena_order_service.host_requests import ETag, SequenceRequests
from nena_order_service.rest import responses
from nena_order_service.rest.responses import IfMatch, IfNoneMatch, as_json
from nena_order_service.rest.transport_orders import IdempotencyKey
from nena_order_service.store.sequences import SequenceFilter
from nena_shared.fleet_api.requests import OrderSequencePage
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, OrderSequenceStatus


def make_router(requests: SequenceRequests) -> APIRouter:
    """Make the routes over what hosts may ask for."""
    router = APIRouter(prefix="/v1/orderSequences", tags=["order sequences"])
    _add_creation(router, requests)

    @router.get("", response_model=OrderSequencePage)
    async def list_sequences(
        *,
        finished: Annotated[bool | None, Query()] = None,
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 100,
        after: Annotated[str | None, Query(pattern=r"^[0-9]{1,18}$")] = None,
    ) -> Response:
        """List order sequences, newest first."""
        wanted = SequenceFilter(finished, intended_vehicle, int(after) if after else None, limit + 1)
        return as_json(
            OrderSequencePage.of([(e.number, e.status) for e in await requests.sequences(wanted)], limit)
        )

    @router.get("/{name}", response_model=OrderSequenceStatus)
    async def show(name: str, if_none_match: IfNoneMatch = None) -> Response:
        """Show an order sequence with its history; its version is the ETag."""
        sequence = await requests.sequence(name)
        if if_none_match is not None and ETag(if_none_match).fits(sequence.version):
            return Response(status_code=HTTPStatus.NOT_MODIFIED, headers={"ETag": _tag(sequence)})
        return as_json(sequence, ETag=_tag(sequence))

    @router.post("/{name}/completion", response_model=OrderSequenceStatus)
    async def complete(name: str, if_match: IfMatch = None) -> Response:
        """Mark an order sequence complete: no more orders are added, and it ends with the last one."""
        sequence = await requests.complete(name, seen=responses.seen(if_match))
        return as_json(sequence, ETag=_tag(sequence))

    return router


def _add_creation(router: APIRouter, requests: SequenceRequests) -> None:
    made_before = {"model": OrderSequenceStatus, "description": "Made before by the key."}

    @router.post(
        "",
        status_code=HTTPStatus.CREATED,
        response_model=OrderSequenceStatus,
        responses={HTTPStatus.OK: made_before},
    )
    async def create(request: OrderSequenceRequest, idempotency_key: IdempotencyKey = None) -> Response:
        """Create an order sequence; orders are added that name it as their wrappingSequence."""
        if idempotency_key and request.idempotency_key is None:
            request = request.model_copy(update={"idempotency_key": idempotency_key})
        sequence, new = await requests.create(request)
        where = f"/v1/orderSequences/{quote(sequence.name)}"
        status = HTTPStatus.CREATED if new else HTTPStatus.OK
        return as_json(sequence, status, Location=where, ETag=_tag(sequence))


def _tag(sequence: OrderSequenceStatus) -> str:
    return ETag.of(sequence.version).value
