"""openTCS's web API, version 1, under its own base URL. docs/opentcs-web-api.md lists the routes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from typing import Annotated, Any, Self, TypeVar

from fastapi import FastAPI, Query, Response
from pydantic import BaseModel, Field, TypeAdapter
from starlette.datastructures import Headers
from starlette.types import Scope

from nena_order_service import errors
from nena_order_service.api import opentcs_devices, opentcs_events, opentcs_peripherals, opentcs_plant
from nena_order_service.api.hosts import HostServices
from nena_order_service.api.opentcs_answers import Body, NotPossibleError, angle_of, done, install
from nena_order_service.api.opentcs_audit import AuditedRoutes
from nena_order_service.api.opentcs_events import LAST_MOMENT, ChangeLog, StateTimes
from nena_order_service.api.opentcs_plant import ChangePlant
from nena_order_service.api.orders import OrderOperations
from nena_order_service.api.sequences import SequenceOperations
from nena_order_service.api.vehicles import VehicleOperations
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.store.database import OrderFilter, SequenceFilter
from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api.base import Moment
from nena_shared.fleet_api.requests import InstantActionAnswer, InstantActionRequest, WithdrawalRequest
from nena_shared.fleet_api.transport_order import (
    Destination,
    DriveOrderStatus,
    OrderSequenceRequest,
    OrderSequenceStatus,
    Property,
    TransportOrderRequest,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import (
    ANY_TYPE,
    AcceptableOrderType,
    IntegrationLevel,
    OrderType,
    PrecisePosition,
    ProcessingState,
    ReroutingType,
    VehicleStatus,
)
from nena_shared.log import get_logger
from nena_shared.plant import BoundingBox, PlantModel, Vehicle
from nena_shared.plant.track import MM_PER_M

log = get_logger(__name__)

E = TypeVar("E", bound=Callable[..., Any])


END_OF_TIME = datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)
"""openTCS's value for an order without a deadline, as closely as datetime can represent it."""


class DestinationRequest(Body):
    """A destination of a request."""

    location_name: Annotated[str, Field(min_length=1, max_length=200)]
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "NOP"
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None


class CreationRequest(Body):
    """Request for a transport order; its name is in the path."""

    incomplete_name: bool = False
    deadline: Moment | None = None
    intended_vehicle: str | None = None
    type: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    destinations: Annotated[tuple[DestinationRequest, ...], Field(min_length=1, max_length=100)]
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None
    dependencies: tuple[str, ...] | None = None
    wrapping_sequence: str | None = None
    dispensable: bool = False
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None

    def request(self, name: str) -> dict[str, Any]:
        """Return the body of NeNa's own request, not yet validated."""
        return {
            "name": name,
            "incompleteName": self.incomplete_name,
            "destinations": [
                Destination(
                    location_name=each.location_name,
                    operation=each.operation,
                    properties=each.properties or (),
                )
                for each in self.destinations
            ],
            "intendedVehicle": self.intended_vehicle,
            "type": self.type or TransportOrderRequest.model_fields["type"].default,
            "deadline": self.deadline,
            "dispensable": self.dispensable,
            "peripheralReservationToken": self.peripheral_reservation_token,
            "properties": self.properties or (),
            "dependencies": self.dependencies or (),
            "wrappingSequence": self.wrapping_sequence,
        }


class AcceptableOrderTypes(Body):
    """The types of orders that a vehicle is to accept."""

    acceptable_order_types: Annotated[tuple[AcceptableOrderType, ...], Field(max_length=100)]


class AllowedOrderTypes(Body):
    """The same without priorities, as in openTCS up to 6.0."""

    order_types: Annotated[tuple[OrderType, ...], Field(max_length=100)]

    def acceptable(self) -> tuple[AcceptableOrderType, ...]:
        """Return the types, all with one priority."""
        return tuple(AcceptableOrderType(name=name) for name in dict.fromkeys(self.order_types))


class DestinationState(Body):
    """A destination in its current state."""

    location_name: str
    operation: str
    state: str
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, drive_order: DriveOrderStatus) -> Self:
        """Convert a drive order; a destination by coordinates has no name."""
        destination = drive_order.destination
        return cls(
            location_name=destination.location_name or "",
            operation=destination.operation,
            state=drive_order.state.value,
            properties=tuple(Property(key=each.key, value=each.text) for each in destination.properties),
        )


