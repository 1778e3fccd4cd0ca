"""Schedules: operations of hosts; :class:`Schedules` executes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from nena_order_service.api import orders
from nena_order_service.api.operations import Handler
from nena_order_service.engine.schedules import Schedules
from nena_shared.fleet_api.operations import schedules as table
from nena_shared.fleet_api.schedules import ScheduleList

EXAMPLE: Final = {
    "transportOrder": {"destinations": orders.EXAMPLE["destinations"], "timeout": 3600},
    "cron": "30 6 * * MON-FRI",
    "timeZone": "Europe/Berlin",
    "catchUp": 1,
}


def schedule_handlers(schedules: Schedules) -> Iterator[Handler]:
    """Yield what executes each operation."""
    yield Handler(table.LIST_SCHEDULES, lambda: ScheduleList(schedules=schedules.all()))
    yield Handler(table.SHOW_SCHEDULE, schedules.get)
    yield Handler(table.PUT_SCHEDULE, lambda name, request: schedules.put(name, definition=request), EXAMPLE)
    yield Handler(
        table.ENABLE_SCHEDULE,
        lambda name, request: schedules.enable(name, enabled=request.enabled),
        {"enabled": False},
    )
    yield Handler(table.DELETE_SCHEDULE, schedules.delete)
