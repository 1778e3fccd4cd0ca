"""Schedules in the API: recurring transport orders."""

from __future__ import annotations

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from nena_shared.fleet_api.base import CamelCase, Moment, Request, Resource
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.fleet_api.transport_order import OrderTemplate

CATCH_UP_LIMIT: Final = 100
"""Maximum number of missed runs that a schedule catches up."""

OPEN_ORDERS: Final = 100
"""Default of ``maxOpenOrders``."""

OPEN_ORDERS_LIMIT: Final = 1000
"""Maximum of ``maxOpenOrders``."""


class ScheduleDefinition(CamelCase):
    """Which transport order a schedule creates, and when."""

    # 0057: no dependencies and no sequence, so that a run needs no query of other orders
    transport_order: OrderTemplate
    """The body of ``POST /v1/transportOrders``, without the fields of a single order, such as its name."""
    cron: Annotated[str, Field(min_length=1, max_length=200)] | None
    """Cron expression: minute, hour, day of month, month and day of week. None: an order template."""
    time_zone: Annotated[str, Field(min_length=1, max_length=100)] = "UTC"
    """IANA time zone of the cron expression, such as ``Europe/Berlin``."""
    valid_from: Moment | None = None
    """The first run is at or after this time; None: no limit."""
    valid_until: Moment | None = None
    """The last run is before this time; None: no limit."""
    catch_up: Annotated[int, Field(ge=0, le=CATCH_UP_LIMIT)] = 0
    """Number of runs to catch up after an outage of the order service, the latest ones; 0: skip them all."""
    max_open_orders: Annotated[int, Field(ge=1, le=OPEN_ORDERS_LIMIT)] = OPEN_ORDERS
    """A run is skipped while this many orders of the schedule are open, so that they do not pile up."""
    enabled: bool = True


class ScheduleRequest(ScheduleDefinition, Request):
    """Request to create a schedule, or to replace its definition."""

    @model_validator(mode="after")
    def _has_validity(self) -> Self:
        if self.valid_from and self.valid_until and self.valid_from >= self.valid_until:
            raise ValueError("validFrom must be before validUntil")
        return self


class ScheduleSwitch(Request):
    """Request to enable or disable a schedule."""

    enabled: bool


class ScheduleRun(Resource):
    """A planned time of a schedule that has passed, and what came of it."""

    planned: Moment
    transport_order: str | None = None
    """Name of the created transport order; None: none was created."""
    reason: str = ""
    """Why no order was created, or why it was created late, as text."""
    coded_reason: OptionalReason = None


class ScheduleStatus(ScheduleDefinition, Resource):
    """A schedule, its next runs and its last ones."""

    name: str
    next_runs: tuple[Moment, ...] = ()
    """The next runs, up to five; empty: disabled, or its validity has ended."""
    last_runs: tuple[ScheduleRun, ...] = ()
    """The last runs, up to ten, newest first."""
    created_orders: int = 0
    """Number of transport orders that it has created."""
    skipped_runs: int = 0
    """Number of runs without an order: missed in an outage, refused, or too many orders open."""


class ScheduleList(Resource):
    """All schedules, by name."""

    schedules: tuple[ScheduleStatus, ...]
