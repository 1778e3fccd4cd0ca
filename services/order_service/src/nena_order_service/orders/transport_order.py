"""Transport orders: their life cycle, their history, and their changes after failures and holds."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from secrets import token_hex
from typing import Any, Self, cast

from nena_shared.clock import iso
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    DriveOrderStatus,
    HistoryEntry,
    Hold,
    OrderOutcome,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)


class EventCode(StrEnum):
    """Type of an event of a transport order; the supplements of an entry explain it."""

    ORDER_CREATED = "nena:orderCreated"
    DISPATCHING_DEFERRED = "nena:dispatchingDeferred"
    """The order is dispatchable but not assigned yet; consecutive deferrals share one entry."""
    ASSIGNED_TO_VEHICLE = "nena:assignedToVehicle"
    OPERATION_STARTED = "nena:operationStarted"
    DRIVE_ORDER_FINISHED = "nena:driveOrderFinished"
    HELD = "nena:held"
    RESUMED = "nena:resumed"
    RETRIED = "nena:retried"
    REPLANNED = "nena:replanned"
    REASSIGNED = "nena:reassigned"
    SKIPPED = "nena:skipped"
    DEADLINE_PASSED = "nena:deadlinePassed"
    REROUTED = "nena:rerouted"
    CHANGED = "nena:changed"
    """A host changed its priority, deadline or timeout."""
    INTENDED_VEHICLE_CHANGED = "nena:intendedVehicleChanged"
    WITHDRAWAL_REQUESTED = "nena:withdrawalRequested"
    ADOPTED_AFTER_RESTART = "nena:adoptedAfterRestart"
    FINAL_STATE_REACHED = "nena:finalStateReached"


def sortable_id() -> str:
    """Return a unique ID; later ones sort behind earlier ones."""
    # The time first, as in the ULID that openTCS appends to incomplete names.
    return f"{time.time_ns() // 1_000_000:012x}{token_hex(5)}"


S = TransportOrderState
R = ReasonCode

CREATED = Reason(R.CREATED)
WAITS_FOR_CONDITIONS = Reason(R.WAITS_FOR_CONDITIONS)
WAITS_FOR_TURN = Reason(R.WAITS_FOR_TURN)
WAITS_FOR_ANOTHER_VEHICLE = Reason(R.WAITS_FOR_ANOTHER_VEHICLE)

SUCCESSORS: dict[TransportOrderState, frozenset[TransportOrderState]] = {
    S.RAW: frozenset({S.ACTIVE, S.UNROUTABLE}),
    S.ACTIVE: frozenset({S.DISPATCHABLE, S.FAILED}),
    S.DISPATCHABLE: frozenset({S.BEING_PROCESSED, S.FAILED}),
    S.BEING_PROCESSED: frozenset({S.FINISHED, S.FAILED, S.WITHDRAWN, S.DISPATCHABLE}),
    S.WITHDRAWN: frozenset({S.FAILED}),
    S.FINISHED: frozenset(),
    S.FAILED: frozenset(),
    S.UNROUTABLE: frozenset(),
}
"""Successors of each state: openTCS's life cycle, plus continuing with another vehicle."""

REQUEST_FIELDS = (
    "type",
    "priority",
    "intended_vehicle",
    "properties",
    "deadline",
    "dispensable",
    "peripheral_reservation_token",
    "dependencies",
    "on_dependency_failure",
    "wrapping_sequence",
    "on_failure",
    "timeout",
    "processing_timeout",
)
"""Fields that an order copies from its request, besides the destinations and the trace.

A repeated request has all of these again, but usually another ``traceparent``.
"""

OWN_WITHDRAWALS = {
    R.GIVES_WAY: OrderOutcome.GAVE_WAY,
    R.NOT_STARTED: OrderOutcome.GAVE_WAY,
    R.NOT_DONE_SINCE_CREATION: OrderOutcome.FAILED,
    R.NOT_DONE_SINCE_ASSIGNMENT: OrderOutcome.FAILED,
}
"""Reasons for which the order service itself withdraws orders, and how these end."""

HARMLESS = frozenset({*OWN_WITHDRAWALS, R.RELEASED, R.BASE_FINISHED})
"""Causes of the end of an order that gave way; with others, something has failed, too."""

