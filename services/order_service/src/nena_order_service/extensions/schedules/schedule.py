"""Schedules: when a transport order is created again, and which runs are due; without a clock.

Cron expressions have five fields. Hours are those of the schedule's time zone. If the clocks are set back or
forward, two kinds of expressions differ, as in Debian's cron:

- At fixed hours (``30 2 * * *``), a run in the hour that occurs twice happens once, at its first occurrence.
  Runs in the hour that does not exist happen once, at the next valid time.
- At each hour (an hour field that starts with ``*``), runs follow the time that really passes: in both of
  the hours that have the same name, and not in the hour that does not exist.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from difflib import get_close_matches
from itertools import islice
from typing import Final
from zoneinfo import ZoneInfo, available_timezones

from cronsim import CronSim, CronSimError
from pydantic import BaseModel, ConfigDict

from nena_order_service.errors import RefusedError
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.schedules import (
    ScheduleDefinition,
    ScheduleRequest,
    ScheduleRun,
    ScheduleStatus,
)

ON_TIME: Final = timedelta(seconds=60)
"""A run that is late by at most this much is no missed run: a restart or a takeover takes less."""

LOOK_BACK: Final = timedelta(days=7)
"""Runs that were missed longer ago are neither caught up nor counted."""

SECOND: Final = timedelta(seconds=1)

NEXT_SHOWN: Final = 5
RUNS_SHOWN: Final = 10

NAME: Final = re.compile(r"[A-Za-z0-9_:\-][A-Za-z0-9_.:\-]{0,79}")
"""Names of schedules: with a time appended, they are names of transport orders."""
NAME_RULE: Final = "use 1 to 80 letters, digits, '_', '-', ':' or '.', and no '.' at the beginning"

FIELDS: Final[Mapping[str, str]] = {
    "minute": "0-59",
    "hour": "0-23",
    "day-of-month": "1-31, L (last day) or LW (last weekday)",
    "month": "1-12 or JAN-DEC",
    "day-of-week": "0-7 or SUN-SAT (0 and 7 are Sunday), 5L (last Friday) or 5#2 (second Friday)",
}
"""Fields of a cron expression and what they can be."""

FORM: Final = (
    "Use five fields: minute, hour, day of month, month, day of week. "
    "Example: '30 6 * * MON-FRI' is 6:30 from Monday to Friday."
)


@dataclass(frozen=True, slots=True)
class DueRuns:
    """What is due now."""

    runs: tuple[datetime, ...]
    """Planned times of the orders to create, the oldest first."""
    skipped: int
    """Number of planned times that are skipped: they were missed in an outage."""
    last_skipped: datetime | None
    """The last of them."""


class Schedule(BaseModel):
    """A schedule as stored: its definition and its progress."""

    model_config = ConfigDict(frozen=True)

    name: str
    definition: ScheduleRequest
    last: datetime
    """All planned times up to this one are done. Never goes back while the schedule stays the same."""
    last_runs: tuple[ScheduleRun, ...] = ()
    open_orders: tuple[str, ...] = ()
    """Names of its orders that had not ended when the last one was created."""
    created_orders: int = 0
    skipped_runs: int = 0

    def order_name(self, planned: datetime) -> str:
        """Return the name of the order of a planned time: the same each time, so that it is created once."""
        return f"{self.name}-{planned.astimezone(UTC):%Y%m%dT%H%M%SZ}"

    def with_definition(self, definition: ScheduleRequest, now: datetime) -> Schedule:
        """Return the schedule with another definition; it applies to planned times after ``now``."""
        # 0057: what was due by now, the previous definition has created.
        return self.model_copy(update={"definition": definition, "last": now})

    def with_run(self, run: ScheduleRun, skipped: int = 0) -> Schedule:
        """Return the schedule after a run, or after ``skipped`` ones up to this one."""
        return self.model_copy(
            update={
                "last": run.planned,
                "last_runs": (run, *self.last_runs)[:RUNS_SHOWN],
                "created_orders": self.created_orders + (run.transport_order is not None),
                "skipped_runs": self.skipped_runs + skipped,
            }
        )

    def next_runs(self) -> tuple[datetime, ...]:
        """Return the next planned times, up to five. Takes some ms if they are years apart."""
        return tuple(islice(planned_times(self.definition, self.last), NEXT_SHOWN))

    def to_status(self, next_runs: tuple[datetime, ...]) -> ScheduleStatus:
        """Return the schedule as hosts see it."""
        return ScheduleStatus(
            name=self.name,
            **{name: getattr(self.definition, name) for name in ScheduleDefinition.model_fields},
            next_runs=next_runs,
            last_runs=self.last_runs,
            created_orders=self.created_orders,
            skipped_runs=self.skipped_runs,
        )


def planned_times(definition: ScheduleRequest, last: datetime) -> Iterator[datetime]:
    """Yield the planned times after ``last``, in UTC, within the validity; none if disabled or a template."""
    if not definition.enabled or definition.cron is None:
        return
    start = max(filter(None, (last, definition.valid_from)))
    zone = ZoneInfo(definition.time_zone)
    # cronsim takes an expression for one of fixed hours only if its minutes do not start with * either, so
    # these are spelled out.
    fields = definition.cron.split()
    if fields[0].startswith("*") and not fields[1].startswith("*"):
        fields[0] = f"0-59{fields[0][1:]}"
    try:
        # One second earlier: a run at the start itself counts.
        for sim in CronSim(" ".join(fields), (start - SECOND).astimezone(zone)):
            planned = sim.astimezone(UTC)
            if definition.valid_until and planned >= definition.valid_until:
                return
            if planned > last and planned >= start:  # not so in an hour that occurs for the second time
                yield planned
    except OverflowError:  # after the year 9999
        return


def find_due_runs(definition: ScheduleRequest, last: datetime, now: datetime) -> DueRuns:
    """Return which planned times after ``last`` are due at ``now``: to create orders for, or to skip.

    If the clock was set back, ``now`` may be before ``last``: nothing is due until it has passed ``last``.
    """
    on_time: list[datetime] = []
    missed: deque[datetime] = deque(maxlen=definition.catch_up)
    skipped, last_skipped = 0, None
    # 0057: after a long outage, a schedule for each minute would have thousands.
    for planned in planned_times(definition, max(last, now - LOOK_BACK)):
        if planned > now:
            break
        if now - planned <= ON_TIME:
            on_time.append(planned)
            continue
        if len(missed) == definition.catch_up:
            skipped += 1
            last_skipped = missed[0] if missed else planned
        missed.append(planned)
    return DueRuns((*missed, *on_time), skipped, last_skipped)


def check_schedule(name: str, definition: ScheduleRequest, now: datetime) -> None:
    """Raise RefusedError with all problems of a schedule, apart from those of its order."""
    problems = []
    if not NAME.fullmatch(name):
        problems.append(f"Invalid name {name[:100]!r}: {NAME_RULE}.")
    problems += filter(None, (_problem_of_zone(definition.time_zone), _problem_of_cron(definition.cron)))
    if not problems and definition.cron is not None:
        # A disabled one has no planned times, whatever its cron expression.
        enabled = definition.model_copy(update={"enabled": True})
        if next(planned_times(enabled, now), None) is None:
            problems.append(
                f"{definition.cron!r} has no run in the future. Change cron, validFrom or validUntil."
            )
    if problems:
        text = "The schedule is invalid; nothing was saved. Fix what errors lists."
        raise RefusedError(Refusal.INVALID_SCHEDULE, text, problems)


def _problem_of_cron(cron: str | None) -> str:
    if cron is None:
        return ""
    fields = cron.split()
    if len(fields) != len(FIELDS):
        return f"Invalid cron expression {cron!r}: it has {len(fields)} fields. {FORM}"
    for (name, possible), text in zip(FIELDS.items(), fields, strict=True):
        alone = [text if field == name else "*" for field in FIELDS]
        if not _is_readable(" ".join(alone)):
            return f"Invalid {name} {text!r} in {cron!r}. Use {possible}, *, lists, ranges and steps."
    if not _is_readable(cron):
        return f"{cron!r} has no run: none of its months has such a day."
    return ""


def _is_readable(cron: str) -> bool:
    try:
        CronSim(cron, datetime(2000, 1, 1, tzinfo=UTC))
    except (CronSimError, AssertionError):  # it asserts that 5L/2 has no step
        return False
    return True


def _problem_of_zone(name: str) -> str:
    try:
        ZoneInfo(name)
    except (KeyError, ValueError, OSError):  # OSError: a folder of zones, such as Europe
        zones = sorted(available_timezones())
        alike = get_close_matches(name, zones, n=3) or [zone for zone in zones if zone.endswith(f"/{name}")]
        hint = f" Did you mean {' or '.join(map(repr, alike))}?" if alike else " Example: 'Europe/Berlin'."
        return f"Unknown time zone {name!r}.{hint}"
    return ""