class TransportOrderState(Body):
    """A transport order in its current state."""

    name: str
    type: str
    state: str
    category: str
    intended_vehicle: str | None
    processing_vehicle: str | None
    dispensable: bool
    peripheral_reservation_token: str | None
    wrapping_sequence: str | None
    dependencies: tuple[str, ...]
    creation_time: Moment
    deadline: Moment
    finished_time: Moment | None
    destinations: tuple[DestinationState, ...]
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, order: TransportOrderStatus) -> Self:
        """Convert one of NeNa's orders."""
        return cls(
            name=order.name,
            type=order.type,
            category=order.type,
            state=order.state.value,
            intended_vehicle=order.intended_vehicle,
            processing_vehicle=order.processing_vehicle,
            dispensable=order.dispensable,
            wrapping_sequence=order.wrapping_sequence,
            dependencies=order.dependencies,
            peripheral_reservation_token=order.peripheral_reservation_token,
            creation_time=order.created,
            deadline=order.deadline or END_OF_TIME,
            finished_time=order.finished,
            destinations=tuple(DestinationState.of(each) for each in order.drive_orders),
            properties=order.properties,
        )


class Triple(Body):
    """A position in mm."""

    x: int
    y: int
    z: int = 0

    @classmethod
    def of(cls, position: PrecisePosition) -> Self:
        """Convert a position to whole mm of the plant's frame."""
        return cls(x=round(position.x * MM_PER_M), y=round(position.y * MM_PER_M))


class Size(Body):
    """Size of a vehicle, mm."""

    length: int
    width: int
    height: int
    reference_offset: dict[str, int]

    @classmethod
    def of(cls, box: BoundingBox) -> Self:
        """Convert the size of a vehicle of the plant model."""
        offset = {"x": box.reference_offset_x_mm, "y": box.reference_offset_y_mm}
        return cls(length=box.length_mm, width=box.width_mm, height=box.height_mm, reference_offset=offset)


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
        model = model or Vehicle(name=status.name)
        position, levels = status.precise_position, model.energy_thresholds
        return cls(
            name=status.name,
            properties=dict(model.properties),
            length=model.bounding_box.length_mm,
            bounding_box=Size.of(model.bounding_box),
            energy_level_good=levels.good,
            energy_level_critical=levels.critical,
            energy_level_sufficiently_recharged=levels.sufficiently_recharged,
            energy_level_fully_recharged=levels.fully_recharged,
            energy_level=round(status.energy_level or 0),
            integration_level=status.integration_level.value,
            proc_state=status.processing_state.value,
            proc_state_timestamp=times.processing_state,
            transport_order=status.transport_order,
            current_position=status.current_position,
            precise_position=Triple.of(position) if position else None,
            acceptable_order_types=status.acceptable_order_types,
            allowed_order_types=tuple(each.name for each in status.acceptable_order_types),
            orientation_angle=angle_of(position),
            state=status.state.value,
            state_timestamp=times.state,
            envelope_key=model.envelope_key,
        )


class OrderSequenceCreation(Body):
    """Request for an order sequence; its name is in the path."""

    incomplete_name: bool = False
    type: OrderType | None = None
    """The only type of its orders, as in openTCS up to 6; ``orderTypes`` takes precedence."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] | None = None
    intended_vehicle: str | None = None
    failure_fatal: bool = False
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None

    def request(self, name: str) -> OrderSequenceRequest:
        """Return NeNa's own request; raises ValidationError."""
        return OrderSequenceRequest(
            name=name,
            incomplete_name=self.incomplete_name,
            order_types=self.order_types or (self.type or ANY_TYPE,),
            intended_vehicle=self.intended_vehicle,
            failure_fatal=self.failure_fatal,
            properties=self.properties or (),
        )


class OrderSequenceState(Body):
    """An order sequence in its current state."""

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
    creation_time: Moment
    finished_time: Moment | str
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, sequence: OrderSequenceStatus) -> Self:
        """Convert one of NeNa's sequences."""
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
            creation_time=sequence.created,
            finished_time=sequence.finished_time or LAST_MOMENT,
            properties=sequence.properties,
        )


_SEQUENCES = TypeAdapter(list[OrderSequenceState])


