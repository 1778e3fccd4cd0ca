"""What an order waits for before it can be dispatched: its dependencies, and its turn in a sequence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nena_order_service.engine.context import Context
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.transport_order import (
    DependencyFailure,
    Hold,
    OrderOutcome,
    OrderSequenceRequest,
    TransportOrderState,
)

S = TransportOrderState
R = ReasonCode

NAMES_SHOWN = 3
MARKED = "marked complete by a host"
HOLDER = "failure of a dependency"


class Sequences:
    """Updates order sequences as their orders progress."""

    def __init__(self, context: Context) -> None:
        self._state = context.state
        self._sequences = context.state.sequences
        self._orders = context.state.orders
        self._clock = context.clock

    def create(self, request: OrderSequenceRequest, name: str) -> OrderSequence:
        """Create a sequence without orders."""
        number = self._sequences.next_number()
        sequence = OrderSequence.created(request, number=number, name=name, now=self._clock.now())
        self._sequences.put(sequence)
        return sequence

    def complete(self, sequence: OrderSequence, why: str = MARKED) -> OrderSequence:
        """Close a sequence to new orders; it is finished once all of its orders have ended."""
        changed = sequence.completed(why, self._clock.now())
        self._put(changed)
        return changed

    def append_order(self, order: TransportOrder) -> None:
        """Add an order to its sequence, if it has one; the caller has checked that it may be added."""
        if sequence := self._of(order):
            self._put(sequence.appended(order.name, self._clock.now()))

    def bind_vehicle(self, order: TransportOrder, vehicle: str) -> None:
        """Bind the order's sequence, if it has one, to the vehicle that gets the order."""
        if sequence := self._of(order):
            self._put(sequence.bound(vehicle, self._clock.now()))

    def why_waiting(self, order: TransportOrder) -> Reason | None:
        """Return what an order waits for in its sequence; None if it does not wait."""
        sequence = self._of(order)
        if sequence is None or sequence.next_order in (None, order.name):
            return None
        return Reason(R.WAITS_IN_SEQUENCE, sequence=sequence.name, order=sequence.next_order)

    def advance_after(self, order: TransportOrder) -> tuple[tuple[TransportOrder, ...], str | None]:
        """Advance the sequence of an order that has ended.

        Return the orders that fail with it, and the name of the next order in the sequence, if any.
        """
        sequence = self._of(order)
        if sequence is None:
            return (), None
        failed: tuple[TransportOrder, ...] = ()
        # openTCS: failureFatal. A dispensable order may fail at any time, so its failure is none.
        is_failure = order.state is not S.FINISHED and not order.status.dispensable
        if sequence.status.failure_fatal and is_failure:
            behind = map(self._orders.named, sequence.behind(order.name))
            failed = tuple(member for member in behind if member and not member.state.final)
            sequence = sequence.completed(f"order {order.name!r} is {order.state}", self._clock.now())
        sequence = sequence.advanced(lambda name: not self._orders.is_unfinished(name), self._clock.now())
        self._put(sequence)
        return failed, sequence.next_order

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> Reason | None:
        """Return why a vehicle must not execute an order because of a sequence; None if it may."""
        bound, sequence = self._sequences.of_vehicle(vehicle), self._of(order)
        if bound and bound is not sequence:
            return Reason(R.BOUND_TO_SEQUENCE, sequence=bound.name)
        if sequence is None:
            return None
        # 0027: never another vehicle, which would lack what the bound one has loaded.
        only = sequence.bound_vehicle or sequence.status.intended_vehicle
        if only not in (None, vehicle):
            return Reason(R.NOT_OF_SEQUENCE, sequence=sequence.name, vehicle=only)
        return None

    def only_vehicle(self, order: TransportOrder) -> str | None:
        """Return the vehicle of an order's sequence; None if any vehicle may execute the order."""
        sequence = self._of(order)
        return sequence.bound_vehicle or sequence.status.intended_vehicle if sequence else None

    def bound_to(self, vehicle: str) -> str | None:
        """Return the name of the sequence to which a vehicle is bound; None if it is free."""
        sequence = self._sequences.of_vehicle(vehicle)
        return sequence.name if sequence else None

    def _of(self, order: TransportOrder) -> OrderSequence | None:
        return self._sequences.named(order.status.wrapping_sequence)

    def _put(self, sequence: OrderSequence) -> None:
        self._sequences.put(sequence)
        self._state.vehicle_changed(sequence.status.processing_vehicle)
        self._state.dispatch_due |= sequence.status.finished  # its vehicle is free for other orders


