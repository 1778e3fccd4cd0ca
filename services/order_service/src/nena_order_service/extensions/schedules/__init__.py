"""Schedules: recurring transport orders."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from typing import ClassVar, Final

from nena_order_service.api.operations import Handler
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.schedules.schedules import Schedules
from nena_shared.fleet_api.operations import schedules as table
from nena_shared.fleet_api.schedules import ScheduleList
from nena_shared.metrics import Section, counter

EXAMPLE: Final = {
    "transportOrder": {
        "destinations": [
            {"locationName": "Goods in", "operation": "Load cargo"},
            {"locationName": "Storage", "operation": "Unload cargo"},
        ],
        "timeout": 3600,
    },
    "cron": "30 6 * * MON-FRI",
    "timeZone": "Europe/Berlin",
    "catchUp": 1,
}


class ScheduledOrders(Extension):
    """Creates the orders of schedules, and serves ``/v1/schedules``."""

    def __init__(self, settings: object, core: Core) -> None:
        super().__init__(settings, core)
        self.schedules = Schedules(core.engine)

    async def begin(self, previous: ScheduledOrders | None) -> None:  # noqa: ARG002 - all is in the store
        """Restore the schedules."""
        await self.schedules.load()

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        schedules, state = self.schedules, self.schedules.state
        yield Handler(table.LIST_SCHEDULES, lambda: ScheduleList(schedules=schedules.all()))
        yield Handler(table.SHOW_SCHEDULE, schedules.get)
        yield Handler(
            table.PUT_SCHEDULE,
            lambda name, request: schedules.put(name, definition=request),
            EXAMPLE,
            state=state,
        )
        yield Handler(
            table.ENABLE_SCHEDULE,
            lambda name, request: schedules.enable(name, enabled=request.enabled),
            {"enabled": False},
            state=state,
        )
        yield Handler(table.DELETE_SCHEDULE, schedules.delete, state=state)

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return what creates the orders that are due."""
        return {"schedules": self.schedules.run_when_due}

    section: ClassVar[Section[ScheduledOrders] | None] = Section(
        "Schedules",
        (
            counter(
                "nena_order_service_schedule_runs_total",
                "Runs of schedules: `created` an order, or `skipped` (missed in an outage, or refused).",
                lambda s: s.schedules.outcomes,
                "outcome",
            ),
        ),
    )
