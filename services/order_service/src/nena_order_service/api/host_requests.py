"""Requests of hosts, shared by REST and MQTT. An answer means that the change is committed."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from math import hypot

from nena_order_service import errors
from nena_order_service.api.audit import Trail
from nena_order_service.api.decisions import RecordingRequests
from nena_order_service.api.peripheral_requests import PeripheralRequests
from nena_order_service.api.place_requests import PlaceRequests
from nena_order_service.api.stop_requests import StopRequests
from nena_order_service.api.webhooks import Webhooks
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.engine.schedules import Schedules
from nena_order_service.engine.stops import STOP_PAUSE
from nena_order_service.engine.zone_sets import ZoneSets
from nena_order_service.fleet.instant_actions import LEAVES, START_PAUSE
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import NOT_REACHED, LinkStatus, RobotView, VdaOrderPhase
from nena_order_service.fleet.vda_order import order_id, unique_id
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder, sortable_id
from nena_order_service.orders.validation import InvalidRequestError, check_request, set_operations
from nena_order_service.store.database import OrderFilter, SequenceFilter
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import explained
from nena_shared.fleet_api.requests import FleetSummary
from nena_shared.fleet_api.traffic import TrafficPlan
from nena_shared.fleet_api.transport_order import (
    AssignmentStatus,
    DeliveryPhase,
    DeliveryStatus,
    OrderSequenceRequest,
    OrderSequenceStatus,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
    VehicleForOrder,
)
from nena_shared.fleet_api.vehicle import (
    AcceptableOrderType,
    IntegrationLevel,
    ReroutingAnswer,
    ReroutingType,
    VehicleStatus,
)
from nena_shared.log import get_logger
from nena_shared.plant import MapPose, PlantPose, Point
from nena_shared.vda5050.action import STOP_HIBERNATION, Action, ActionParameter, BlockingType

log = get_logger(__name__)

ANY = "*"

STATUSES_AT_ONCE = 50
"""Number of vehicles checked before other tasks run; each takes about 0.1 ms."""

ORDERS_AT_ONCE = 25
"""Number of orders of a page that are read and encoded before other tasks run: each takes about 0.2 ms
and, as a model, about 11 kB."""


@dataclass(frozen=True, slots=True)
class ETag:
    """Value of a header If-Match or If-None-Match: one tag, several separated by commas, or ``*`` for any."""

    value: str

    @classmethod
    def of(cls, version: int) -> ETag:
        """Return the tag of a version."""
        return cls(f'"{version}"')

    def fits(self, version: int) -> bool:
        """Return whether this version is among the named ones."""
        named = {part.strip().removeprefix("W/") for part in self.value.split(",")}
        return bool(named & {ANY, f'"{version}"'})

    def __str__(self) -> str:
        return self.value


PHASES = {
    VdaOrderPhase.WAITING: DeliveryPhase.WAITING,
    VdaOrderPhase.SENT: DeliveryPhase.SENT,
    VdaOrderPhase.RUNNING: DeliveryPhase.DELIVERED,
    VdaOrderPhase.CANCELLING: DeliveryPhase.CANCELLING,
}


def delivery_status(order: TransportOrderStatus, view: RobotView | None) -> DeliveryStatus:
    """Return the progress of an order's delivery; ``view`` None: no vehicle has it, or its robot is gone."""
    first = order_id(order.name, order.current_drive_order_index)
    own = view.order_id if view else None
    tried = own is not None and (own == first or own.startswith(f"{first}~"))
    if order.state.final or not tried or view is None or view.order_phase is None:
        return DeliveryStatus(transport_order=order.name, phase=DeliveryPhase.NONE)
    echoed = view.state is not None and view.state.order_id == own
    return DeliveryStatus(
        transport_order=order.name,
        phase=PHASES[view.order_phase],
        vehicle=order.processing_vehicle,
        order_id=own,
        echoed_update_id=view.state.order_update_id if view.state and echoed else None,
        note=view.wait_reason,
    )


