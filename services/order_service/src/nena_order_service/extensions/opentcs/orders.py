"""Transport orders and order sequences of openTCS's web API."""

from __future__ import annotations

from contextlib import suppress
from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import FastAPI, Query, Response
from pydantic import AliasPath, BeforeValidator, ConfigDict, Field

from nena_order_service import errors
from nena_order_service.api.hosts import HostServices
from nena_order_service.engine.engine import Engine
from nena_order_service.extensions.opentcs.answers import Body, NotPossibleError
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.base import Moment
from nena_shared.fleet_api.requests import OrderChange, OrderSequencesQuery, WithdrawalRequest
from nena_shared.fleet_api.transport_order import (
    OrderSequenceRequest,
    Property,
    TransportOrderRequest,
)
from nena_shared.fleet_api.vehicle import ANY_TYPE, OrderType

ORDERS: Final = "/v1/transportOrders"
SEQUENCES: Final = "/v1/orderSequences"
LISTED: Final = 1000
"""Maximum number of orders in a list, the newest ones; openTCS has no pages."""
WITHDRAWAL: Final = WithdrawalRequest(reason="withdrawn by a host of openTCS's web API")
LAST_MOMENT: Final = "9999-12-31T23:59:59.000Z"
"""openTCS's value for a time that has not been reached, as closely as it can be written."""
END_OF_TIME: Final = datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)
"""The same for an order without a deadline, as closely as datetime can represent it."""

IntendedVehicle = Annotated[str | None, Query(alias="intendedVehicle")]
Properties = Annotated[tuple[Property, ...], Field(max_length=100)]


class DestinationRequest(Body):
    """A destination of a request."""

    location_name: Annotated[str, Field(min_length=1, max_length=200)]
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "NOP"
    properties: Properties | None = None


class CreationRequest(Body):
    """Request for a transport order; its name is in the path."""

    incomplete_name: bool = False
    deadline: Moment | None = None
    intended_vehicle: str | None = None
    type: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    destinations: Annotated[tuple[DestinationRequest, ...], Field(min_length=1, max_length=100)]
    properties: Properties | None = None
    dependencies: tuple[str, ...] | None = None
    wrapping_sequence: str | None = None
    dispensable: bool = False
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None


class OrderSequenceCreation(Body):
    """Request for an order sequence; its name is in the path."""

    incomplete_name: bool = False
    type: OrderType | None = None
    """The only type of its orders, as in openTCS up to 6; ``orderTypes`` takes precedence."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] | None = None
    intended_vehicle: str | None = None
    failure_fatal: bool = False
    properties: Properties | None = None


class State(Body):
    """An object in its current state, converted from NeNa's by the names of its fields."""

    model_config = ConfigDict(from_attributes=True)


class DestinationState(State):
    """A destination in its current state; one by coordinates has no name."""

    location_name: Annotated[str, BeforeValidator(lambda name: name or "")] = Field(
        validation_alias=AliasPath("destination", "location_name")
    )
    operation: str = Field(validation_alias=AliasPath("destination", "operation"))
    state: str
    properties: Annotated[
        tuple[Property, ...],
        # Values are of any JSON type in NeNa, and text in openTCS.
        BeforeValidator(lambda items: [Property(key=item.key, value=item.text) for item in items]),
    ] = Field(validation_alias=AliasPath("destination", "properties"))


class TransportOrderState(State):
    """A transport order in its current state."""

    name: str
    type: str
    state: str
    category: str = Field(validation_alias="type")
    intended_vehicle: str | None
    processing_vehicle: str | None
    dispensable: bool
    peripheral_reservation_token: str | None
    wrapping_sequence: str | None
    dependencies: tuple[str, ...]
    creation_time: Moment = Field(validation_alias="created")
    deadline: Annotated[Moment, BeforeValidator(lambda time: time or END_OF_TIME)]
    finished_time: Moment | None = Field(validation_alias="finished")
    destinations: tuple[DestinationState, ...] = Field(validation_alias="drive_orders")
    properties: tuple[Property, ...]


class OrderSequenceState(State):
    """An order sequence in its current state."""

    name: str
    type: str = Field(validation_alias=AliasPath("order_types", 0))
    order_types: tuple[str, ...]
    orders: tuple[str, ...]
    finished_index: int
    complete: bool
    finished: bool
    failure_fatal: bool
    intended_vehicle: str | None
    processing_vehicle: str | None
    creation_time: Moment = Field(validation_alias="created")
    finished_time: Annotated[Moment | str, BeforeValidator(lambda time: time or LAST_MOMENT)]
    properties: tuple[Property, ...]


