"""Schedules: store them, and create their orders when they are due.

An order and the progress of its schedule are one change of the store, and the order's name is that of the
schedule and the planned time. So a kill, a restart or a takeover at any moment neither loses nor doubles it:
the next engine continues after the last planned time in the store.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from contextvars import Context
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any, Final

from cronsim import CronSimError
from pydantic import ValidationError

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import RefusedError, StoreNotReadyError, UnknownError
from nena_order_service.extensions.schedules.schedule import (
    LOOK_BACK,
    ON_TIME,
    Schedule,
    check_schedule,
    find_due_runs,
)
from nena_order_service.orders.validation import InvalidRequestError, check_request, set_operations
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained, reason_of
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.schedules import ScheduleRequest, ScheduleRun, ScheduleStatus
from nena_shared.fleet_api.transport_order import OrderTemplate, TransportOrderRequest
from nena_shared.log import get_logger
from nena_shared.tasks import set_within

R = ReasonCode

log = get_logger(__name__)

SCHEDULE: Final = "schedule"
"""The kind of schedules' documents in the store."""

SCHEDULES_LIMIT: Final = 500
"""Maximum number of schedules."""

LOOK_INTERVAL: Final = 1.0
"""Seconds between looks at the clock, which may have been set."""

CREATED: Final = "created"
SKIPPED: Final = "skipped"
LONG_AGO: Final = Reason(R.RUNS_LONG_AGO, days=LOOK_BACK.days)
LATE: Final = Reason(R.RUN_LATE)


@dataclass(frozen=True, slots=True)
class _Planned:
    """A schedule and its next runs."""

    schedule: Schedule
    next_runs: tuple[datetime, ...]

    @classmethod
    def of(cls, schedule: Schedule) -> _Planned:
        return cls(schedule, schedule.next_runs())

    def due_in(self, time: datetime) -> float | None:
        """Return the time until the next run, seconds; None if there is none."""
        return (self.next_runs[0] - time).total_seconds() if self.next_runs else None

    @property
    def status(self) -> ScheduleStatus:
        return self.schedule.to_status(self.next_runs)