ORDER_PREFIX = "TOrder"

VEHICLES_EXPLAINED = 100
"""Default number of vehicles for which an order's assignment is explained."""


@dataclass(frozen=True, slots=True)
class RobotPose:
    """A pose (m, rad) on a robot's map, and the plant's point at it; empty if there is none."""

    pose: MapPose
    map_id: str
    point: str


Creation = tuple[TransportOrderStatus | None, bool]
"""An order, and whether it is new; None: it could be created."""
Refused = InvalidRequestError | errors.RefusedError
CREATED_AT_ONCE = 10
"""Number of orders of a batch created before other tasks run; each takes about 2 ms."""


@dataclass(slots=True)
class _Earlier:
    """The requests of a batch that were accepted, by name and by key."""

    names: dict[str, TransportOrderRequest] = field(default_factory=dict)
    keys: dict[str, TransportOrderRequest] = field(default_factory=dict)

    def add(self, request: TransportOrderRequest) -> None:
        if request.name and not _is_prefix(request):
            self.names.setdefault(request.name, request)
        if request.idempotency_key:
            self.keys.setdefault(request.idempotency_key, request)

    def has(self, request: TransportOrderRequest) -> bool:
        """Return whether the same request was accepted; raises an error for a used name or key."""
        key, name = request.idempotency_key, request.name
        if key and key in self.keys:
            if self.keys[key] != request:
                raise errors.KeyReusedError(key, self.keys[key].name or "an earlier order of the batch")
            return True
        if name and not _is_prefix(request) and name in self.names:
            if key or self.names[name] != request:
                raise errors.NameTakenError(name)
            return True
        return False