def _add_sequences(app: FastAPI, requests: SequenceOperations, vehicles: VehicleOperations) -> None:
    @_serve(app, table.LIST_SEQUENCES, response_model=list[OrderSequenceState])
    async def list_sequences(
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
    ) -> Response:
        if intended_vehicle is not None:
            vehicles.vehicle(intended_vehicle)
        found = await requests.sequences(SequenceFilter(intended_vehicle=intended_vehicle, limit=LISTED))
        states = [OrderSequenceState.of(each.status) for each in found]
        return Response(_SEQUENCES.dump_json(states, by_alias=True), media_type="application/json")

    @_serve(app, table.SHOW_SEQUENCE, response_model=OrderSequenceState)
    async def show(name: str) -> Response:
        return _json(OrderSequenceState.of(await requests.sequence(name)))

    @_serve(app, table.CREATE_SEQUENCE, response_model=OrderSequenceState)
    async def create(name: str, body: OrderSequenceCreation) -> Response:
        sequence, new = await requests.create(body.request(name))
        if not new:
            raise errors.NameTakenError(name, "Order sequence")
        return _json(OrderSequenceState.of(sequence))

    @_serve(app, table.COMPLETE_SEQUENCE, response_class=Response)
    async def complete(name: str) -> Response:
        await requests.complete(name)
        return done()


LISTED = 1000
"""Maximum number of orders in a list, the newest ones; openTCS has no pages."""

WITHDRAWAL = WithdrawalRequest(reason="withdrawn by a host of openTCS's web API")

KEY_HEADER = "x-api-access-key"

_VEHICLES = TypeAdapter(list[VehicleState])


def accept_access_key(scope: Scope) -> None:
    """Take openTCS's access key of a request for this program's token."""
    headers = Headers(scope=scope)
    key = headers.get(KEY_HEADER)
    if key and "authorization" not in headers:
        scope["headers"] = [*scope["headers"], (b"authorization", f"Bearer {key}".encode("latin-1"))]


def make_app(
    hosts: HostServices,
    engine: Engine,
    changes: ChangeLog,
    change_plant: ChangePlant,
) -> FastAPI:
    """Create the ASGI application; ``changes`` listens to the engine."""
    app = FastAPI(title="openTCS web API, version 1, as NeNa serves it", docs_url=None, redoc_url=None)
    install(app)
    app.add_middleware(AuditedRoutes, trail=hosts.trail, routes=app.routes)
    _add_dispatcher(app, engine.look)
    _add_orders(app, hosts.orders, hosts.vehicles)
    _add_assignment(app, hosts.orders, engine)
    _add_sequences(app, hosts.sequences, hosts.vehicles)
    _add_vehicles(app, hosts.vehicles, engine.plant, changes)
    _add_paths(app, hosts.locks)
    opentcs_plant.add_routes(app, engine.plant, hosts.locks, change_plant)
    opentcs_devices.add_routes(app, engine)
    opentcs_peripherals.add_routes(app, hosts, engine)
    opentcs_events.add_routes(app, changes)
    return app


def _json(body: BaseModel) -> Response:
    return Response(body.model_dump_json(by_alias=True), media_type="application/json")


def _serve(
    app: FastAPI,
    operation: table.Operation[Any],
    alias: int = 0,
    **options: Any,  # noqa: ANN401 - FastAPI's
) -> Callable[[E], E]:
    """Serve an operation of the table on one of its openTCS routes."""
    method, path = operation.opentcs[alias].split(" ", 1)
    return app.api_route(path, methods=[method], **options)


def _add_dispatcher(app: FastAPI, dispatch: Callable[[], None]) -> None:
    @app.post("/v1/dispatcher/trigger", response_class=Response)
    @app.post("/v1/vehicles/dispatcher/trigger", response_class=Response)
    @app.post("/v1/transportOrders/dispatcher/trigger", response_class=Response)
    async def trigger() -> Response:
        dispatch()
        return done()


def _add_orders(app: FastAPI, requests: OrderOperations, vehicles: VehicleOperations) -> None:
    @_serve(app, table.LIST_ORDERS, response_model=list[TransportOrderState])
    async def list_orders(
        intended_vehicle: Annotated[str | None, Query(alias="intendedVehicle")] = None,
    ) -> Response:
        if intended_vehicle is not None:
            vehicles.vehicle(intended_vehicle)
        wanted = OrderFilter(intended_vehicle=intended_vehicle, limit=LISTED)
        encoded = [
            TransportOrderState.of(each.status).model_dump_json(by_alias=True).encode()
            async for each in requests.orders(wanted)
        ]
        return Response(b"[%s]" % b",".join(encoded), media_type="application/json")

    @_serve(app, table.SHOW_ORDER, response_model=TransportOrderState)
    async def show(name: str) -> Response:
        return _json(TransportOrderState.of(await requests.order(name)))

    @_serve(app, table.CREATE_ORDER, response_model=TransportOrderState)
    async def create(name: str, body: CreationRequest) -> Response:
        order, new = await requests.create(TransportOrderRequest.model_validate(body.request(name)))
        if not new:
            raise errors.NameTakenError(name)
        return _json(TransportOrderState.of(order))

    @_serve(app, table.WITHDRAW, response_class=Response)
    async def withdraw(name: str) -> Response:
        with suppress(errors.OrderEndedError):  # like openTCS: nothing is left to withdraw
            await requests.withdraw(name, WITHDRAWAL)
        return done()

    @_serve(app, table.WITHDRAW, 1, response_class=Response)
    async def withdraw_from_vehicle(name: str) -> Response:
        order = vehicles.vehicle(name).transport_order
        if order is not None:
            await requests.withdraw(order, WITHDRAWAL)
        return done()


