"""An order sequence: the rules for its order of execution and its vehicle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Self

from nena_shared.fleet_api.transport_order import (
    HistoryEntry,
    OrderSequenceRequest,
    OrderSequenceStatus,
    TransportOrderRequest,
)
from nena_shared.fleet_api.vehicle import ANY_TYPE

ORDERS_LIMIT = 1000
"""Maximum number of orders in a sequence."""

EMPTY = "waiting for orders, or to be marked complete"


class SequenceEvent(StrEnum):
    """Type of an event of an order sequence."""

    SEQUENCE_CREATED = "nena:sequenceCreated"
    ORDER_APPENDED = "nena:orderAppended"
    PROCESSING_VEHICLE_CHANGED = "nena:processingVehicleChanged"
    SEQUENCE_COMPLETED = "nena:sequenceCompleted"
    SEQUENCE_FINISHED = "nena:sequenceFinished"


REQUEST_FIELDS = ("order_types", "intended_vehicle", "failure_fatal", "properties")
"""Fields that a sequence copies from its request."""


class SequenceRuleError(Exception):
    """A change that the rules do not allow: a fault of the caller, never of a host."""


@dataclass(frozen=True, slots=True)
class OrderSequence:
    """An immutable order sequence; each change returns a new one with the next version."""

    number: int
    """Number of the sequence in its store."""
    status: OrderSequenceStatus
    idempotency_key: str | None = None

    @classmethod
    def created(cls, request: OrderSequenceRequest, *, number: int, name: str, now: datetime) -> Self:
        """Create an empty sequence."""
        status = OrderSequenceStatus(
            name=name,
            version=1,
            reason=EMPTY,
            created=now,
            history=(HistoryEntry(timestamp=now, event_code=SequenceEvent.SEQUENCE_CREATED),),
            **{field: getattr(request, field) for field in REQUEST_FIELDS},
        )
        return cls(number, status, request.idempotency_key)

    def was_created_by(self, request: OrderSequenceRequest) -> bool:
        """Return whether ``request`` has the same content as the one that created it, apart from names."""
        return all(getattr(self.status, field) == getattr(request, field) for field in REQUEST_FIELDS)

    @property
    def name(self) -> str:
        """The name, unique among the sequences of the store."""
        return self.status.name

    @property
    def next_order(self) -> str | None:
        """Name of the order that may be executed now; None: the sequence waits for one."""
        index = self.status.finished_index + 1
        return self.status.orders[index] if index < len(self.status.orders) else None

    @property
    def bound_vehicle(self) -> str | None:
        """Name of the vehicle reserved until the sequence is finished; None: not bound yet."""
        return None if self.status.finished else self.status.processing_vehicle

    def refusals(self, request: TransportOrderRequest) -> Iterator[str]:
        """Yield the reasons against adding an order."""
        status, order_type = self.status, request.type
        if status.complete:
            yield "it is complete; create another one"
        if len(status.orders) >= ORDERS_LIMIT:
            yield f"it already has {ORDERS_LIMIT} orders; create another one"
        if not {ANY_TYPE, order_type} & set(status.order_types):
            types = ", ".join(map(repr, status.order_types))
            yield f"it accepts no orders of type {order_type!r}, only {types}"
        # openTCS wants the same vehicle in both; here an order may also name none.
        if request.intended_vehicle not in (None, status.intended_vehicle):
            meant = f"vehicle {status.intended_vehicle!r}" if status.intended_vehicle else "any vehicle"
            intended = request.intended_vehicle
            yield f"it is for {meant}, and the order is for {intended!r}; name the same vehicle, or none"

    def appended(self, order: str, now: datetime) -> Self:
        """Add an order behind all others."""
        if self.status.complete:
            raise SequenceRuleError(f"order sequence {self.name!r} is complete")
        orders = (*self.status.orders, order)
        return self._with_event(now, SequenceEvent.ORDER_APPENDED, order, orders=orders)

    def bound(self, vehicle: str, now: datetime) -> Self:
        """Bind the whole sequence to a vehicle."""
        if self.bound_vehicle == vehicle:
            return self
        if self.bound_vehicle or self.status.finished:
            raise SequenceRuleError(f"order sequence {self.name!r} is not free for {vehicle!r}")
        event = SequenceEvent.PROCESSING_VEHICLE_CHANGED
        return self._with_event(now, event, vehicle, processing_vehicle=vehicle)

    def rebound(self, vehicle: str) -> Self:
        """Replace the name of the bound vehicle, after a change of the plant model."""
        status = self.status.model_copy(
            update={"processing_vehicle": vehicle, "version": self.status.version + 1}
        )
        return type(self)(
            self.number, status.model_copy(update={"reason": _in_words(status)}), self.idempotency_key
        )

    def completed(self, why: str, now: datetime) -> Self:
        """Close the sequence to new orders; do nothing if it is already complete."""
        if self.status.complete:
            return self
        return self._with_event(now, SequenceEvent.SEQUENCE_COMPLETED, why, complete=True)

    def advanced(self, is_ended: Callable[[str], bool], now: datetime) -> Self:
        """Advance past all ended orders without a gap; never go back."""
        index, orders = self.status.finished_index, self.status.orders
        while index + 1 < len(orders) and is_ended(orders[index + 1]):
            index += 1
        if index == self.status.finished_index:
            return self
        return self._with_event(now, None, finished_index=index)

    def behind(self, order: str) -> tuple[str, ...]:
        """Return the names of the orders behind ``order``."""
        return self.status.orders[self.status.orders.index(order) + 1 :]

    def _with_event(
        self, now: datetime, event: SequenceEvent | None, *supplements: str, **changes: object
    ) -> Self:
        history = self.status.history
        if event:
            history = (*history, HistoryEntry(timestamp=now, event_code=event, supplements=supplements))
        update = {**changes, "version": self.status.version + 1, "history": history}
        status = self.status.model_copy(update=update)
        # Only now: hosts may mark it complete before or after its last order has ended.
        if status.complete and status.finished_index + 1 == len(status.orders):
            end = HistoryEntry(timestamp=now, event_code=SequenceEvent.SEQUENCE_FINISHED)
            update = {"finished": True, "finished_time": now, "history": (*history, end)}
            status = status.model_copy(update=update)
        status = status.model_copy(update={"reason": _in_words(status)})
        return type(self)(self.number, status, self.idempotency_key)


def _in_words(status: OrderSequenceStatus) -> str:
    """Return what a sequence waits for, or how it ended."""
    if status.finished:
        return "is complete, and all of its orders have ended"
    index, vehicle = status.finished_index + 1, status.processing_vehicle
    if index == len(status.orders):
        return EMPTY
    place = f"{status.orders[index]!r}, {index + 1} of {len(status.orders)}"
    return f"vehicle {vehicle} will execute {place}" if vehicle else f"waiting for a vehicle to start {place}"