class HostRequests:
    """Executes requests about orders and vehicles; changes are committed before the answer.

    Every method may raise the errors in :mod:`nena_order_service.errors`.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    async def create(self, request: TransportOrderRequest) -> tuple[TransportOrderStatus, bool]:
        """Create an order; return it with False if the same request created it before.

        The same request has the same idempotency key, or without one the same name.

        Raises:
            InvalidRequestError: the request does not fit the plant model.

        """
        order, new = await self._create(request)
        try:
            await self._engine.unit_of_work.wait_committed()
        finally:  # a robot must not wait for its order while the log is written
            if new:
                log.info("order created", order=order.name, state=order.state.value)
        return self._visible(order), new

    async def create_all(
        self, requests: Sequence[TransportOrderRequest], *, check_only: bool
    ) -> list[Creation | Refused]:
        """Create several orders in this order; return for each what :meth:`create` returns or raises.

        With ``check_only`` none is created. All are in one commit, or in a few.

        Raises:
            StoreNotReadyError: some may be lost; repeat all with their idempotency keys.

        """
        self._engine.unit_of_work.require_store()
        made: list[tuple[TransportOrder | None, bool] | Refused] = []
        earlier = _Earlier()
        for number, each in enumerate(requests):
            if number % CREATED_AT_ONCE == 0:
                await asyncio.sleep(0)
            try:
                made.append(await (self._check(each, earlier) if check_only else self._create(each)))
            except errors.StoreNotReadyError:
                raise
            except (InvalidRequestError, errors.RefusedError) as error:
                made.append(error)
            else:
                earlier.add(each)
        await self._engine.unit_of_work.wait_committed()
        if not check_only:
            new = sum(not isinstance(each, Exception) and each[1] for each in made)
            refused = sum(isinstance(each, Exception) for each in made)
            log.info("orders created", new=new, known=len(made) - new - refused, refused=refused)
        return [each if isinstance(each, Exception) else self._creation(*each) for each in made]

    def _creation(self, order: TransportOrder | None, new: bool) -> Creation:  # noqa: FBT001 - of a pair
        return None if order is None else self._visible(order), new

    async def _create(self, request: TransportOrderRequest) -> tuple[TransportOrder, bool]:
        """Create an order without waiting for the commit."""
        request, name, known = await self._prepared(request)
        if known is not None:
            return known, False
        ended = await self._ended_dependencies(request)
        await self._check_sequence(request)
        known = self._in_memory(None if _is_prefix(request) else name, request.idempotency_key)
        if known is not None:  # the same request arrived meanwhile
            _check_known(known, request)
            return known, False
        self._engine.unit_of_work.require_store()
        return self._engine.create(request, name, ended), True

    async def _check(
        self, request: TransportOrderRequest, earlier: _Earlier
    ) -> tuple[TransportOrder | None, bool]:
        """Check whether an order could be created after ``earlier`` ones that are not created either."""
        prepared, _, known = await self._prepared(request)
        if known is None and not earlier.has(request):
            others = tuple(each for each in request.dependencies if each not in earlier.names)
            await self._ended_dependencies(prepared.model_copy(update={"dependencies": others}))
            await self._check_sequence(prepared)
        return known, False

    async def _prepared(
        self, request: TransportOrderRequest
    ) -> tuple[TransportOrderRequest, str, TransportOrder | None]:
        """Return a valid request with its operations, the order's name, and the order that it has created."""
        request = set_operations(request, self._engine.plant)
        check_request(request, self._engine.plant, self._engine.registry.names())
        name = request.name or ORDER_PREFIX
        known = await self._find(None if _is_prefix(request) else name, request.idempotency_key)
        if known is not None:
            _check_known(known, request)
        return request, f"{name}-{sortable_id()}" if _is_prefix(request) else name, known

    async def withdraw(
        self, name: str, reason: str, *, seen: ETag | None = None, immediate: bool = True
    ) -> TransportOrderStatus:
        """Withdraw an order: it fails at once, or once its vehicle has released it.

        Only if the order is unchanged since the caller has ``seen`` it; None: unconditionally. Unless
        ``immediate``, its vehicle drives to the end of its base.
        """
        order = await self._unfinished(name, seen)
        self._engine.withdraw(order.number, reason, immediate=immediate)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(order)

    async def hold(
        self, name: str, by: str, reason: str, *, seen: ETag | None = None, immediate: bool = True
    ) -> TransportOrderStatus:
        """Hold an order until it is resumed; an order that is already held keeps its holder.

        ``seen`` and ``immediate`` are as in :meth:`withdraw`.
        """
        order = await self._unfinished(name, seen)
        if order.state is TransportOrderState.WITHDRAWN:
            raise errors.OrderWithdrawnError(name)
        self._engine.hold(order.number, by, reason, immediate=immediate)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(order)

    async def resume(
        self, name: str, by: str, reason: str, *, seen: ETag | None = None
    ) -> TransportOrderStatus:
        """Resume a held order; an order that is not held stays unchanged. ``seen`` as in :meth:`withdraw`."""
        order = await self._unfinished(name, seen)
        self._engine.resume(order.number, by, reason)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(order)

    async def intend(self, name: str, vehicle: str | None) -> TransportOrderStatus:
        """Set the intended vehicle of an unassigned order; None: any vehicle.

        Raises:
            OrderAssignedError: a vehicle has it, or the order belongs to a sequence.
        """
        order = await self._unfinished(name, None)
        if vehicle is not None:
            self._vehicle(vehicle)
        if order.state not in (TransportOrderState.ACTIVE, TransportOrderState.DISPATCHABLE):
            raise errors.OrderAssignedError(name, f"it is {order.state}")
        if order.status.wrapping_sequence is not None:
            raise errors.OrderAssignedError(
                name, f"it belongs to sequence {order.status.wrapping_sequence!r}"
            )
        self._engine.intend(order.number, vehicle)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(order)

    async def order(self, name: str) -> TransportOrderStatus:
        """Return an order."""
        found = self._engine.state.orders.visible_named(name) or await self._engine.store.order(name=name)
        if found is None:
            raise errors.UnknownOrderError(name)
        return found.status

    async def orders(
        self, wanted: OrderFilter, since: datetime | None = None, until: datetime | None = None
    ) -> AsyncIterator[TransportOrder]:
        """Yield the orders of a page, newest first; only some of them are in memory at a time.

        ``since`` and ``until`` select by time of creation, as :func:`read_number_at` finds it.
        """
        before, left = wanted.before, wanted.limit
        if since is not None:
            wanted = replace(wanted, first=await self._engine.store.order_number_at(since))
        if until is not None:
            end = await self._engine.store.order_number_at(until)
            before = end if before is None else min(before, end)
        while left > 0:
            asked = min(left, ORDERS_AT_ONCE)
            found = await self._engine.store.orders(replace(wanted, before=before, limit=asked))
            for each in found:
                yield each
            if len(found) < asked:
                return
            before, left = found[-1].number, left - asked

    async def delivery(self, name: str) -> DeliveryStatus:
        """Return the progress of an order's delivery to its robot."""
        order = await self.order(name)
        vehicle = self._engine.registry.named(order.processing_vehicle)
        return delivery_status(order, self._engine.view(vehicle) if vehicle else None)

    async def assignment(self, name: str, limit: int = VEHICLES_EXPLAINED) -> AssignmentStatus:
        """Return why vehicles do not execute an order, for at most ``limit`` vehicles."""
        status, order = await self.order(name), self._engine.state.orders.named(name)
        found = [] if order is None or order.state.final else await self._engine.explain(order)
        return AssignmentStatus(
            transport_order=status.name,
            state=status.state,
            reason=status.reason,
            coded_reason=status.coded_reason,
            processing_vehicle=status.processing_vehicle,
            vehicles=tuple(
                VehicleForOrder(
                    vehicle=each.vehicle, fits=each.fits, cost=each.cost, **explained(each.reason)
                )
                for each in found[:limit]
            ),
            left_out=len(found[limit:]),
        )

    async def vehicles(self, after: str | None = None) -> AsyncIterator[VehicleStatus]:
        """Yield all vehicles, or those after the one named ``after``; other tasks run in between."""
        vehicles = [*self._engine.registry]
        start = vehicles.index(self._vehicle(after)) + 1 if after is not None else 0
        for place, vehicle in enumerate(vehicles[start:], 1):
            yield self._engine.status(vehicle)
            if place % STATUSES_AT_ONCE == 0:
                await asyncio.sleep(0)

    def vehicle(self, name: str) -> VehicleStatus:
        """Return a vehicle."""
        return self._engine.status(self._vehicle(name))

    async def summary(self) -> FleetSummary:
        """Return the numbers of unfinished orders and of vehicles in each state."""
        orders = list(self._engine.state.orders.unfinished())
        oldest = min(orders, key=lambda order: order.number, default=None)
        return FleetSummary(
            transport_orders=Counter(order.state for order in orders),
            vehicles=Counter([vehicle.state async for vehicle in self.vehicles()]),
            oldest_order=oldest.name if oldest else None,
        )

    async def traffic_plan(self) -> TrafficPlan:
        """Return where vehicles are expected in the next minute, and which vehicles they wait for."""
        return await self._engine.traffic_plan()

    async def set_integration_level(self, name: str, level: IntegrationLevel) -> VehicleStatus:
        """Set the integration level of a vehicle; it survives restarts."""
        vehicle = self._vehicle(name)
        self._engine.unit_of_work.require_store()
        self._engine.set_integration_level(vehicle, level)
        await self._engine.unit_of_work.wait_committed()
        return self._engine.status(vehicle)

    async def accept_order_types(self, name: str, types: tuple[AcceptableOrderType, ...]) -> VehicleStatus:
        """Set the order types that a vehicle accepts; they survive restarts."""
        vehicle = self._vehicle(name)
        self._engine.unit_of_work.require_store()
        self._engine.accept_order_types(vehicle, types)
        await self._engine.unit_of_work.wait_committed()
        return self._engine.status(vehicle)

    async def reroute(self, name: str, kind: ReroutingType) -> ReroutingAnswer:
        """Replan the route of the order that a vehicle works on; see :meth:`Rerouting.request`."""
        vehicle = self._vehicle(name)
        self._engine.unit_of_work.require_store()
        done = self._engine.reroute(vehicle, kind)
        order = self._engine.status(vehicle).transport_order
        await self._engine.unit_of_work.wait_committed()
        return ReroutingAnswer(
            vehicle=name,
            transport_order=order or "",
            outcome=done.outcome,
            **explained(done.reason),
            route=done.route,
        )

    async def instant_action(
        self,
        name: str,
        action_type: str,
        parameters: tuple[ActionParameter, ...] = (),
        blocking_type: BlockingType = BlockingType.NONE,
    ) -> tuple[Action, InstantActionEnded | None]:
        """Send an instant action to a vehicle and wait briefly for its end; None: it is still running."""
        vehicle = self._vehicle(name)
        link = self._engine.view(vehicle).link
        if link is LinkStatus.HIBERNATING and action_type != STOP_HIBERNATION:
            raise errors.VehicleNotReachedError(
                name, f"it is {link} until {STOP_HIBERNATION} or its wake-up time"
            )
        may_hear = link not in NOT_REACHED and self._engine.context.fleet.connected_for() > 0
        sent_unread = action_type == START_PAUSE and may_hear
        if link not in (LinkStatus.ONLINE, LinkStatus.HIBERNATING) and not sent_unread:
            raise errors.VehicleNotReachedError(name, f"it is {link}")
        sent = self._engine.state.sent_orders.of_robot(vehicle.key)
        if action_type in LEAVES and (sent or self._engine.works(vehicle)):
            raise errors.VehicleBusyError(name, self._engine.status(vehicle).transport_order or "")
        self._respect_stops(vehicle, action_type)
        action = Action(
            action_type=action_type,
            action_id=unique_id(),
            blocking_type=blocking_type,
            action_parameters=parameters,
        )
        end = self._engine.send_instant_action(vehicle, action)
        seconds = self._engine.settings.instant_action_timeout
        return action, await self._engine.state.instant_actions.wait(action.action_id, end, seconds)

    def _respect_stops(self, vehicle: FleetVehicle, action_type: str) -> None:
        """Raise VehicleStoppedError for a resume during a stop; note who stays paused at its end."""
        if action_type == START_PAUSE:
            self._engine.person_pauses(vehicle)
        elif action_type == STOP_PAUSE:
            if stop := self._engine.stops.stop_of(vehicle):
                raise errors.VehicleStoppedError(vehicle.name, stop.name, stop.text)
            self._engine.stops.person_resumes(vehicle)

    def robot_pose(self, name: str, pose: PlantPose, map_id: str | None = None) -> RobotPose:
        """Convert a pose in the plant's frame to a map of the vehicle's robot, by default its current one."""
        profile = self._vehicle(name).profile
        map_id = map_id or profile.map_id
        if not profile.knows_frame(map_id):
            raise errors.VehicleNotReachedError(
                name, "its factsheet has not arrived, so it is unknown who transforms poses"
            )
        points = [each for each in self._engine.plant.points if (each.map_id or profile.map_id) == map_id]
        near = [each for each in points if _distance(each, pose) <= profile.deviation_xy]
        point = min(near, key=lambda each: _distance(each, pose)).name if near else ""
        return RobotPose(profile.on(map_id).pose_to_map(pose), map_id, point)

    async def _ended_dependencies(self, request: TransportOrderRequest) -> dict[str, TransportOrderState]:
        """Return the final states of dependencies; raises UnknownDependencyError."""
        ended: dict[str, TransportOrderState] = {}
        unknown: list[str] = []
        for name in request.dependencies:
            known = await self._find(name, None)
            if known is None:
                unknown.append(name)
            elif known.state.final:
                ended[name] = known.state
        if unknown:
            raise errors.UnknownDependencyError(unknown)
        return ended

    async def _check_sequence(self, request: TransportOrderRequest) -> None:
        """Raise an error if the order names a sequence that it may not join."""
        name = request.wrapping_sequence
        if name is None:
            return
        sequence = self._engine.state.sequences.named(name) or await self._engine.store.sequence(name=name)
        sequence = self._engine.state.sequences.named(name) or sequence
        if sequence is None:
            raise errors.UnknownSequenceError(name)
        if reasons := tuple(sequence.refusals(request)):
            raise errors.SequenceRefusesError(name, reasons)

    async def _unfinished(self, name: str, seen: ETag | None) -> TransportOrder:
        """Return an order that can be changed."""
        order = self._engine.state.orders.named(name) or await self._engine.store.order(name=name)
        if order is None:
            raise errors.UnknownOrderError(name)
        if order.state.final:
            raise errors.OrderEndedError(name, order.state)
        if seen is not None and not seen.fits(order.status.version):
            raise errors.VersionChangedError(name, str(seen), order.status.version)
        self._engine.unit_of_work.require_store()
        return order

    async def _find(self, name: str | None, key: str | None) -> TransportOrder | None:
        """Return the order with this key, otherwise with this name; from the store if not in memory."""
        if found := self._in_memory(name, key):
            return found
        if name is None and key is None:
            return None
        stored = await self._engine.store.order(name=name, idempotency_key=key)
        return stored or self._in_memory(name, key)

    def _in_memory(self, name: str | None, key: str | None) -> TransportOrder | None:
        return self._engine.state.orders.keyed(key) or (
            self._engine.state.orders.named(name) if name else None
        )

    def _vehicle(self, name: str) -> FleetVehicle:
        vehicle = self._engine.registry.named(name)
        if vehicle is None:
            raise errors.UnknownVehicleError(name)
        return vehicle

    def _visible(self, order: TransportOrder) -> TransportOrderStatus:
        return (self._engine.state.orders.visible(order.number) or order).status