class Dependencies:
    """Tracks which other orders each waiting order depends on."""

    def __init__(self) -> None:
        self._waits_for: dict[int, set[str]] = {}
        self._dependents: dict[str, set[int]] = {}

    def add_waiting(self, order: TransportOrder, pending: Iterable[str]) -> None:
        """Make an order wait for the orders with these names."""
        names = set(pending)
        if names:
            self._waits_for[order.number] = names
        for name in names:
            self._dependents.setdefault(name, set()).add(order.number)

    def release_dependents(self, name: str) -> tuple[int, ...]:
        """Release the orders that wait for an order; return their numbers, oldest first."""
        numbers = tuple(sorted(self._dependents.pop(name, ())))
        for number in numbers:
            names = self._waits_for[number]
            names.discard(name)
            if not names:
                del self._waits_for[number]
        return numbers

    def remove_waiting(self, order: TransportOrder) -> None:
        """Remove all dependencies of an order."""
        for name in self._waits_for.pop(order.number, ()):
            self._dependents[name].discard(order.number)
            if not self._dependents[name]:
                del self._dependents[name]

    def why_waiting(self, order: TransportOrder) -> Reason | None:
        """Return what an order waits for; None if it does not wait."""
        names = sorted(self._waits_for.get(order.number, ()))
        if not names:
            return None
        shown = ", ".join(repr(name) for name in names[:NAMES_SHOWN])
        if more := len(names[NAMES_SHOWN:]):
            return Reason(R.WAITS_FOR_MORE_ORDERS, orders=shown, count=more)
        return Reason(R.WAITS_FOR_ORDER if len(names) == 1 else R.WAITS_FOR_ORDERS, orders=shown)


class Conditions:
    """Makes orders wait for their dependencies and for their turn in their sequence.

    An order's end takes effect on other orders in the same unit of work. A stored ACTIVE order therefore
    waits exactly for those of its dependencies that have not ended, also after a restart.
    """

    def __init__(self, context: Context, sequences: Sequences) -> None:
        self._state = context.state
        self._orders = context.state.orders
        self._sequences = sequences
        self._clock = context.clock
        self._dependencies = Dependencies()

    def check_new_order(self, order: TransportOrder, ended: Mapping[str, OrderOutcome]) -> TransportOrder:
        """Check a new order's dependencies; return the order with its resulting state.

        ``ended`` has the outcomes of dependencies that are no longer in memory.
        """
        for name in order.status.dependencies:
            dependency = self._orders.named(name)
            outcome = dependency.status.ended_as if dependency else ended[name]
            if outcome and outcome is not OrderOutcome.FINISHED:
                # openTCS lets it wait without a reason; here onDependencyFailure decides at once.
                order = self._failed_dependency(order, name, outcome)
                if order.state.final:
                    return order
        return self.register_order(order)

    def register_order(self, order: TransportOrder) -> TransportOrder:
        """Register what an order waits for, also after a restart; return it with its resulting state."""
        # One that is not in memory has ended long ago.
        awaited = filter(self._orders.is_unfinished, order.status.dependencies)
        self._dependencies.add_waiting(order, awaited)
        return self.update_state(order)

    def apply_ended_orders(self) -> None:
        """Apply the effects of ended orders on those that depend on them and on their sequences."""
        while ended := self._orders.take_ended():  # an order that fails here may take others with it
            for order in ended:
                self._apply_end(order)

    def _apply_end(self, order: TransportOrder) -> None:
        self._dependencies.remove_waiting(order)
        failed, following = self._sequences.advance_after(order)
        outcome = order.status.ended_as or OrderOutcome.FAILED
        for member in failed:
            reason = Reason(
                R.SEQUENCE_FAILED,
                order.reason,
                order=order.name,
                sequence=order.status.wrapping_sequence or "",
                state=outcome,
            )
            self._orders.put(member.failed(reason, self._clock.now(), outcome))
        for number in self._dependencies.release_dependents(order.name):
            dependent = self._orders.get(number)
            if order.state is not S.FINISHED:
                dependent = self._failed_dependency(dependent, order.name, outcome)
            self._put_updated(dependent)
        if following and (successor := self._orders.named(following)):
            self._put_updated(successor)

    def _put_updated(self, order: TransportOrder) -> None:
        order = self.update_state(order)
        self._orders.put(order)
        self._state.dispatch_due |= order.state is S.DISPATCHABLE

    def update_state(self, order: TransportOrder) -> TransportOrder:
        """Return an ACTIVE order in the state that its conditions imply; return others unchanged."""
        if order.state is not S.ACTIVE:
            return order
        why = self._dependencies.why_waiting(order) or self._sequences.why_waiting(order)
        return order.waiting(why) if why else order.dispatchable()

    def _failed_dependency(self, order: TransportOrder, name: str, outcome: OrderOutcome) -> TransportOrder:
        """Return an order after the failure of a dependency, as its onDependencyFailure requires."""
        if order.state.final:
            return order
        reason = Reason(R.DEPENDENCY_ENDED, order=name, state=outcome)
        match order.status.on_dependency_failure:
            case DependencyFailure.FAIL:
                return order.failed(reason, self._clock.now(), outcome)
            case DependencyFailure.HOLD if not order.status.held:
                now = self._clock.now()
                return order.on_hold(Hold(by=HOLDER, since=now, **explained(reason)), now)
            case _:
                return order
