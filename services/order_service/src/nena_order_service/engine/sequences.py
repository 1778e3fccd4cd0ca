"""Order sequences (openTCS): which order is next, and which vehicle executes them."""

from __future__ import annotations

from nena_order_service.engine.context import Context
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, TransportOrderState

MARKED = "marked complete by a host"


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

    def why_waiting(self, order: TransportOrder) -> str:
        """Return what an order waits for in its sequence; empty if it does not wait."""
        sequence = self._of(order)
        if sequence is None or sequence.next_order in (None, order.name):
            return ""
        return f"waits for its turn in order sequence {sequence.name!r}, after {sequence.next_order!r}"

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

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> str:
        """Return why a vehicle must not execute an order because of a sequence; empty if it may."""
        bound, sequence = self._sequences.of_vehicle(vehicle), self._of(order)
        if bound and bound is not sequence:
            return f"is bound to order sequence {bound.name!r}"
        if sequence is None:
            return ""
        meant = sequence.bound_vehicle or sequence.status.intended_vehicle
        if meant not in (None, vehicle):
            return f"is not the vehicle of order sequence {sequence.name!r}, which is {meant!r}"
        return ""

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
        self._sequences.freed |= sequence.status.finished

    def _is_ended(self, name: str) -> bool:
        """Return whether an order has ended; one that is not in memory ended long ago."""
        order = self._orders.named(name)
        return order is None or order.state.final


def _is_fatal(order: TransportOrder, sequence: OrderSequence) -> bool:
    well = order.state is TransportOrderState.FINISHED
    return sequence.status.failure_fatal and not well and not order.status.dispensable