def _add_assignment(app: FastAPI, requests: OrderOperations, engine: Engine) -> None:
    @app.put("/v1/transportOrders/{name}/intendedVehicle", response_class=Response)
    async def intend(name: str, vehicle: str | None = None) -> Response:
        try:
            await requests.intend(name, vehicle)
        except errors.OrderAssignedError as error:
            raise NotPossibleError(str(error)) from error
        return done()

    @app.post("/v1/transportOrders/{name}/immediateAssignment", response_class=Response)
    async def assign(name: str) -> Response:
        """Dispatch at once; succeed if this assigns the order to its intended vehicle."""
        order = await requests.order(name)
        reason = _why_not_assigned(order)
        if not reason and order.processing_vehicle != order.intended_vehicle:
            with engine.change():
                engine.state.dispatch_due = True
            await engine.unit_of_work.wait_committed()
            order = await requests.order(name)
            if order.processing_vehicle != order.intended_vehicle:
                reason = f"{order.state}, {order.reason}"
        if reason:
            text = f"Transport order {name!r} cannot be assigned to its intended vehicle: {reason}."
            raise NotPossibleError(text)
        return done()


def _why_not_assigned(order: TransportOrderStatus) -> str:
    """Return why dispatching cannot assign the order; empty if it may."""
    if order.state.final:
        return f"it is {order.state}"
    if order.intended_vehicle is None:
        return "it has no intended vehicle"
    return "" if order.wrapping_sequence is None else "it belongs to a sequence"


def _add_vehicles(app: FastAPI, requests: VehicleOperations, plant: PlantModel, changes: ChangeLog) -> None:
    models = plant.vehicles_by_name

    def state_of(status: VehicleStatus) -> VehicleState:
        return VehicleState.of(status, models.get(status.name), changes.times(status.name))

    @_serve(app, table.LIST_VEHICLES, response_model=list[VehicleState])
    async def list_vehicles(
        proc_state: Annotated[ProcessingState | None, Query(alias="procState")] = None,
    ) -> Response:
        states = [
            state_of(each) for each in requests.vehicles() if proc_state in (None, each.processing_state)
        ]
        return Response(_VEHICLES.dump_json(states, by_alias=True), media_type="application/json")

    @_serve(app, table.SHOW_VEHICLE, response_model=VehicleState)
    async def show(name: str) -> Response:
        return _json(state_of(requests.vehicle(name)))

    @_serve(app, table.REROUTE, response_class=Response)
    async def reroute(name: str, *, forced: bool = False) -> Response:
        with suppress(errors.NotReroutableError):  # as in openTCS, not an error
            await requests.reroute(name, ReroutingType.FORCED if forced else ReroutingType.REGULAR)
        return done()

    @_serve(app, table.INSTANT_ACTION, response_class=Response)
    async def pause(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        request = InstantActionRequest(action_type="pause" if new_value else "resume")
        reply = await requests.instant_action(name, request)
        if isinstance(reply.body, InstantActionAnswer) and reply.body.status == "FAILED":
            raise NotPossibleError(reply.body.reason)
        return done()

    @_serve(app, table.INTEGRATION_LEVEL, response_class=Response)
    async def integrate(name: str, level: Annotated[IntegrationLevel, Query(alias="newValue")]) -> Response:
        await requests.set_integration_level(name, level)
        return done()

    _add_order_types(app, requests)


def _add_order_types(app: FastAPI, requests: VehicleOperations) -> None:
    @_serve(app, table.ORDER_TYPES, response_class=Response)
    async def accept(name: str, body: AcceptableOrderTypes) -> Response:
        await requests.accept_order_types(name, body.acceptable_order_types)
        return done()

    @_serve(app, table.ORDER_TYPES, 1, response_class=Response)
    async def allow(name: str, body: AllowedOrderTypes) -> Response:
        await requests.accept_order_types(name, body.acceptable())
        return done()


def _add_paths(app: FastAPI, locks: PathLocks) -> None:
    @_serve(app, table.LOCK_PATH, response_class=Response)
    async def lock(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        await locks.set(name, locked=new_value)
        return done()