def add_routes(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    """Add the routes of transport orders and order sequences."""
    _add_orders(app, hosts)
    _add_assignment(app, hosts, engine)
    _add_sequences(app, hosts, engine)


def _add_orders(app: FastAPI, hosts: HostServices) -> None:
    @app.get(ORDERS)
    async def list_orders(intended_vehicle: IntendedVehicle = None) -> list[TransportOrderState]:
        if intended_vehicle is not None:
            hosts.vehicles.find_status(intended_vehicle)
        wanted = OrderFilter(intended_vehicle=intended_vehicle, limit=LISTED)
        return [
            TransportOrderState.model_validate(order.status)
            async for order in hosts.orders.iterate_orders(wanted)
        ]

    @app.get(f"{ORDERS}/{{name}}")
    async def show(name: str) -> TransportOrderState:
        return TransportOrderState.model_validate(await hosts.orders.find_status(name))

    @app.post(f"{ORDERS}/{{name}}")
    async def create(name: str, body: CreationRequest) -> TransportOrderState:
        request = TransportOrderRequest.model_validate({"name": name, **body.model_dump(exclude_none=True)})
        order, new = await hosts.orders.create_order(request, "openTCS")
        if not new:
            # openTCS: a name that is taken is 409, even by the same request.
            raise errors.NameTakenError(name)
        return TransportOrderState.model_validate(order)

    @app.post(f"{ORDERS}/{{name}}/withdrawal", response_class=Response)
    async def withdraw(name: str) -> None:
        # openTCS's immediate is ignored: it frees resources of a vehicle that still moves.
        with suppress(errors.OrderEndedError):  # like openTCS: nothing is left to withdraw
            await hosts.orders.withdraw_order(name, WITHDRAWAL)

    @app.post("/v1/vehicles/{name:path}/withdrawal", response_class=Response)
    async def withdraw_from_vehicle(name: str) -> None:
        order = hosts.vehicles.find_status(name).transport_order
        if order is not None:
            await hosts.orders.withdraw_order(order, WITHDRAWAL)


def _add_assignment(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    @app.put(f"{ORDERS}/{{name}}/intendedVehicle", response_class=Response)
    async def intend(name: str, vehicle: str | None = None) -> None:
        try:
            await hosts.orders.change_order(name, OrderChange(intended_vehicle=vehicle))
        except errors.OrderAssignedError as error:
            raise NotPossibleError(str(error)) from error

    @app.post(f"{ORDERS}/{{name}}/immediateAssignment", response_class=Response)
    async def assign(name: str) -> None:
        """Dispatch at once; succeed if this assigns the order to its intended vehicle."""
        order = await hosts.orders.find_status(name)
        reason = ""
        if order.state.final:
            reason = f"it is {order.state}"
        elif order.intended_vehicle is None:
            reason = "it has no intended vehicle"
        elif order.wrapping_sequence is not None:
            reason = "it belongs to a sequence"
        if not reason and order.processing_vehicle != order.intended_vehicle:
            # A run decides about all orders and vehicles; whether this one has won shows afterwards.
            engine.run_checks()
            await engine.unit_of_work.wait_committed()
            order = await hosts.orders.find_status(name)
            if order.processing_vehicle != order.intended_vehicle:
                reason = f"{order.state}, {order.reason}"
        if reason:
            text = f"Transport order {name!r} cannot be assigned to its intended vehicle: {reason}."
            raise NotPossibleError(text)


def _add_sequences(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    @app.get(SEQUENCES)
    async def list_sequences(intended_vehicle: IntendedVehicle = None) -> list[OrderSequenceState]:
        if intended_vehicle is not None:
            hosts.vehicles.find_status(intended_vehicle)
        wanted = OrderSequencesQuery(intended_vehicle=intended_vehicle, limit=LISTED)
        return [
            OrderSequenceState.model_validate(sequence.status)
            for sequence in await engine.store.read_sequences(wanted)
        ]

    @app.get(f"{SEQUENCES}/{{name}}")
    async def show(name: str) -> OrderSequenceState:
        return OrderSequenceState.model_validate(await hosts.sequences.find_status(name))

    @app.post(f"{SEQUENCES}/{{name}}")
    async def create(name: str, body: OrderSequenceCreation) -> OrderSequenceState:
        request = OrderSequenceRequest(
            name=name,
            order_types=body.order_types or (body.type or ANY_TYPE,),
            **body.model_dump(exclude={"type", "order_types"}, exclude_none=True),
        )
        sequence, new = await hosts.sequences.create_sequence(request)
        if not new:
            raise errors.NameTakenError(name, "Order sequence")
        return OrderSequenceState.model_validate(sequence)

    @app.put(f"{SEQUENCES}/{{name}}/complete", response_class=Response)
    async def complete(name: str) -> None:
        await hosts.sequences.complete_sequence(name)
