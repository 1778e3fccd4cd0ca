"""Transport orders: operations of hosts."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from pydantic_core import to_json

from nena_order_service import errors
from nena_order_service.api.operations import ETag, Handler, Reply, status_for
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
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.requests import (
    SOMEBODY,
    AssignmentQuery,
    HoldRequest,
    OrderChange,
    ResumeRequest,
    TransportOrdersQuery,
    WithdrawalRequest,
)
from nena_shared.fleet_api.transport_order import (
    AssignmentStatus,
    CreationAnswer,
    DeliveryPhase,
    DeliveryStatus,
    OrderOutcome,
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
        yield Handler(table.CREATE_ORDER, self.create_order, EXAMPLE)
        yield Handler(
            table.CREATE_ORDERS, self.create_batch, {"transportOrders": [EXAMPLE], "checkOnly": True}
        )
        yield Handler(table.LIST_ORDERS, self.list_orders)
        yield Handler(table.SHOW_ORDER, self.find_status)
        yield Handler(table.DELIVERY, self.find_delivery)
        yield Handler(table.ASSIGNMENT, self.explain_assignment)
        yield Handler(
            table.CHANGE_ORDER, self.change_order, {"priority": 5, "deadline": "2026-08-01T14:30:00Z"}
        )
        yield Handler(table.WITHDRAW, self.withdraw_order, {"reason": "customer cancelled"})
        yield Handler(table.HOLD, self.hold_order, {"by": "Anna", "reason": "aisle is blocked"})
        yield Handler(table.RESUME, self.resume_order, {"by": "Anna", "reason": "aisle is free"})

    async def create_order(
        self, request: TransportOrderRequest, caller: str = SOMEBODY
    ) -> tuple[TransportOrderStatus, bool]:
        """Create an order; return it with False if the same request created it before.

        The same request has the same idempotency key, or without one the same name.
        """
        order, new = await self._create_uncommitted(request, caller)
        # Also for a known order: the request that created it may still be in the commit (0008).
        try:
            await self._engine.unit_of_work.wait_committed()
        finally:  # a robot must not wait for its order while the log is written
            if new:
                log.info("order created", order=order.name, state=order.state.value)
        return self._visible_status(order), new

    async def create_batch(self, request: TransportOrderBatch, caller: str) -> TransportOrderBatchAnswer:
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
                        self._check_order(order, earlier)
                        if check_only
                        else self._create_uncommitted(order, caller)
                    )
                )
            # A RefusedError too, but of the whole batch: its host repeats all of it.
            except errors.StoreNotReadyError:
                raise
            except (InvalidRequestError, errors.RefusedError) as error:
                outcomes.append(error)
            else:
                earlier.add_request(order)
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
            status=status_for(new=new),
            name=order.name if order else name,
            idempotency_key=key,
            transport_order=self._visible_status(order) if order else None,
        )

    async def _create_uncommitted(
        self, request: TransportOrderRequest, caller: str
    ) -> tuple[TransportOrder, bool]:
        """Create an order without waiting for the commit."""
        request = set_operations(request, self._engine.plant)
        check_request(request, self._engine.plant, self._engine.registry.names())
        exact_name = _exact_name(request)
        order = await self._find_order(exact_name, request.idempotency_key)
        if order is None:
            ended = await self._find_ended_dependencies(request)
            await self._check_sequence(request)
            # The store was read in between: the same request may have arrived a second time.
            order = self._find_in_memory(exact_name, request.idempotency_key)
        if order is not None:
            check_same_request(order, request, ORDER_PREFIX, same=order.was_created_by(request))
            return order, False
        self._engine.unit_of_work.require_store()
        name = exact_name or f"{request.name or ORDER_PREFIX}-{sortable_id()}"
        by = None if caller == SOMEBODY else caller
        return self._engine.create(request, name, ended, by), True

    async def _check_order(
        self, request: TransportOrderRequest, earlier: _Earlier
    ) -> tuple[TransportOrder | None, bool]:
        """Check whether an order could be created after ``earlier`` ones that are not created either."""
        complete = set_operations(request, self._engine.plant)
        check_request(complete, self._engine.plant, self._engine.registry.names())
        order = await self._find_order(_exact_name(request), request.idempotency_key)
        if order is not None:
            check_same_request(order, complete, ORDER_PREFIX, same=order.was_created_by(complete))
        elif not earlier.has_accepted(request):
            # Earlier orders of the batch would exist by now, so an order may depend on them.
            stored = tuple(name for name in request.dependencies if name not in earlier.names)
            await self._find_ended_dependencies(complete.model_copy(update={"dependencies": stored}))
            await self._check_sequence(complete)
        return order, False

    async def _find_ended_dependencies(self, request: TransportOrderRequest) -> dict[str, OrderOutcome]:
        """Return the outcomes of ended dependencies; raises RefusedError."""
        ended: dict[str, OrderOutcome] = {}
        unknown: list[str] = []
        for name in request.dependencies:
            order = await self._find_order(name, None)
            if order is None:
                unknown.append(name)
            elif outcome := order.status.ended_as:
                ended[name] = outcome
        # 0027: dependencies exist before the order, so there are no cycles to search for.
        if unknown:
            names = " or ".join(map(repr, unknown))
            text = f"There is no transport order {names} to depend on. Create the dependencies first."
            raise errors.RefusedError(Refusal.UNKNOWN_DEPENDENCY, text)
        return ended

    async def _check_sequence(self, request: TransportOrderRequest) -> None:
        """Raise an error if the order names a sequence that it may not join."""
        name, sequences = request.wrapping_sequence, self._engine.state.sequences
        if name is None:
            return
        sequence = sequences.named(name) or await self._engine.store.read_sequence(name=name)
        sequence = sequences.named(name) or sequence  # it may have changed while the store was read
        if sequence is None:
            raise errors.UnknownError(Refusal.UNKNOWN_SEQUENCE, name)
        if reasons := tuple(sequence.refusals(request)):
            raise errors.RefusedError(
                Refusal.SEQUENCE_REFUSES, f"Order sequence {name!r} refuses this order: {'; '.join(reasons)}."
            )

    async def list_orders(self, request: TransportOrdersQuery) -> Reply:
        """Return a page of orders, newest first."""
        store = self._engine.store
        before_number = int(request.after) if request.after else None
        first_number = 0 if request.since is None else await store.read_order_number_at(request.since)
        if request.until is not None:
            end = await store.read_order_number_at(request.until)
            before_number = end if before_number is None else min(before_number, end)
        wanted = OrderFilter(  # one more than the page: whether there is a next one
            tuple(request.state or ()),
            request.intended_vehicle,
            before_number,
            request.limit + 1,
            first_number,
        )
        # Encoded one by one: a page of models would take five times the memory.
        page: list[bytes] = []
        last, following = 0, None
        async for order in self.iterate_orders(wanted):
            if len(page) == request.limit:
                following = str(last)
            else:
                page.append(order.status.model_dump_json(by_alias=True).encode())
                last = order.number
        return Reply(b'{"transportOrders":[%s],"next":%s}' % (b",".join(page), to_json(following)))

    async def iterate_orders(self, wanted: OrderFilter) -> AsyncIterator[TransportOrder]:
        """Yield orders, newest first; only some of them are in memory at a time."""
        before_number, left = wanted.before, wanted.limit
        while left > 0:
            limit = min(left, ORDERS_AT_ONCE)
            orders = await self._engine.store.read_orders(replace(wanted, before=before_number, limit=limit))
            for order in orders:
                yield order
            if len(orders) < limit:
                return
            before_number, left = orders[-1].number, left - limit

    async def find_status(self, name: str) -> TransportOrderStatus:
        """Return the status of an order; raises UnknownError."""
        order = self._orders.visible_named(name) or await self._engine.store.read_order(name=name)
        if order is None:
            raise errors.UnknownError(Refusal.UNKNOWN_ORDER, name)
        return order.status

    async def find_delivery(self, name: str) -> DeliveryStatus:
        """Return the progress of an order's delivery to its robot."""
        order = await self.find_status(name)
        vehicle = self._engine.registry.named(order.processing_vehicle)
        return delivery_status(order, self._engine.view(vehicle) if vehicle else None)

    async def explain_assignment(self, name: str, request: AssignmentQuery) -> AssignmentStatus:
        """Return why vehicles do not execute an order."""
        status, order = await self.find_status(name), self._orders.named(name)
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

    async def change_order(
        self, name: str, request: OrderChange, seen: ETag | None = None
    ) -> TransportOrderStatus:
        """Change an order that no vehicle has.

        Raises:
            OrderAssignedError: a vehicle has it, or the vehicle is that of its sequence.
        """
        order, changes = await self._unfinished_order(name, seen), request.changes
        vehicle, sequence = changes.get("intended_vehicle"), order.status.wrapping_sequence
        if vehicle is not None and self._engine.registry.named(vehicle) is None:
            raise errors.UnknownError(Refusal.UNKNOWN_VEHICLE, vehicle)
        if order.state not in (TransportOrderState.ACTIVE, TransportOrderState.DISPATCHABLE):
            raise errors.OrderAssignedError(name, f"it is {order.state} with vehicle {order.vehicle!r}")
        if "intended_vehicle" in changes and sequence is not None:
            raise errors.OrderAssignedError(name, f"sequence {sequence!r} chooses its vehicle")
        async with self._engine.unit_of_work.saved():
            self._engine.change_order(order.number, changes)
        return self._visible_status(order)

    async def withdraw_order(
        self, name: str, request: WithdrawalRequest, seen: ETag | None = None
    ) -> TransportOrderStatus:
        """Withdraw an order: it fails at once, or once its vehicle has released it."""
        order = await self._unfinished_order(name, seen)
        async with self._engine.unit_of_work.saved():
            self._engine.withdraw(order.number, request.reason, immediate=request.immediate)
        return self._visible_status(order)

    async def hold_order(
        self, name: str, request: HoldRequest, caller: str, seen: ETag | None
    ) -> TransportOrderStatus:
        """Hold an order until it is resumed; an order that is already held keeps its holder."""
        order = await self._unfinished_order(name, seen)
        if order.state is TransportOrderState.WITHDRAWN:
            text = f"Transport order {name!r} is already withdrawn and ends as soon as its vehicle stops."
            raise errors.RefusedError(Refusal.ORDER_WITHDRAWN, text)
        async with self._engine.unit_of_work.saved():
            by = request.by or caller
            self._engine.hold(order.number, by, request.reason, immediate=request.immediate)
        return self._visible_status(order)

    async def resume_order(
        self, name: str, request: ResumeRequest, caller: str, seen: ETag | None
    ) -> TransportOrderStatus:
        """Resume a held order; an order that is not held stays unchanged."""
        order = await self._unfinished_order(name, seen)
        async with self._engine.unit_of_work.saved():
            self._engine.resume(order.number, request.by or caller, request.reason)
        return self._visible_status(order)

    async def _unfinished_order(self, name: str, seen: ETag | None) -> TransportOrder:
        """Return an order that can be changed, if it is unchanged since the caller has ``seen`` it."""
        order = self._orders.named(name) or await self._engine.store.read_order(name=name)
        if order is None:
            raise errors.UnknownError(Refusal.UNKNOWN_ORDER, name)
        if order.state.final:
            raise errors.OrderEndedError(name, order.state)
        check_version(name, order.status.version, seen)
        return order

    async def _find_order(self, name: str | None, key: str | None) -> TransportOrder | None:
        """Return the order with this key, otherwise with this name; from the store if not in memory."""
        if order := self._find_in_memory(name, key):
            return order
        if name is None and key is None:
            return None
        stored = await self._engine.store.read_order(name=name, idempotency_key=key)
        # Not in the store does not mean that it has not been created while the store was read.
        return stored or self._find_in_memory(name, key)

    def _find_in_memory(self, name: str | None, key: str | None) -> TransportOrder | None:
        return self._orders.keyed(key) or (self._orders.named(name) if name else None)

    def _visible_status(self, order: TransportOrder) -> TransportOrderStatus:
        return (self._orders.visible(order.number) or order).status


