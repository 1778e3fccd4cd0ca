"""Order sequences as openTCS's web API has them."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Self

from fastapi import APIRouter, Query, Response
from pydantic import Field, TypeAdapter

from nena_order_service.errors import SequenceNameTakenError
from nena_order_service.host_requests import SequenceRequests
from nena_order_service.rest.opentcs.bodies import Body
from nena_order_service.store.sequences import SequenceFilter
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, OrderSequenceStatus, Property
from nena_shared.fleet_api.vehicle import ANY_TYPE, OrderType

LISTED = 1000
"""Sequences that a list has at most, the newest; openTCS has no pages."""


class OrderSequenceCreation(Body):
    """Asks for an order sequence; its name stands in the path."""

    incomplete_name: bool = False
    type: OrderType | None = None
    """The one type of its orders, as openTCS has it up to 6; ``orderTypes`` counts more."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] | None = None
    intended_vehicle: str | None = None
    failure_fatal: bool = False
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None

    def request(self, name: str) -> OrderSequenceRequest:
        """Give NeNa's own request; raises ValidationError."""
        return OrderSequenceRequest(
            name=name,
            incomplete_name=self.incomplete_name,
            order_types=self.order_types or (self.type or ANY_TYPE,),
            intended_vehicle=self.intended_vehicle,
            failure_fatal=self.failure_fatal,
            properties=self.properties or (),
        )


class OrderSequenceState(Body):
    """An order sequence as it stands."""

    name: str
    type: str
    order_types: tuple[str, ...]
    orders: tuple[str, ...]
    finished_index: int
    complete: bool
    finished: bool
    failure_fatal: bool
    intended_vehicle: str | None
    processing_vehicle: str | None
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, sequence: OrderSequenceStatus) -> Self:
        """Tell it of one of NeNa's sequences."""
        return cls(
            name=sequence.name,
            type=sequence.order_types[0],
            order_types=sequence.order_types,
            orders=sequence.orders,
            finished_index=sequence.finished_index,
            complete=sequence.complete,
            finished=sequence.finished,
            failure_fatal=sequence.failure_fatal,
            intended_vehicle=sequence.intended_vehicle,
            processing_vehicle=sequence.processing_vehicle,
            properties=sequence.properties,
        )


_SEQUENCES = TypeAdapter(list[OrderSequenceState])


def make_router(requests: SequenceRequests) -> APIRouter:
    """Make the routes over what hosts may ask for."""
    router = APIRouter()

    @router.get("", response_model=list[OrderSequenceState])
    async def list_sequences(
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
    ) -> Response:
        found = await requests.sequences(SequenceFilter(intended_vehicle=intended_vehicle, limit=LISTED))
        states = [OrderSequenceState.of(each.status) for each in found]
        return Response(_SEQUENCES.dump_json(states, by_alias=True), media_type="application/json")

    @router.get("/{name}", response_model=OrderSequenceState)
    async def show(name: str) -> Response:
        return _answer(await requests.sequence(name))

    @router.post("/{name}", response_model=OrderSequenceState)
    async def create(name: str, body: OrderSequenceCreation) -> Response:
        sequence, new = await requests.create(body.request(name))
        if not new:
            raise SequenceNameTakenError(name)
        return _answer(sequence)

    @router.put("/{name}/complete", response_class=Response)
    async def complete(name: str) -> Response:
        await requests.complete(name)
        return Response(status_code=HTTPStatus.OK)

    return router


def _answer(sequence: OrderSequenceStatus) -> Response:
    body = OrderSequenceState.of(sequence).model_dump_json(by_alias=True)
    return Response(body, media_type="application/json")
