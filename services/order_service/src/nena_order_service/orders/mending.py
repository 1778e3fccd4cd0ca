"""What becomes of an order that a vehicle has failed at, or that a person holds."""

from __future__ import annotations

from datetime import datetime

from nena_order_service.orders.event_code import EventCode
from nena_order_service.orders.transport_order import TransportOrder, held_in_words
from nena_shared.fleet_api.failure_policy import Hold
from nena_shared.fleet_api.transport_order import DriveOrderState, DriveOrderStatus, TransportOrderState

S = TransportOrderState


def held(order: TransportOrder, hold: Hold, now: datetime) -> TransportOrder:
    """Let an order wait until a person resumes it; who has it keeps it."""
    order.require("holding", S.ACTIVE, S.DISPATCHABLE, S.BEING_PROCESSED)
    entry = order.entry(now, EventCode.HELD, hold.by, hold.reason)
    history = (*order.status.history, entry)
    return order.changed(held=hold, next_try=None, reason=held_in_words(hold), history=history)


def resumed(order: TransportOrder, by: str, reason: str, now: datetime) -> TransportOrder:
    """Let a held order go on; a person has looked after it, so it has all its tries again."""
    fresh = order.current.model_copy(update={"measures_taken": 0})
    entry = order.entry(now, EventCode.RESUMED, by, reason)
    changes: dict[str, object] = {"held": None, "drive_orders": order.with_current(fresh)}
    if order.state is S.DISPATCHABLE:
        changes["reason"] = "waits for its turn"
    elif order.state is S.ACTIVE:
        changes["reason"] = "waits for its conditions"
    return order.changed(history=(*order.status.history, entry), **changes)


def retried(
    order: TransportOrder, taken: int, why: str, *, now: datetime, next_try: datetime | None = None
) -> TransportOrder:
    """Let the same vehicle try again, at ``next_try`` where that is given."""
    return _again(order, EventCode.RETRIED, taken, why, now=now, next_try=next_try)


def replanned(
    order: TransportOrder,
    taken: int,
    why: str,
    *,
    now: datetime,
    avoided: tuple[str, ...],
    next_try: datetime | None = None,
) -> TransportOrder:
    """Let the same vehicle try again by a way that avoids these paths and points, too."""
    why = f"{why}; avoids {', '.join(avoided)}"
    order = _again(order, EventCode.REPLANNED, taken, why, now=now, next_try=next_try)
    current = order.current.model_copy(update={"avoided": (*order.current.avoided, *avoided)})
    return order.changed(drive_orders=order.with_current(current))


def reassigned(order: TransportOrder, taken: int, why: str, now: datetime) -> TransportOrder:
    """Let another vehicle go on with it; the one that has failed does not get it again."""
    assert order.vehicle, "it was assigned"  # noqa: S101 - for the type
    entry = order.entry(now, EventCode.REASSIGNED, order.vehicle, why)
    excluded = (*order.status.excluded_vehicles, order.vehicle)
    current = order.current.model_copy(update={"measures_taken": taken})
    order = order.changed(drive_orders=order.with_current(current))
    return order.dispatchable_again(entry, excluded_vehicles=excluded)


def skipped(order: TransportOrder, why: str, now: datetime) -> TransportOrder:
    """Leave the current operation out, and go on; its drive order counts as failed."""
    entry = order.entry(now, EventCode.SKIPPED, order.current.destination.operation, why)
    return order.moved_on(DriveOrderState.FAILED, entry)


def failed_while_held(order: TransportOrder, words: str) -> TransportOrder:
    """Say of an order that is held what has happened since: nothing is done about it before it is resumed."""
    assert order.status.held, "somebody holds it"  # noqa: S101 - for the type
    reason = f"{order.status.held.reason}; since then: {words}"
    return order.changed(held=order.status.held.model_copy(update={"reason": reason}))


def tried(order: TransportOrder) -> TransportOrder:
    """Let the pause before the next try be over."""
    return order.changed(next_try=None) if order.status.next_try else order


def begun_again(order: TransportOrder) -> TransportOrder:
    """Count another mission of the current drive order, which the vehicle travels to again."""
    current = order.current
    update = {"attempts": current.attempts + 1, "state": DriveOrderState.TRAVELLING}
    return order.changed(drive_orders=order.with_current(current.model_copy(update=update)))


def with_operation_begun(order: TransportOrder) -> tuple[DriveOrderStatus, ...]:
    """Give the drive orders, the current one OPERATING also where an earlier try of its vehicle was."""
    marks = (
        EventCode.OPERATION_STARTED,
        EventCode.DRIVE_ORDER_FINISHED,
        EventCode.SKIPPED,
        EventCode.ASSIGNED_TO_VEHICLE,
    )
    codes = (entry.event_code for entry in reversed(order.status.history))
    if next((code for code in codes if code in marks), None) != EventCode.OPERATION_STARTED:
        return order.status.drive_orders
    return order.with_current(order.current.model_copy(update={"state": DriveOrderState.OPERATING}))


def _again(
    order: TransportOrder,
    code: EventCode,
    taken: int,
    why: str,
    *,
    now: datetime,
    next_try: datetime | None,
) -> TransportOrder:
    current = order.current.model_copy(update={"measures_taken": taken})
    entry = order.entry(now, code, why)
    return order.changed(
        drive_orders=order.with_current(current),
        next_try=next_try,
        history=(*order.status.history, entry),
    )