@dataclass(slots=True)
class _Earlier:
    """The requests of a batch that were accepted, by name and by key."""

    names: dict[str, TransportOrderRequest] = field(default_factory=dict)
    keys: dict[str, TransportOrderRequest] = field(default_factory=dict)

    def add_request(self, request: TransportOrderRequest) -> None:
        if name := _exact_name(request):
            self.names.setdefault(name, request)
        if request.idempotency_key:
            self.keys.setdefault(request.idempotency_key, request)

    def has_accepted(self, request: TransportOrderRequest) -> bool:
        """Return whether the same request was accepted; raises an error for a used name or key."""
        key, name = request.idempotency_key, _exact_name(request)
        if key and key in self.keys:
            if self.keys[key] != request:
                raise errors.KeyReusedError(key, self.keys[key].name or "an earlier order of the batch")
            return True
        if name and name in self.names:
            # A key that is new makes it another request, as in check_same_request.
            if key or self.names[name] != request:
                raise errors.NameTakenError(name)
            return True
        return False


def delivery_status(order: TransportOrderStatus, view: RobotView | None) -> DeliveryStatus:
    """Return the progress of an order's delivery; ``view`` None: no vehicle has it, or its robot is gone."""
    first = order_id(order.name, order.current_drive_order_index)
    own = view.order_id if view else None
    # An order that was broken off is sent again under its ID with a suffix.
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
    """Raise RefusedError if an object has another version than the caller has ``seen``; None: any."""
    if seen is not None and not seen.fits(version):
        raise errors.RefusedError(
            Refusal.VERSION_CHANGED,
            f"{name!r} has changed: it is at version {version}, the request expects {seen}. "
            "Fetch the latest version and retry.",
        )


def _exact_name(request: TransportOrderRequest) -> str | None:
    """Return the name of a request's order; None: the order service completes the name, or makes one."""
    return None if request.incomplete_name else request.name


def check_same_request(
    existing: TransportOrder | OrderSequence,
    request: TransportOrderRequest | OrderSequenceRequest,
    default_prefix: str,
    *,
    same: bool,
) -> None:
    """Raise an error unless ``request`` is the ``same`` that has created the ``existing`` object.

    ``default_prefix``: begins the name of an object whose request has none.
    """
    key, name = request.idempotency_key, request.name or default_prefix
    kind = "Order sequence" if isinstance(existing, OrderSequence) else "Transport order"
    if request.name is None or request.incomplete_name:
        name = f"{name}-"
        has_name = existing.name.startswith(name)
    else:
        has_name = existing.name == name
    if existing.idempotency_key != key:
        raise errors.NameTakenError(name, kind)
    if not (has_name and same):
        raise errors.NameTakenError(name, kind) if key is None else errors.KeyReusedError(key, existing.name)