def _distance(point: Point, pose: PlantPose) -> float:
    """Return the distance in m."""
    return hypot(point.x_m - pose.x_m, point.y_m - pose.y_m)


SEQUENCE_PREFIX = "OSequence"


class SequenceRequests:
    """Executes requests about order sequences; changes are committed before the answer.

    Every method may raise the errors in :mod:`nena_order_service.errors`.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._sequences = engine.state.sequences

    async def create(self, request: OrderSequenceRequest) -> tuple[OrderSequenceStatus, bool]:
        """Create a sequence; return it with False if the same request created it before."""
        vehicle = request.intended_vehicle
        if vehicle is not None and vehicle not in self._engine.registry.names():
            raise errors.UnknownVehicleError(vehicle)
        prefix = request.name or SEQUENCE_PREFIX
        complete = request.name is None or request.incomplete_name
        name = f"{prefix}-{sortable_id()}" if complete else prefix
        known = await self._find(None if complete else name, request.idempotency_key)
        if known is None:
            return await self._make(request, name), True
        name = f"{prefix}-" if complete else name
        _check_same(known, request, name, complete=complete, same=known.was_created_by(request))
        await self._engine.unit_of_work.wait_committed()
        return self._visible(known), False

    async def complete(self, name: str, *, seen: ETag | None = None) -> OrderSequenceStatus:
        """Mark a sequence complete: no more orders can join. A complete sequence stays unchanged.

        Only if the sequence is unchanged since the caller has ``seen`` it; None: unconditionally.
        """
        sequence = await self._named(name)
        if seen is not None and not seen.fits(sequence.status.version):
            raise errors.VersionChangedError(name, str(seen), sequence.status.version)
        if not sequence.status.complete:
            self._engine.unit_of_work.require_store()
            with self._engine.change():
                sequence = self._engine.sequences.complete(sequence)
            log.info("order sequence complete", sequence=name)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(sequence)

    async def sequence(self, name: str) -> OrderSequenceStatus:
        """Return a sequence."""
        found = self._sequences.visible(name) or await self._engine.store.sequence(name=name)
        if found is None:
            raise errors.UnknownSequenceError(name)
        return found.status

    async def sequences(self, wanted: SequenceFilter) -> tuple[OrderSequence, ...]:
        """Return a page of sequences, newest first."""
        return await self._engine.store.sequences(wanted)

    async def _make(self, request: OrderSequenceRequest, name: str) -> OrderSequenceStatus:
        self._engine.unit_of_work.require_store()
        with self._engine.change():
            made = self._engine.sequences.create(request, name)
        log.info("order sequence created", sequence=name)
        await self._engine.unit_of_work.wait_committed()
        return self._visible(made)

    async def _find(self, name: str | None, key: str | None) -> OrderSequence | None:
        """Return the sequence with this key, otherwise with this name; from the store if not in memory."""
        if found := self._in_memory(name, key):
            return found
        if name is None and key is None:
            return None
        stored = await self._engine.store.sequence(name=name, idempotency_key=key)
        return stored or self._in_memory(name, key)

    def _in_memory(self, name: str | None, key: str | None) -> OrderSequence | None:
        return self._sequences.keyed(key) or self._sequences.named(name)

    async def _named(self, name: str) -> OrderSequence:
        found = await self._find(name, None)
        if found is None:
            raise errors.UnknownSequenceError(name)
        return self._sequences.named(name) or found

    def _visible(self, sequence: OrderSequence) -> OrderSequenceStatus:
        return (
            self._sequences.visible(sequence.name) or self._sequences.named(sequence.name) or sequence
        ).status


def _is_prefix(request: TransportOrderRequest) -> bool:
    """Return whether the order service completes the request's name, or makes one."""
    return request.name is None or request.incomplete_name