Urgency = tuple[int, float, int]
"""Lower is more urgent; the last element is the order's number."""

NOTHING = frozenset[str]()

RESOURCES_TO_AVOID = "tcs:resourcesToAvoid"
"""Property of an order: comma-separated names of points, paths and locations that its routes must not use."""


class IllegalTransitionError(Exception):
    """A change that the life cycle does not allow: a fault of the caller, never of a host."""

    def __init__(self, name: str, state: TransportOrderState, change: str) -> None:
        super().__init__(f"transport order {name!r} is {state}: {change} is not possible")
        self.name = name
        self.state = state


@dataclass(frozen=True, slots=True)
class TransportOrder:
    """An immutable transport order; each change returns a new one with the next version.

    ``status`` is the hosts' view of it. Every method that changes it raises IllegalTransitionError if the
    life cycle forbids the change.
    """

    number: int
    """Number of the order in its store; later orders have higher ones, even within a millisecond."""
    status: TransportOrderStatus
    idempotency_key: str | None = None

    @classmethod
    def created(
        cls,
        request: TransportOrderRequest,
        *,
        number: int,
        name: str,
        now: datetime,
        automatic: bool = False,
        by: str | None = None,
    ) -> Self:
        """Create a RAW order; ``automatic``: not requested by a host; ``by``: who requested it."""
        asked = vars(request)
        status = TransportOrderStatus(
            name=name,
            version=1,
            state=S.RAW,
            **explained(CREATED),
            automatic=automatic,
            drive_orders=tuple(
                DriveOrderStatus(destination=destination, state=DriveOrderState.PRISTINE)
                for destination in request.destinations
            ),
            current_drive_order_index=-1,
            created=now,
            created_by=by,
            history=(HistoryEntry(timestamp=now, event_code=EventCode.ORDER_CREATED),),
            traceparent=request.traceparent,
            **{field: asked[field] for field in REQUEST_FIELDS},
        )
        return cls(number, status, request.idempotency_key)

    def was_created_by(self, request: TransportOrderRequest) -> bool:
        """Return whether ``request`` equals the one that created the order, apart from names."""
        same_stops = tuple(order.destination for order in self.status.drive_orders) == request.destinations
        return same_stops and all(
            getattr(self.status, field) == getattr(request, field)
            for field in REQUEST_FIELDS
            if field not in self._changed_fields
        )

    @property
    def _changed_fields(self) -> set[str]:
        """Fields of its request that were changed later."""
        entries = self.status.history
        vehicle = any(each.event_code == EventCode.INTENDED_VEHICLE_CHANGED for each in entries)
        words = (
            word for each in entries if each.event_code == EventCode.CHANGED for word in each.supplements
        )
        return {word.partition("=")[0] for word in words} | ({"intended_vehicle"} if vehicle else set())

    @property
    def name(self) -> str:
        """The name, unique in the store."""
        return self.status.name

    @property
    def state(self) -> TransportOrderState:
        """Return the order's state in its life cycle."""
        return self.status.state

    @property
    def reason(self) -> Reason:
        """The reason for its state, or what it waits for."""
        return Reason.of(self.status.reason, self.status.coded_reason)

    @property
    def vehicle(self) -> str | None:
        """Name of the vehicle that works on the order, or did."""
        return self.status.processing_vehicle

    @property
    def index(self) -> int:
        """Return the index of its current destination, from 0; 0 before it was first assigned."""
        index = self.status.current_drive_order_index
        return index if index > 0 else 0  # noqa: FURB136 - it is read too often for a call

    @property
    def current(self) -> DriveOrderStatus:
        """The current destination."""
        return self.status.drive_orders[self.index]

    @property
    def is_operating(self) -> bool:
        """Whether its vehicle is executing the operation at the current destination."""
        return self.current.state is DriveOrderState.OPERATING

    @property
    def held(self) -> bool:
        """Whether the order is held until a person resumes it."""
        return self.status.held is not None

    @property
    def resources_to_avoid(self) -> frozenset[str]:
        """Names of points, paths and locations that routes must not use, with those of the drive order."""
        avoided = self.current.avoided
        if not self.status.properties and not avoided:
            return NOTHING
        listed = next(
            (property_.value for property_ in self.status.properties if property_.key == RESOURCES_TO_AVOID),
            "",
        )
        named = frozenset(name for part in listed.split(",") if (name := part.strip()))
        return named.union(avoided)

    @property
    def urgency(self) -> Urgency:
        """Sort key of dispatching: higher priority, then earlier deadline, then age."""
        deadline = self.status.deadline
        # openTCS sorts by deadline and age (BY_DEADLINE) and has no priorities.
        return (-self.status.priority, deadline.timestamp() if deadline else float("inf"), self.number)

    def activated(self) -> Self:
        """Accept a RAW order; it is ACTIVE while it waits for its conditions."""
        return self._move_to(S.ACTIVE, WAITS_FOR_CONDITIONS)

    def dispatchable(self) -> Self:
        """Make an ACTIVE order assignable."""
        held = self.status.held
        return self._move_to(S.DISPATCHABLE, why_held(held) if held else WAITS_FOR_TURN)

    def waiting(self, reason: Reason) -> Self:
        """Return the order with its wait reason; unchanged if it is the same, or if the order is held."""
        self.require("waiting for its conditions", S.ACTIVE)
        same = self.status.held or reason.is_sent_as(self.status.coded_reason)
        return self if same else self.changed(**explained(reason))

    def unroutable(self, reason: Reason, now: datetime) -> Self:
        """Refuse a RAW order for which the plant has no route."""
        return self._end_in(S.UNROUTABLE, reason, now)

    def intended_for(self, vehicle: str | None, now: datetime) -> Self:
        """Set the intended vehicle of an unassigned order; None: any."""
        self.require("changing the intended vehicle", S.ACTIVE, S.DISPATCHABLE)
        if vehicle == self.status.intended_vehicle:
            return self
        entry = self.entry(now, EventCode.INTENDED_VEHICLE_CHANGED, vehicle or Reason(R.ANY_VEHICLE))
        history = (*self.status.history, entry)
        reason = self.reason if self.state is S.ACTIVE or self.held else WAITS_FOR_TURN
        return self.changed(intended_vehicle=vehicle, history=history, **explained(reason))

    def altered(self, changes: Mapping[str, object], now: datetime) -> Self:
        """Change the priority, intended vehicle, deadline or timeout of an unassigned order."""
        self.require("changing it", S.ACTIVE, S.DISPATCHABLE)
        new = {name: value for name, value in changes.items() if getattr(self.status, name) != value}
        order = self
        if "intended_vehicle" in new:
            order = self.intended_for(cast("str | None", new.pop("intended_vehicle")), now)
        if not new:
            return order
        words = (
            f"{name}={iso(value) if isinstance(value, datetime) else value}" for name, value in new.items()
        )
        entry = self.entry(now, EventCode.CHANGED, *words)
        if "deadline" in new:
            new["late"] = False  # until the new one has passed
        return order.changed(history=(*order.status.history, entry), **new)

    def deferred(self, reason: Reason, now: datetime) -> Self:
        """Note why a DISPATCHABLE order is not assigned yet; the same reason again changes nothing."""
        self.require("deferring", S.DISPATCHABLE)
        if reason.is_sent_as(self.status.coded_reason):
            return self
        # Reasons change with each decision; entries of their own would fill the history.
        history = self.status.history
        if history[-1].event_code == EventCode.DISPATCHING_DEFERRED:
            history = history[:-1]
        entry = self.entry(now, EventCode.DISPATCHING_DEFERRED, reason)
        return self.changed(history=(*history, entry), **explained(reason))

    def assigned(self, vehicle: str, routes: Iterable[tuple[str, ...]], why: Reason, now: datetime) -> Self:
        """Assign the order to a vehicle, with the names of the points of each remaining route."""
        self.require("assigning", S.DISPATCHABLE)
        done, left = self.status.drive_orders[: self.index], self.status.drive_orders[self.index :]
        states = (DriveOrderState.TRAVELLING, *(drive_order.state for drive_order in left[1:]))
        planned = [
            drive_order.model_copy(update={"route": route, "state": state})
            for drive_order, route, state in zip(left, routes, states, strict=True)
        ]
        return self._move_to(
            S.BEING_PROCESSED,
            None,
            self.entry(now, EventCode.ASSIGNED_TO_VEHICLE, vehicle, why),
            processing_vehicle=vehicle,
            current_drive_order_index=self.index,
            drive_orders=(*done, *planned),
            assigned=self.status.assigned or now,
        )

    def dispatchable_again(self, entry: HistoryEntry, **changes: object) -> Self:
        """Make the order assignable to another vehicle, from its current destination on."""
        waiting = self.current.model_copy(update={"state": DriveOrderState.PRISTINE, "route": None})
        return self._move_to(
            S.DISPATCHABLE,
            WAITS_FOR_ANOTHER_VEHICLE,
            entry,
            processing_vehicle=None,
            drive_orders=self.with_current(waiting),
            **changes,
        )

    def operating(self, index: int, now: datetime) -> Self:
        """Note that the operation at the destination of drive order ``index`` has started."""
        self.require("starting an operation", S.BEING_PROCESSED, S.WITHDRAWN)
        if self.status.drive_orders[index].state is not DriveOrderState.TRAVELLING:
            return self
        operation = self.status.drive_orders[index].destination.operation
        return self.changed(
            drive_orders=self._with_drive_order(index, DriveOrderState.OPERATING),
            history=(*self.status.history, self.entry(now, EventCode.OPERATION_STARTED, operation)),
        )

    def drive_order_finished(self, index: int, now: datetime) -> Self:
        """Note that drive order ``index`` is done; if there is a next one, the vehicle travels on.

        A drive order that is not the current one changes nothing.
        """
        self.require("finishing a drive order", S.BEING_PROCESSED, S.WITHDRAWN)
        if index != self.status.current_drive_order_index:
            return self
        place = Reason(R.DESTINATION, number=index + 1, total=len(self.status.drive_orders))
        return self.moved_on(DriveOrderState.FINISHED, self.entry(now, EventCode.DRIVE_ORDER_FINISHED, place))

    def moved_on(self, state: DriveOrderState, entry: HistoryEntry) -> Self:
        """End the current drive order in ``state``; travel to the next one, if any."""
        index = self.status.current_drive_order_index
        done = self._with_drive_order(index, state)
        changes: dict[str, Any] = {"drive_orders": done, "history": (*self.status.history, entry)}
        if index + 1 < len(done):
            travelling = done[index + 1].model_copy(update={"state": DriveOrderState.TRAVELLING})
            changes["drive_orders"] = (*done[: index + 1], travelling, *done[index + 2 :])
            changes["current_drive_order_index"] = index + 1
        return self.changed(**changes)

    def finished(self, now: datetime) -> Self:
        """Finish the order: every drive order is done, or its operation was skipped by the policy."""
        ended = (DriveOrderState.FAILED, DriveOrderState.FINISHED)  # FAILED: skipped by the policy
        drive_orders = tuple(
            order if order.state in ended else order.model_copy(update={"state": DriveOrderState.FINISHED})
            for order in self.status.drive_orders
        )
        left_out = sum(order.state is DriveOrderState.FAILED for order in drive_orders)
        vehicle = self.vehicle or ""
        return self._end_in(
            S.FINISHED,
            Reason(R.DONE_WITHOUT, vehicle=vehicle, count=left_out)
            if left_out
            else Reason(R.DONE, vehicle=vehicle),
            now,
            drive_orders=drive_orders,
            current_drive_order_index=len(drive_orders) - 1,
        )

    def failed(self, reason: Reason, now: datetime, cause: OrderOutcome | None = None) -> Self:
        """Fail the order; its unfinished drive orders fail as well.

        ``cause`` is the outcome of another order that takes it along: with a withdrawn one, it is withdrawn.
        """
        drive_orders = tuple(
            order
            if order.state is DriveOrderState.FINISHED
            else order.model_copy(update={"state": DriveOrderState.FAILED})
            for order in self.status.drive_orders
        )
        outcome = self._outcome_in(S.FAILED, reason)
        if cause is OrderOutcome.WITHDRAWN and outcome.failure:
            outcome = cause
        return self._end_in(S.FAILED, reason, now, drive_orders=drive_orders, outcome=outcome)

    def withdrawn(self, reason: Reason | str, now: datetime) -> Self:
        """Withdraw the order: it fails at once, or once the vehicle that works on it has released it."""
        reason = Reason.of(reason)
        entry = self.entry(now, EventCode.WITHDRAWAL_REQUESTED, reason)
        if self.state not in (S.ACTIVE, S.DISPATCHABLE):
            return self._move_to(S.WITHDRAWN, None, entry, held=None, next_try=None)
        # No vehicle has it, so there is nothing to wait for.
        noted = self.status.model_copy(update={"history": (*self.status.history, entry)})
        return type(self)(self.number, noted, self.idempotency_key).failed(reason, now)

    def rerouted(self, route: tuple[str, ...] | None, why: Reason, now: datetime) -> Self:
        """Note that the vehicle was rerouted; ``route`` None: the new route is not known yet."""
        self.require("rerouting", S.BEING_PROCESSED)
        current = self.current if route is None else self.current.model_copy(update={"route": route})
        entry = self.entry(now, EventCode.REROUTED, why)
        return self.changed(drive_orders=self.with_current(current), history=(*self.status.history, entry))

    def with_wait_reason(self, why: Reason | None) -> Self:
        """Note why the vehicle cannot continue, None if it can; a repeated reason changes nothing."""
        self.require("getting a wait reason", S.BEING_PROCESSED, S.WITHDRAWN)
        reason = Reason(R.BUT, _activity_of(self.status), why) if why else _activity_of(self.status)
        same = reason.is_sent_as(self.status.coded_reason)
        return self if same else self.changed(**explained(reason))

    def overdue(self, now: datetime) -> Self:
        """Note that the deadline has passed; this has no other effect."""
        if self.state.final or self.status.late:
            return self
        entry = self.entry(now, EventCode.DEADLINE_PASSED)
        history = (*self.status.history, entry)
        return self.changed(late=True, history=history, **explained(self.reason))

    def adopted(self, now: datetime, vehicle: str | None = None) -> Self:
        """Note that the order was restored after a restart of the order service.

        ``vehicle`` is its vehicle's new name, if the plant model has changed; None: unchanged.
        """
        self.require("adopting", S.BEING_PROCESSED, S.WITHDRAWN)
        previous, vehicle = self.vehicle or "", vehicle or self.vehicle or ""
        why = Reason(R.ADOPTED, vehicle=vehicle)
        if vehicle != previous:
            why = Reason(R.ADOPTED_RENAMED, vehicle=vehicle, before=previous)
        entry = self.entry(now, EventCode.ADOPTED_AFTER_RESTART, why)
        return self.changed(processing_vehicle=vehicle, history=(*self.status.history, entry))

    def on_hold(self, hold: Hold, now: datetime) -> Self:
        """Put the order on hold until a person resumes it; it keeps its vehicle."""
        self.require("holding", S.ACTIVE, S.DISPATCHABLE, S.BEING_PROCESSED)
        entry = self.entry(now, EventCode.HELD, hold.by, Reason.of(hold.reason, hold.coded_reason))
        history = (*self.status.history, entry)
        return self.changed(held=hold, next_try=None, history=history, **explained(why_held(hold)))

    def resumed(self, by: str, reason: str, now: datetime) -> Self:
        """Resume a held order, with all its retries available again."""
        fresh = self.current.model_copy(update={"measures_taken": 0})
        entry = self.entry(now, EventCode.RESUMED, by, Reason.of(reason))
        changes: dict[str, object] = {"held": None, "drive_orders": self.with_current(fresh)}
        if self.state is S.DISPATCHABLE:
            changes |= explained(WAITS_FOR_TURN)
        elif self.state is S.ACTIVE:
            changes |= explained(WAITS_FOR_CONDITIONS)
        return self.changed(history=(*self.status.history, entry), **changes)

    def failed_while_held(self, words: Reason) -> Self:
        """Add a failure that occurred while the order is held; it takes effect when the order is resumed."""
        hold = self.status.held
        assert hold, "asked for held orders only"  # noqa: S101 - for the type
        reason = Reason(R.SINCE_THEN, Reason.of(hold.reason, hold.coded_reason), words)
        return self.changed(held=hold.model_copy(update=explained(reason)))

    def retried(self, taken: int, why: Reason, *, now: datetime, next_try: datetime | None = None) -> Self:
        """Note a retry by the same vehicle, at ``next_try`` if given."""
        return self._with_measures(EventCode.RETRIED, taken, why, now=now, next_try=next_try)

    def replanned(
        self,
        taken: int,
        why: Reason,
        *,
        now: datetime,
        avoided: tuple[str, ...],
        next_try: datetime | None = None,
    ) -> Self:
        """Note a retry by the same vehicle on a route that also avoids these paths and points."""
        why = Reason(R.AVOIDS, why, names=", ".join(avoided))
        order = self._with_measures(EventCode.REPLANNED, taken, why, now=now, next_try=next_try)
        current = order.current.model_copy(update={"avoided": (*order.current.avoided, *avoided)})
        return order.changed(drive_orders=order.with_current(current))

    def reassigned(self, taken: int, why: Reason, now: datetime) -> Self:
        """Release the order for another vehicle; the one that failed does not get it again."""
        assert self.vehicle, "it was assigned"  # noqa: S101 - for the type
        entry = self.entry(now, EventCode.REASSIGNED, self.vehicle, why)
        excluded = (*self.status.excluded_vehicles, self.vehicle)
        current = self.current.model_copy(update={"measures_taken": taken})
        order = self.changed(drive_orders=self.with_current(current))
        return order.dispatchable_again(entry, excluded_vehicles=excluded)

    def skipped(self, why: Reason, now: datetime) -> Self:
        """Skip the current operation and continue; its drive order counts as failed."""
        entry = self.entry(now, EventCode.SKIPPED, self.current.destination.operation, why)
        return self.moved_on(DriveOrderState.FAILED, entry)

    def tried(self) -> Self:
        """End the pause before the next try."""
        return self.changed(next_try=None) if self.status.next_try else self

    def restarted(self) -> Self:
        """Count another VDA 5050 order for the current drive order, to which the vehicle travels again."""
        current = self.current
        update = {"attempts": current.attempts + 1, "state": DriveOrderState.TRAVELLING}
        return self.changed(drive_orders=self.with_current(current.model_copy(update=update)))

    def with_operation_begun(self) -> tuple[DriveOrderStatus, ...]:
        """Return the drive orders; the current one is OPERATING also if it was in an earlier try."""
        # A new try begins with TRAVELLING, so only the history tells of an operation that has begun.
        marks = (
            EventCode.OPERATION_STARTED,
            EventCode.DRIVE_ORDER_FINISHED,
            EventCode.SKIPPED,
            EventCode.ASSIGNED_TO_VEHICLE,
        )
        codes = (entry.event_code for entry in reversed(self.status.history))
        if next((code for code in codes if code in marks), None) != EventCode.OPERATION_STARTED:
            return self.status.drive_orders
        return self.with_current(self.current.model_copy(update={"state": DriveOrderState.OPERATING}))

    def _with_measures(
        self, code: EventCode, taken: int, why: Reason, *, now: datetime, next_try: datetime | None
    ) -> Self:
        current = self.current.model_copy(update={"measures_taken": taken})
        return self.changed(
            drive_orders=self.with_current(current),
            next_try=next_try,
            history=(*self.status.history, self.entry(now, code, why)),
        )

    def with_current(self, drive_order: DriveOrderStatus) -> tuple[DriveOrderStatus, ...]:
        """Return the drive orders with the current one replaced."""
        drive_orders = self.status.drive_orders
        return (*drive_orders[: self.index], drive_order, *drive_orders[self.index + 1 :])

    def _with_drive_order(self, index: int, state: DriveOrderState) -> tuple[DriveOrderStatus, ...]:
        drive_orders = self.status.drive_orders
        changed = drive_orders[index].model_copy(update={"state": state})
        return (*drive_orders[:index], changed, *drive_orders[index + 1 :])

    def _end_in(self, state: TransportOrderState, reason: Reason, now: datetime, **changes: object) -> Self:
        entry = self.entry(now, EventCode.FINAL_STATE_REACHED, state, reason)
        deadline = self.status.deadline
        late = self.status.late or (deadline is not None and deadline < now)
        return self._move_to(
            state,
            reason,
            entry,
            finished=now,
            late=late,
            held=None,
            next_try=None,
            **{"outcome": self._outcome_in(state, reason), **changes},
        )

    def _outcome_in(self, state: TransportOrderState, reason: Reason) -> OrderOutcome:
        """Return the outcome of an order that ends in a final state."""
        if state is not S.FAILED or not is_withdrawn(self.status):
            return OrderOutcome(state)
        outcome = OWN_WITHDRAWALS.get(why_withdrawn(self.status).code, OrderOutcome.WITHDRAWN)
        if outcome is OrderOutcome.GAVE_WAY and any(each.code not in HARMLESS for each in reason.causes):
            return OrderOutcome.FAILED
        return outcome

    def _move_to(
        self,
        state: TransportOrderState,
        reason: Reason | None,
        entry: HistoryEntry | None = None,
        **changes: object,
    ) -> Self:
        """Change the state; ``reason`` None: the vehicle's activity explains it."""
        if state not in SUCCESSORS[self.state]:
            raise IllegalTransitionError(self.name, self.state, f"the change to {state}")
        if reason is not None:
            changes |= explained(reason)
        history = (*self.status.history, entry) if entry else self.status.history
        return self.changed(state=state, history=history, **changes)

    def changed(self, **changes: object) -> Self:
        """Return the next version, with changed fields of the status."""
        status = self.status.model_copy(update={**changes, "version": self.status.version + 1})
        if "reason" not in changes and status.state in (S.BEING_PROCESSED, S.WITHDRAWN):
            status = status.model_copy(update=explained(_activity_of(status)))
        return type(self)(self.number, status, self.idempotency_key)

    def require(self, change: str, *states: TransportOrderState) -> None:
        """Raise IllegalTransitionError unless the order is in one of these states."""
        if self.state not in states:
            raise IllegalTransitionError(self.name, self.state, change)

    @staticmethod
    def entry(now: datetime, code: EventCode, *supplements: Reason | str) -> HistoryEntry:
        """Return a history entry; a reason among the supplements is the last one."""
        last = supplements[-1] if supplements else ""
        return HistoryEntry(
            timestamp=now,
            event_code=code,
            supplements=tuple(map(str, supplements)),
            coded_reason=last.coded if isinstance(last, Reason) else None,
        )