class Schedules:
    """Changes schedules for hosts, and creates the orders that are due."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._known: dict[str, _Planned] = {}
        self._visible: dict[str, _Planned] = {}
        """The schedules that are in the store, by name."""
        self.outcomes = Counter({CREATED: 0, SKIPPED: 0})
        """Number of runs since the start, for the metrics."""
        self._changed = asyncio.Event()
        self._one_by_one = asyncio.Lock()
        """Held from the check of a schedule to its change."""

    async def load(self) -> None:
        """Restore the schedules from before a restart; unreadable ones are logged and left out."""
        for name, document in (await self._engine.store.documents(SCHEDULE)).items():
            try:
                self._known[name] = _Planned.of(Schedule.model_validate_json(document))
            except (ValidationError, CronSimError, KeyError, ValueError, OSError):  # or an unknown time zone
                log.exception("stored schedule is unreadable", schedule=name)
        self._visible = dict(self._known)

    def all(self) -> tuple[ScheduleStatus, ...]:
        """Return all schedules, by name."""
        return tuple(self._visible[name].status for name in sorted(self._visible))

    def get(self, name: str) -> ScheduleStatus:
        """Return a schedule; raises UnknownError."""
        return _schedule_named(name, self._visible).status

    async def put(self, name: str, definition: ScheduleRequest) -> tuple[ScheduleStatus, bool]:
        """Create a schedule, or replace its definition; return it, and whether it is new.

        It applies to planned times from now on. Storing the same definition again changes nothing.

        Raises:
            RefusedError: it can never run, or its name, cron expression or time zone is invalid.
            InvalidRequestError: its order does not fit the plant model.
            RefusedError: no more schedules can be stored.
            StoreNotReadyError: the change may be lost.
        """
        async with self._one_by_one:
            time = self._engine.clock.now()
            check_schedule(name, definition, time)
            definition = self._set_operations(definition)
            stored = self._known.get(name)
            if stored is None and len(self._known) >= SCHEDULES_LIMIT:
                text = f"There are {SCHEDULES_LIMIT} schedules already. Delete one of them first."
                raise RefusedError(Refusal.TOO_MANY_SCHEDULES, text)
            if stored is None or stored.schedule.definition != definition:
                await self._change_definition(name, definition, time)
            status = self._known[name].status
        # Without the lock: while the database is slow, schedules can still be checked and changed.
        await self._engine.unit_of_work.wait_committed()
        return status, stored is None

    async def enable(self, name: str, *, enabled: bool) -> ScheduleStatus:
        """Enable or disable a schedule. What it misses while disabled is not caught up.

        Raises:
            UnknownError: no such schedule.
            StoreNotReadyError: the change may be lost.
        """
        async with self._one_by_one:
            definition = _schedule_named(name, self._known).schedule.definition
            if definition.enabled != enabled:
                changed = definition.model_copy(update={"enabled": enabled})
                await self._change_definition(name, changed, self._engine.clock.now())
            status = self._known[name].status
        await self._engine.unit_of_work.wait_committed()
        return status

    async def delete(self, name: str) -> ScheduleStatus:
        """Delete a schedule, and return it as it was; its orders stay.

        Raises:
            UnknownError: no such schedule.
            StoreNotReadyError: the change may be lost.
        """
        async with self._one_by_one:
            deleted = _schedule_named(name, self._known)
            self._engine.unit_of_work.require_store()
            with self._engine.unit_of_work.begin():
                self._put_schedule(name, None)
            log.info("schedule deleted", schedule=name)
        await self._engine.unit_of_work.wait_committed()
        return deleted.status

    def state(self, name: str, changes: Changes) -> dict[str, Any] | None:
        """Return a schedule in a few words, with ``changes`` that are not committed yet; None: unknown."""
        if (SCHEDULE, name) in changes.documents and name not in self._known:
            return {"deleted": True}
        if name not in self._known:
            return None
        definition = self._known[name].schedule.definition
        return {"cron": definition.cron, "timeZone": definition.time_zone, "enabled": definition.enabled}

    async def run_when_due(self) -> None:
        """Wait until orders are due, and create them."""
        time = self._engine.clock.now()
        waits = [wait for plan in self._known.values() if (wait := plan.due_in(time)) is not None]
        if not waits:
            await self._changed.wait()
        elif min(waits) > 0:
            await set_within(self._changed, min(*waits, LOOK_INTERVAL))
        self._changed.clear()
        await self.run_due()

    async def run_due(self) -> None:
        """Create the orders that are due now; retry later what fails, without holding up other schedules."""
        failed = False
        for name in list(self._known):
            try:
                async with self._one_by_one:
                    if name in self._known:  # not deleted meanwhile
                        await self._create_due_orders(name, self._engine.clock.now())
            except StoreNotReadyError as error:  # of all schedules, so the others need not be tried
                log.warning("schedule waits for the store", schedule=name, reason=str(error))
                failed = True
                break
            except Exception:
                log.exception("schedule failed; retrying", schedule=name)
                failed = True
        if failed:
            await asyncio.sleep(LOOK_INTERVAL)

    async def _change_definition(self, name: str, definition: ScheduleRequest, time: datetime) -> None:
        """Use another definition from now on; what is due until now follows the previous one."""
        self._engine.unit_of_work.require_store()
        if name in self._known:
            # Outside the request, which the audit trail would record with the first change made in it.
            await asyncio.create_task(self._create_due_orders(name, time), context=Context())
            schedule = self._known[name].schedule.with_definition(definition, time)
        else:
            schedule = Schedule(name=name, definition=definition, last=time)
        with self._engine.unit_of_work.begin():
            self._put_schedule(name, schedule)
        log.info("schedule changed", schedule=name, cron=definition.cron, enabled=definition.enabled)

    async def _create_due_orders(self, name: str, time: datetime) -> None:
        """Create the orders of a schedule that are due; raises StoreNotReadyError."""
        planned = self._known[name]
        wait = planned.due_in(time)
        if wait is None or wait > 0:
            return
        schedule = planned.schedule
        find = partial(find_due_runs, schedule.definition, schedule.last, time)
        # A week of missed minutes takes half a second, for which the loop must not stand still.
        due_runs = await asyncio.to_thread(find) if wait < -ON_TIME.total_seconds() else find()
        if due_runs.last_skipped:
            reason = Reason(R.RUNS_SKIPPED, count=due_runs.skipped)
            skipped = ScheduleRun(planned=due_runs.last_skipped, **explained(reason))
            self._record_run(schedule.with_run(skipped, due_runs.skipped), due_runs.skipped)
        elif not due_runs.runs:
            long_ago = ScheduleRun(planned=planned.next_runs[0], **explained(LONG_AGO))
            # Next runs are counted from the last one, so it is set to where looking back ends.
            self._record_run(schedule.with_run(long_ago).model_copy(update={"last": time - LOOK_BACK}))
        open_orders = tuple(filter(self._is_open_order, schedule.open_orders))
        room = max(0, schedule.definition.max_open_orders - len(open_orders))
        # If only some may be open, the latest runs are still worth an order, the oldest are not.
        first = max(0, len(due_runs.runs) - room)
        for run in due_runs.runs[:first]:
            skipped = ScheduleRun(planned=run, **explained(Reason(R.ORDERS_OPEN, count=len(open_orders))))
            self._record_run(self._known[name].schedule.with_run(skipped, 1))
        for run in due_runs.runs[first:]:
            late = LATE if time - run > ON_TIME else None
            await self._create_order(self._known[name].schedule, run, late)

    async def _create_order(self, schedule: Schedule, planned: datetime, late: Reason | None) -> None:
        """Create the order of a planned time, or record why it is not created."""
        name = schedule.order_name(planned)
        if await self._engine.store.read_order(name=name) or self._engine.state.orders.named(name):
            refused = Reason(R.ORDER_EXISTS, order=name)
        else:
            try:
                request = self._prepare_request(schedule.definition.transport_order)
            except InvalidRequestError as error:
                refused = reason_of(error)
            else:
                self._engine.unit_of_work.require_store()
                done = schedule.with_run(
                    ScheduleRun(planned=planned, transport_order=name, **explained(late))
                )
                open_orders = (*filter(self._is_open_order, schedule.open_orders), name)
                done = done.model_copy(update={"open_orders": open_orders})
                with self._engine.change():  # together, so that no restart creates it again
                    self._engine.life_cycle.create_order(request, name, by=f"schedule {schedule.name}")
                    self._put_schedule(schedule.name, done)
                self.outcomes[CREATED] += 1
                log.info("order created by schedule", schedule=schedule.name, order=name, late=bool(late))
                return
        self._record_run(schedule.with_run(ScheduleRun(planned=planned, **explained(refused)), 1))

    def _is_open_order(self, name: str) -> bool:
        """Return whether an order of this name has not ended; open ones are in memory."""
        order = self._engine.state.orders.named(name)
        return order is not None and not order.state.final

    def _set_operations(self, definition: ScheduleRequest) -> ScheduleRequest:
        """Return a definition with the operations of its order; raises InvalidRequestError."""
        template = definition.transport_order
        destinations = self._prepare_request(template).destinations
        fields = {name: getattr(definition, name) for name in ScheduleRequest.model_fields}  # none of MQTT
        fields["transport_order"] = template.model_copy(update={"destinations": destinations})
        return ScheduleRequest.model_validate(fields)

    def _prepare_request(self, template: OrderTemplate) -> TransportOrderRequest:
        """Return the request of an order with its operations; raises InvalidRequestError."""
        fields = {name: getattr(template, name) for name in template.model_fields_set}
        request = set_operations(TransportOrderRequest.model_validate(fields), self._engine.plant)
        check_request(request, self._engine.plant, self._engine.registry.names())
        return request

    def _record_run(self, schedule: Schedule, skipped: int = 1) -> None:
        """Store a schedule after ``skipped`` runs that have created no order."""
        run = schedule.last_runs[0]
        log.warning("schedule has created no order", schedule=schedule.name, reason=run.reason)
        self._engine.unit_of_work.require_store()
        with self._engine.unit_of_work.begin():
            self._put_schedule(schedule.name, schedule)
        self.outcomes[SKIPPED] += skipped

    def _put_schedule(self, name: str, schedule: Schedule | None) -> None:
        """Change a schedule in the current unit of work; None: delete it."""
        documents = self._engine.state.pending.stored.documents
        if schedule is None:
            del self._known[name]
            documents[SCHEDULE, name] = None
        else:
            self._known[name] = _Planned.of(schedule)
            documents[SCHEDULE, name] = schedule.model_dump_json(by_alias=True, exclude_unset=True)
        committed = dict(self._known)

        def show_committed() -> None:
            self._visible = committed  # hosts only see what a restart restores

        self._engine.state.after_commit(show_committed)
        self._changed.set()


def _schedule_named(name: str, schedules: dict[str, _Planned]) -> _Planned:
    """Return a schedule; raises UnknownError."""
    if name not in schedules:
        raise UnknownError(Refusal.UNKNOWN_SCHEDULE, name)
    return schedules[name]