def _check_known(known: TransportOrder, request: TransportOrderRequest) -> None:
    """Raise an error unless ``request`` is the one that has created the order ``known``."""
    name, complete = request.name or ORDER_PREFIX, _is_prefix(request)
    known_name = f"{name}-" if complete else name
    _check_same(known, request, known_name, complete=complete, same=known.was_created_by(request))


def _check_same(
    known: TransportOrder | OrderSequence,
    request: TransportOrderRequest | OrderSequenceRequest,
    name: str,
    *,
    complete: bool,
    same: bool,
) -> None:
    """Raise an error for a used name or key, unless the request is the ``same``.

    ``complete``: ``name`` is only a prefix.
    """
    key, kind = (
        request.idempotency_key,
        "Order sequence" if isinstance(known, OrderSequence) else "Transport order",
    )
    if known.idempotency_key != key:
        raise errors.NameTakenError(name, kind)
    named = known.name.startswith(name) if complete else known.name == name
    if not (named and same):
        raise errors.NameTakenError(name, kind) if key is None else errors.KeyReusedError(key, known.name)


@dataclass(frozen=True, slots=True)
class HostServices:
    """The services behind the host operations, one per topic."""

    requests: HostRequests
    sequences: SequenceRequests
    locks: PathLocks
    zones: ZoneSets
    peripherals: PeripheralRequests
    stops: StopRequests
    places: PlaceRequests
    schedules: Schedules
    trail: Trail
    recordings: RecordingRequests
    webhooks: Webhooks = field(default_factory=lambda: Webhooks(()))

    async def load(self) -> None:
        """Restore what hosts have uploaded to the store."""
        await self.stops.load()
        await self.locks.load()
        await self.zones.load()
        await self.schedules.load()