def is_withdrawn(status: TransportOrderStatus) -> bool:
    """Return whether a withdrawal of an order was requested."""
    return any(entry.event_code == EventCode.WITHDRAWAL_REQUESTED for entry in status.history)


def why_withdrawn(status: TransportOrderStatus) -> Reason:
    """Return why an order was withdrawn."""
    codes = [entry.event_code for entry in status.history]
    entry = status.history[codes.index(EventCode.WITHDRAWAL_REQUESTED)]
    return Reason.of(entry.supplements[0], entry.coded_reason)


def why_held(hold: Hold) -> Reason:
    """Return who holds an order, since when and why."""
    return Reason(R.HELD, Reason.of(hold.reason, hold.coded_reason), by=hold.by, since=hold.since)


def _activity_of(status: TransportOrderStatus) -> Reason:
    """Return what a vehicle is doing for its order."""
    vehicle, number = status.processing_vehicle or "", status.current_drive_order_index + 1
    if status.state is S.WITHDRAWN:
        return Reason(R.RELEASE_PENDING, why_withdrawn(status), vehicle=vehicle)
    if status.held:
        return why_held(status.held)
    current, total = status.drive_orders[number - 1], len(status.drive_orders)
    if current.state is DriveOrderState.OPERATING:
        operation = current.destination.operation
        return Reason(R.OPERATES, vehicle=vehicle, operation=operation, number=number)
    if current.state is DriveOrderState.FINISHED:
        return Reason(R.DESTINATION_DONE, vehicle=vehicle, number=number, total=total)
    return Reason(R.TRAVELS, vehicle=vehicle, number=number, total=total)
