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

    def append(self, order: TransportOrder) -> None:
        """Add an order to its sequence, if it has one; the caller has checked that it may be added."""
        if sequence := self._of(order):
            self._put(sequence.appended(order.name, self._clock.now()))

    def bind(self, order: TransportOrder, vehicle: str) -> None:
        """Bind the order's sequence, if it has one, to the vehicle that gets the order."""
        if sequence := self._of(order):
            self._put(sequence.bound(vehicle, self._clock.now()))

    def why_waiting(self, order: TransportOrder) -> Reason | None:
        """Return what an order waits for in its sequence; None if it does not wait."""
        sequence = self._of(order)
        if sequence is None or sequence.next_order in (None, order.name):
            return None
        return Reason(R.WAITS_IN_SEQUENCE, sequence=sequence.name, order=sequence.next_order)

    def ended(self, order: TransportOrder) -> tuple[tuple[TransportOrder, ...], str | None]:
        """Advance the sequence of an order that has ended.

        Return the orders that fail with it, and the name of the next order in the sequence, if any.
        """
        sequence = self._of(order)
        if sequence is None:
            return (), None
        failed: tuple[TransportOrder, ...] = ()
        if _is_fatal(order, sequence):
            behind = map(self._orders.named, sequence.behind(order.name))
            failed = tuple(each for each in behind if each and not each.state.final)
            sequence = sequence.completed(f"order {order.name!r} is {order.state}", self._clock.now())
        sequence = sequence.advanced(self._is_ended, self._clock.now())
        self._put(sequence)
        return failed, sequence.next_order

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> Reason | None:
        """Return why a vehicle must not execute an order because of a sequence; None if it may."""
        bound, sequence = self._sequences.of_vehicle(vehicle), self._of(order)
        if bound and bound is not sequence:
            return Reason(R.BOUND_TO_SEQUENCE, sequence=bound.name)
        if sequence is None:
            return None
        meant = sequence.bound_vehicle or sequence.status.intended_vehicle
        if meant not in (None, vehicle):
            return Reason(R.NOT_OF_SEQUENCE, sequence=sequence.name, vehicle=meant)
        return None

    def meant(self, order: TransportOrder) -> str | None:
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

    def _is_ended(self, name: str) -> bool:
        """Return whether an order has ended; one that is not in memory ended long ago."""
        order = self._orders.named(name)
        return order is None or order.state.final


def _is_fatal(order: TransportOrder, sequence: OrderSequence) -> bool:
    well = order.state is S.FINISHED
    return sequence.status.failure_fatal and not well and not order.status.dispensable


class Dependencies:
    """Tracks which other orders each waiting order depends on."""

    def __init__(self) -> None:
        self._waits_for: dict[int, set[str]] = {}
        self._dependents: dict[str, set[int]] = {}

    def wait(self, order: TransportOrder, pending: Iterable[str]) -> None:
        """Make an order wait for the orders with these names."""
        names = set(pending)
        if names:
            self._waits_for[order.number] = names
        for name in names:
            self._dependents.setdefault(name, set()).add(order.number)

    def settle(self, name: str) -> tuple[int, ...]:
        """Release the orders that wait for an order; return their numbers, oldest first."""
        numbers = tuple(sorted(self._dependents.pop(name, ())))
        for number in numbers:
            names = self._waits_for[number]
            names.discard(name)
            if not names:
                del self._waits_for[number]
        return numbers

    def forget(self, order: TransportOrder) -> None:
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
        self._orders = context.state.orders
        self._sequences = sequences
        self._clock = context.clock
        self._dependencies = Dependencies()

    def begin(self, order: TransportOrder, ended: Mapping[str, TransportOrderState]) -> TransportOrder:
        """Check a new order's dependencies; return the order with its resulting state.

        ``ended`` has the final states of dependencies that are no longer in memory.
        """
        for name in order.status.dependencies:
            known = self._orders.named(name)
            state = known.state if known else ended[name]
            if state.final and state is not S.FINISHED:
                order = self._failed_dependency(order, name, state)
                if order.state.final:
                    return order
        return self.restore(order)

    def restore(self, order: TransportOrder) -> TransportOrder:
        """Register what an order waits for, also after a restart; return it with its resulting state."""
        self._dependencies.wait(order, filter(self._is_awaited, order.status.dependencies))
        return self.look(order)

    def settle(self) -> bool:
        """Apply the effects of ended orders on others; return whether any of these can be dispatched now."""
        dispatchable = False
        while ended := self._orders.take_ended():
            for order in ended:
                dispatchable |= self._ended(order)
        return dispatchable

    def _ended(self, order: TransportOrder) -> bool:
        self._dependencies.forget(order)
        failed, following = self._sequences.ended(order)
        for each in failed:
            reason = Reason(
                R.SEQUENCE_FAILED,
                order.reason,
                order=order.name,
                sequence=order.status.wrapping_sequence or "",
                state=order.state,
            )
            self._orders.put(each.failed(reason, self._clock.now()))
        dispatchable = False
        for number in self._dependencies.settle(order.name):
            dependent = self._orders.get(number)
            if order.state is not S.FINISHED:
                dependent = self._failed_dependency(dependent, order.name, order.state)
            dispatchable |= self._look_again(dependent)
        if following and (one := self._orders.named(following)):
            dispatchable |= self._look_again(one)
        return dispatchable

    def _look_again(self, order: TransportOrder) -> bool:
        """Update an order's state by its current conditions; return whether it can be dispatched."""
        order = self.look(order)
        self._orders.put(order)
        return order.state is S.DISPATCHABLE

    def look(self, order: TransportOrder) -> TransportOrder:
        """Return an ACTIVE order in the state that its conditions imply; return others unchanged."""
        if order.state is not S.ACTIVE:
            return order
        why = self._dependencies.why_waiting(order) or self._sequences.why_waiting(order)
        return order.waiting(why) if why else order.dispatchable()

    def _failed_dependency(
        self, order: TransportOrder, name: str, state: TransportOrderState
    ) -> TransportOrder:
        """Return an order after the failure of a dependency, as its onDependencyFailure requires."""
        if order.state.final:
            return order
        reason = Reason(R.DEPENDENCY_ENDED, order=name, state=state)
        match order.status.on_dependency_failure:
            case DependencyFailure.FAIL:
                return order.failed(reason, self._clock.now())
            case DependencyFailure.HOLD if not order.status.held:
                now = self._clock.now()
                return order.on_hold(Hold(by=HOLDER, since=now, **explained(reason)), now)
            case _:
                return order

    def _is_awaited(self, name: str) -> bool:
        order = self._orders.named(name)
        return order is not None and not order.state.final
