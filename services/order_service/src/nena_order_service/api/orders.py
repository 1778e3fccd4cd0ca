"""Transport orders: operations of hosts."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from pydantic_core import to_json

from nena_order_service import errors
from nena_order_service.api.operations import ETag, Handler, Reply, created
from nena_order_service.api.problems import problem_of
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.robot import RobotView, VdaOrderPhase
from nena_order_service.fleet.vda_order import order_id
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder, sortable_id
from nena_order_service.orders.validation import InvalidRequestError, check_request, set_operations
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.operations import orders as table
from nena_shared.fleet_api.reasons import explained
from nena_shared.fleet_api.requests import (
    AssignmentQuery,
    HoldRequest,
    ResumeRequest,
    TransportOrdersQuery,
    WithdrawalRequest,
)
from nena_shared.fleet_api.transport_order import (
    AssignmentStatus,
    CreationAnswer,
    DeliveryPhase,
    DeliveryStatus,
    OrderSequenceRequest,
    TransportOrderBatch,
    TransportOrderBatchAnswer,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
    VehicleForOrder,
)
from nena_shared.log import get_logger

log = get_logger(__name__)

ORDER_PREFIX = "TOrder"

ORDERS_AT_ONCE = 25
"""Number of orders of a page that are read and encoded together: as models, 1,000 take 11 MB."""

CREATED_AT_ONCE = 10
"""Number of orders of a batch between two waits for the store: creating one takes about 2 ms, in which
neither robots nor other hosts are answered."""

PHASES = {
    VdaOrderPhase.WAITING: DeliveryPhase.WAITING,
    VdaOrderPhase.SENT: DeliveryPhase.SENT,
    VdaOrderPhase.RUNNING: DeliveryPhase.DELIVERED,
    VdaOrderPhase.CANCELLING: DeliveryPhase.CANCELLING,
}

EXAMPLE: Final = {
    "name": "Pallet-4711",
    "idempotencyKey": "wms-4711",
    "destinations": [
        {"locationName": "Goods in", "operation": "Load cargo"},
        {"locationName": "Storage", "operation": "Unload cargo"},
    ],
}

Refused = InvalidRequestError | errors.RefusedError


class OrderOperations:
    """Executes requests about transport orders."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._orders = engine.state.orders

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield Handler(table.CREATE_ORDER, self.create, EXAMPLE)
        yield Handler(
            table.CREATE_ORDERS, self.create_batch, {"transportOrders": [EXAMPLE], "checkOnly": True}
        )
        yield Handler(table.LIST_ORDERS, self.page)
        yield Handler(table.SHOW_ORDER, self.order)
        yield Handler(table.DELIVERY, self.delivery)
        yield Handler(table.ASSIGNMENT, self.assignment)
        yield Handler(table.WITHDRAW, self.withdraw, {"reason": "customer cancelled"})
        yield Handler(table.HOLD, self.hold, {"by": "Anna", "reason": "aisle is blocked"})
        yield Handler(table.RESUME, self.resume, {"by": "Anna", "reason": "aisle is free"})

    async def create(self, request: TransportOrderRequest) -> tuple[TransportOrderStatus, bool]:
        """Create an order; return it with False if the same request created it before.

        The same request has the same idempotency key, or without one the same name.
        """
        order, new = await self._create_uncommitted(request)
        try:
            await self._engine.unit_of_work.wait_committed()
        finally:  # a robot must not wait for its order while the log is written
            if new:
                log.info("order created", order=order.name, state=order.state.value)
        return self._visible_status(order), new

    async def create_batch(self, request: TransportOrderBatch) -> TransportOrderBatchAnswer:
        """Create several orders in this order, or only check whether they could be created.

        Raises:
            StoreNotReadyError: some may be lost; repeat all with their idempotency keys.
        """
        unit_of_work, check_only = self._engine.unit_of_work, request.check_only
        unit_of_work.require_store()
        outcomes: list[tuple[TransportOrder | None, bool] | Refused] = []
        earlier = _Earlier()
        for number, order in enumerate(request.transport_orders, 1):
            try:
                outcomes.append(
                    await (
                        self._check_order(order, earlier) if check_only else self._create_uncommitted(order)
                    )
                )
            except errors.StoreNotReadyError:
                raise
            except (InvalidRequestError, errors.RefusedError) as error:
                outcomes.append(error)
            else:
                earlier.add(order)
            if number % CREATED_AT_ONCE == 0:
                await unit_of_work.wait_committed()
        await unit_of_work.wait_committed()
        if not check_only:
            new = sum(not isinstance(outcome, Exception) and outcome[1] for outcome in outcomes)
            refused = sum(isinstance(outcome, Exception) for outcome in outcomes)
            log.info("orders created", new=new, known=len(outcomes) - new - refused, refused=refused)
        return TransportOrderBatchAnswer(
            results=tuple(map(self._creation_answer, request.transport_orders, outcomes))
        )

    def _creation_answer(
        self, request: TransportOrderRequest, outcome: tuple[TransportOrder | None, bool] | Refused
    ) -> CreationAnswer:
        """Return the result of one request of a batch; without an order, it could be created."""
        name, key = request.name, request.idempotency_key
        if isinstance(outcome, Exception):
            problem = problem_of(outcome)
            return CreationAnswer(status=problem.status, name=name, idempotency_key=key, problem=problem)
        order, new = outcome
        return CreationAnswer(
            status=created(new=new),
            name=order.name if order else name,
            idempotency_key=key,
            transport_order=self._visible_status(order) if order else None,
        )

    async def _create_uncommitted(self, request: TransportOrderRequest) -> tuple[TransportOrder, bool]:
        """Create an order without waiting for the commit."""
        request, name, known = await self._prepare_request(request)
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

    async def _check_order(
        self, request: TransportOrderRequest, earlier: _Earlier
    ) -> tuple[TransportOrder | None, bool]:
        """Check whether an order could be created after ``earlier`` ones that are not created either."""
        prepared, _, known = await self._prepare_request(request)
        if known is None and not earlier.has(request):
            others = tuple(
                dependency for dependency in request.dependencies if dependency not in earlier.names
            )
            await self._ended_dependencies(prepared.model_copy(update={"dependencies": others}))
            await self._check_sequence(prepared)
        return known, False

    async def _prepare_request(
        self, request: TransportOrderRequest
    ) -> tuple[TransportOrderRequest, str, TransportOrder | None]:
        """Return a valid request with its operations, the order's name, and the order that it has created."""
        request = set_operations(request, self._engine.plant)
        check_request(request, self._engine.plant, self._engine.registry.names())
        name = request.name or ORDER_PREFIX
        known = await self._find_order(None if _is_prefix(request) else name, request.idempotency_key)
        if known is not None:
            _check_known(known, request)
        return request, f"{name}-{sortable_id()}" if _is_prefix(request) else name, known

    async def _ended_dependencies(self, request: TransportOrderRequest) -> dict[str, TransportOrderState]:
        """Return the final states of dependencies; raises UnknownDependencyError."""
        ended: dict[str, TransportOrderState] = {}
        unknown: list[str] = []
        for name in request.dependencies:
            known = await self._find_order(name, None)
            if known is None:
                unknown.append(name)
            elif known.state.final:
                ended[name] = known.state
        if unknown:
            raise errors.UnknownDependencyError(unknown)
        return ended

    async def _check_sequence(self, request: TransportOrderRequest) -> None:
        """Raise an error if the order names a sequence that it may not join."""
        name, sequences = request.wrapping_sequence, self._engine.state.sequences
        if name is None:
            return
        sequence = sequences.named(name) or await self._engine.store.sequence(name=name)
        sequence = sequences.named(name) or sequence
        if sequence is None:
            raise errors.UnknownSequenceError(name)
        if reasons := tuple(sequence.refusals(request)):
            raise errors.SequenceRefusesError(name, reasons)

    async def page(self, request: TransportOrdersQuery) -> Reply:
        """Return a page of orders, newest first."""
        store = self._engine.store
        before = int(request.after) if request.after else None
        first = 0 if request.since is None else await store.order_number_at(request.since)
        if request.until is not None:
            end = await store.order_number_at(request.until)
            before = end if before is None else min(before, end)
        wanted = OrderFilter(
            tuple(request.state or ()), request.intended_vehicle, before, request.limit + 1, first
        )
        page: list[bytes] = []
        last, following = 0, None
        async for order in self.orders(wanted):
            if len(page) == request.limit:
                following = str(last)
            else:
                page.append(order.status.model_dump_json(by_alias=True).encode())
                last = order.number
        return Reply(b'{"transportOrders":[%s],"next":%s}' % (b",".join(page), to_json(following)))

    async def orders(self, wanted: OrderFilter) -> AsyncIterator[TransportOrder]:
        """Yield orders, newest first; only some of them are in memory at a time."""
        before, left = wanted.before, wanted.limit
        while left > 0:
            asked = min(left, ORDERS_AT_ONCE)
            found = await self._engine.store.orders(replace(wanted, before=before, limit=asked))
            for order in found:
                yield order
            if len(found) < asked:
                return
            before, left = found[-1].number, left - asked

    async def order(self, name: str) -> TransportOrderStatus:
        """Return an order."""
        order = self._orders.visible_named(name) or await self._engine.store.order(name=name)
        if order is None:
            raise errors.UnknownOrderError(name)
        return order.status

    async def delivery(self, name: str) -> DeliveryStatus:
        """Return the progress of an order's delivery to its robot."""
        order = await self.order(name)
        vehicle = self._engine.registry.named(order.processing_vehicle)
        return delivery_status(order, self._engine.view(vehicle) if vehicle else None)

    async def assignment(self, name: str, request: AssignmentQuery) -> AssignmentStatus:
        """Return why vehicles do not execute an order."""
        status, order = await self.order(name), self._orders.named(name)
        fits = [] if order is None or order.state.final else self._engine.dispatching.explain(order)
        return AssignmentStatus(
            transport_order=status.name,
            state=status.state,
            reason=status.reason,
            coded_reason=status.coded_reason,
            processing_vehicle=status.processing_vehicle,
            vehicles=tuple(
                VehicleForOrder(vehicle=fit.vehicle, fits=fit.fits, cost=fit.cost, **explained(fit.reason))
                for fit in fits[: request.limit]
            ),
            left_out=len(fits[request.limit :]),
        )

    async def withdraw(
        self, name: str, request: WithdrawalRequest, seen: ETag | None = None
    ) -> TransportOrderStatus:
        """Withdraw an order: it fails at once, or once its vehicle has released it."""
        order = await self._unfinished_order(name, seen)
        async with self._engine.unit_of_work.saved():
            self._engine.withdraw(order.number, request.reason, immediate=request.immediate)
        return self._visible_status(order)

    async def hold(
        self, name: str, request: HoldRequest, caller: str, seen: ETag | None
    ) -> TransportOrderStatus:
        """Hold an order until it is resumed; an order that is already held keeps its holder."""
        order = await self._unfinished_order(name, seen)
        if order.state is TransportOrderState.WITHDRAWN:
            raise errors.OrderWithdrawnError(name)
        async with self._engine.unit_of_work.saved():
            by = request.by or caller
            self._engine.hold(order.number, by, request.reason, immediate=request.immediate)
        return self._visible_status(order)

    async def resume(
        self, name: str, request: ResumeRequest, caller: str, seen: ETag | None
    ) -> TransportOrderStatus:
        """Resume a held order; an order that is not held stays unchanged."""
        order = await self._unfinished_order(name, seen)
        async with self._engine.unit_of_work.saved():
            self._engine.resume(order.number, request.by or caller, request.reason)
        return self._visible_status(order)

    async def intend(self, name: str, vehicle: str | None) -> None:
        """Set the intended vehicle of an unassigned order; None: any vehicle.

        Raises:
            OrderAssignedError: a vehicle has it, or the order belongs to a sequence.
        """
        order = await self._unfinished_order(name, None)
        if vehicle is not None and self._engine.registry.named(vehicle) is None:
            raise errors.UnknownVehicleError(vehicle)
        if order.state not in (TransportOrderState.ACTIVE, TransportOrderState.DISPATCHABLE):
            raise errors.OrderAssignedError(name, f"it is {order.state}")
        if order.status.wrapping_sequence is not None:
            raise errors.OrderAssignedError(
                name, f"it belongs to sequence {order.status.wrapping_sequence!r}"
            )
        async with self._engine.unit_of_work.saved():
            self._engine.set_intended_vehicle(order.number, vehicle)

    async def _unfinished_order(self, name: str, seen: ETag | None) -> TransportOrder:
        """Return an order that can be changed, if it is unchanged since the caller has ``seen`` it."""
        order = self._orders.named(name) or await self._engine.store.order(name=name)
        if order is None:
            raise errors.UnknownOrderError(name)
        if order.state.final:
            raise errors.OrderEndedError(name, order.state)
        check_version(name, order.status.version, seen)
        return order

    async def _find_order(self, name: str | None, key: str | None) -> TransportOrder | None:
        """Return the order with this key, otherwise with this name; from the store if not in memory."""
        if order := self._in_memory(name, key):
            return order
        if name is None and key is None:
            return None
        stored = await self._engine.store.order(name=name, idempotency_key=key)
        return stored or self._in_memory(name, key)

    def _in_memory(self, name: str | None, key: str | None) -> TransportOrder | None:
        return self._orders.keyed(key) or (self._orders.named(name) if name else None)

    def _visible_status(self, order: TransportOrder) -> TransportOrderStatus:
        return (self._orders.visible(order.number) or order).status


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
        note=str(view.wait_reason or ""),
    )


def check_version(name: str, version: int, seen: ETag | None) -> None:
    """Raise VersionChangedError if an object has another version than the caller has ``seen``; None: any."""
    if seen is not None and not seen.fits(version):
        raise errors.VersionChangedError(name, str(seen), version)


def _is_prefix(request: TransportOrderRequest) -> bool:
    """Return whether the order service completes the request's name, or makes one."""
    return request.name is None or request.incomplete_name


def _check_known(known: TransportOrder, request: TransportOrderRequest) -> None:
    """Raise an error unless ``request`` is the one that has created the order ``known``."""
    name, complete = request.name or ORDER_PREFIX, _is_prefix(request)
    known_name = f"{name}-" if complete else name
    check_same(known, request, known_name, complete=complete, same=known.was_created_by(request))


def check_same(
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
