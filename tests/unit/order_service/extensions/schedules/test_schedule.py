"""When schedules are due: changes of the clocks, outages, validity, and invalid expressions."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from itertools import islice, takewhile
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nena_order_service.errors import RefusedError
from nena_order_service.extensions.schedules.schedule import (
    LOOK_BACK,
    ON_TIME,
    DueRuns,
    Schedule,
    check_schedule,
    find_due_runs,
    planned_times,
)
from nena_shared.fleet_api.schedules import ScheduleRequest, ScheduleRun
from support.schedules import definition

NOW = datetime(2026, 3, 1, tzinfo=UTC)
MINUTE, HOUR, DAY = timedelta(minutes=1), timedelta(hours=1), timedelta(days=1)
ZONES = ("Europe/Berlin", "America/New_York", "Australia/Lord_Howe", "UTC")


def local_times(cron: str, zone: str, start: str, count: int) -> list[str]:
    """Return the next planned times after a local time, with their offsets."""
    after = datetime.fromisoformat(start).replace(tzinfo=ZoneInfo(zone)).astimezone(UTC)
    times = islice(planned_times(definition(cron, zone), after), count)
    return [each.astimezone(ZoneInfo(zone)).strftime("%m-%d %H:%M%z") for each in times]


@pytest.mark.parametrize(
    ("cron", "zone", "start", "expected"),
    [
        # Clocks are set forward at 2:00: the hour from 2 to 3 does not exist.
        ("30 2 * * *", "Europe/Berlin", "2026-03-28T12:00", ["03-29 03:00+0200", "03-30 02:30+0200"]),
        ("30 2 * * *", "America/New_York", "2026-03-07T12:00", ["03-08 03:00-0400", "03-09 02:30-0400"]),
        ("*/20 2 * * *", "Europe/Berlin", "2026-03-28T12:00", ["03-29 03:00+0200", "03-30 02:00+0200"]),
        ("0 3 * * *", "Europe/Berlin", "2026-03-28T12:00", ["03-29 03:00+0200", "03-30 03:00+0200"]),
        ("30 * * * *", "Europe/Berlin", "2026-03-29T01:00", ["03-29 01:30+0100", "03-29 03:30+0200"]),
        # Clocks are set back: at 3:00 (Berlin) and 2:00 (New York) an hour occurs again.
        ("30 2 * * *", "Europe/Berlin", "2026-10-24T12:00", ["10-25 02:30+0200", "10-26 02:30+0100"]),
        ("30 1 * * *", "America/New_York", "2026-10-31T12:00", ["11-01 01:30-0400", "11-02 01:30-0500"]),
        ("*/30 2 * * *", "Europe/Berlin", "2026-10-25T02:00", ["10-25 02:30+0200", "10-26 02:00+0100"]),
        ("30 * * * *", "Europe/Berlin", "2026-10-25T02:00", ["10-25 02:30+0200", "10-25 02:30+0100"]),
        ("0 */2 * * *", "Europe/Berlin", "2026-10-25T01:00", ["10-25 02:00+0200", "10-25 02:00+0100"]),
        # 29 February
        ("0 6 29 2 *", "Europe/Berlin", "2026-01-01T00:00", ["02-29 06:00+0100", "02-29 06:00+0100"]),
        ("0 6 L 2 *", "Europe/Berlin", "2027-01-01T00:00", ["02-28 06:00+0100", "02-29 06:00+0100"]),
    ],
)
def test_planned_times(cron: str, zone: str, start: str, expected: list[str]) -> None:
    assert local_times(cron, zone, start, len(expected)) == expected


def test_years_of_29_february() -> None:
    times = list(islice(planned_times(definition("0 6 29 2 *"), NOW), 2))
    assert [each.year for each in times] == [2028, 2032]


@pytest.mark.parametrize("zone", ZONES)
@given(data=st.data())
def test_each_start_finds_the_same_times(zone: str, data: st.DataObject) -> None:
    """A restart at any moment continues with exactly the times that are left."""
    minute = data.draw(st.sampled_from(["*", "*/7", "0", "30", "5,45", "0-20/10"]))
    hour = data.draw(st.sampled_from(["*", "*/2", "1-3", "2", "0,2,3", "0-23"]))
    around = data.draw(
        st.sampled_from([datetime(2026, month, day, tzinfo=UTC) for month, day in CHANGES_OF_CLOCKS])
    )
    first = around + timedelta(minutes=data.draw(st.integers(-24 * 60, 24 * 60)))
    made = definition(f"{minute} {hour} * * *", zone)
    all_times = list(islice(planned_times(made, first), 40))
    assert all_times == sorted(set(all_times))
    assert all_times[0] > first
    restart = first + timedelta(seconds=data.draw(st.integers(0, 36 * 3600)))
    left = [each for each in all_times if each > restart]
    assert list(islice(planned_times(made, restart), len(left))) == left


START = datetime(2026, 10, 24, 22, tzinfo=UTC)
"""Three hours before Berlin sets its clocks back."""
CHANGES_OF_CLOCKS = ((3, 8), (3, 29), (4, 5), (10, 4), (10, 25), (11, 1))


@given(
    cron=st.sampled_from(["* * * * *", "*/5 * * * *", "30 2 * * *", "0 0 1 * *"]),
    catch_up=st.integers(0, 5),
    looks=st.lists(st.integers(1, 500), min_size=1, max_size=4),
)
def test_each_planned_time_runs_or_is_skipped_once(cron: str, catch_up: int, looks: list[int]) -> None:
    made = definition(cron, "Europe/Berlin", catch_up=catch_up)
    now = last = START
    runs: list[datetime] = []
    skipped = 0
    for minutes in looks:
        now += timedelta(minutes=minutes)
        found = find_due_runs(made, last, now)
        assert len([each for each in found.runs if now - each > ON_TIME]) <= catch_up
        runs += found.runs
        skipped += found.skipped
        last = max([last, *found.runs, *filter(None, [found.last_skipped])])
        assert not find_due_runs(made, last, now).runs
    assert runs == sorted(set(runs))
    planned = [*takewhile(lambda each: each <= now, planned_times(made, START))]
    assert set(runs) <= set(planned)
    assert len(runs) + skipped == len(planned)


def test_run_on_time() -> None:
    hourly = definition("0 * * * *")
    assert find_due_runs(hourly, NOW, NOW + HOUR) == DueRuns((NOW + HOUR,), 0, None)
    assert find_due_runs(hourly, NOW, NOW + HOUR - timedelta(milliseconds=1)) == DueRuns((), 0, None)


def test_short_delay_is_no_outage() -> None:
    assert find_due_runs(definition("0 * * * *"), NOW, NOW + HOUR + ON_TIME).runs == (NOW + HOUR,)
    assert find_due_runs(definition("0 * * * *"), NOW, NOW + HOUR + 2 * ON_TIME) == DueRuns((), 1, NOW + HOUR)


def test_missed_runs_are_skipped_or_the_latest_are_caught_up() -> None:
    now = NOW + 5 * HOUR + 30 * MINUTE
    assert find_due_runs(definition("0 * * * *"), NOW, now) == DueRuns((), 5, NOW + 5 * HOUR)
    caught_up = find_due_runs(definition("0 * * * *", catch_up=2), NOW, now)
    assert caught_up == DueRuns((NOW + 4 * HOUR, NOW + 5 * HOUR), 3, NOW + 3 * HOUR)
    assert find_due_runs(definition("0 * * * *", catch_up=10), NOW, now).skipped == 0


def test_run_that_is_on_time_after_an_outage_is_no_missed_one() -> None:
    found = find_due_runs(definition("0 * * * *"), NOW, NOW + 3 * HOUR + timedelta(seconds=5))
    assert found == DueRuns((NOW + 3 * HOUR,), 2, NOW + 2 * HOUR)


def test_runs_that_were_missed_long_ago_are_not_counted() -> None:
    now = NOW + 30 * DAY + HOUR
    assert find_due_runs(definition("0 0 * * *", catch_up=100), NOW, now).runs[0] == NOW + 24 * DAY
    assert LOOK_BACK == 7 * DAY


def test_clock_that_is_set_back_runs_nothing_again() -> None:
    hourly = definition("0 * * * *", catch_up=100)
    last = NOW + 3 * HOUR
    assert find_due_runs(hourly, last, NOW + HOUR) == DueRuns((), 0, None)
    assert find_due_runs(hourly, last, NOW + 4 * HOUR).runs == (NOW + 4 * HOUR,)


def test_validity() -> None:
    made = definition("0 * * * *", valid_from=NOW + 2 * HOUR, valid_until=NOW + 4 * HOUR)
    assert list(planned_times(made, NOW)) == [NOW + 2 * HOUR, NOW + 3 * HOUR]
    assert list(planned_times(made, NOW + 2 * HOUR)) == [NOW + 3 * HOUR]
    assert list(planned_times(definition("0 * * * *", enabled=False), NOW)) == []


def test_end_of_the_calendar() -> None:
    assert list(planned_times(definition("0 0 1 1 *"), datetime(9999, 6, 1, tzinfo=UTC))) == []


def test_order_has_the_same_name_each_time() -> None:
    schedule = Schedule(name="milk-run", definition=definition("0 6 * * *"), last=NOW)
    berlin = datetime(2026, 3, 2, 6, 0, tzinfo=ZoneInfo("Europe/Berlin"))
    assert (
        schedule.order_name(berlin)
        == schedule.order_name(berlin.astimezone(UTC))
        == "milk-run-20260302T050000Z"
    )


def test_progress() -> None:
    schedule = Schedule(name="S", definition=definition("0 6 * * *"), last=NOW)
    for number in range(12):
        schedule = schedule.with_run(ScheduleRun(planned=NOW + number * DAY, transport_order=f"S-{number}"))
    schedule = schedule.with_run(ScheduleRun(planned=NOW + 20 * DAY, reason="skipped"), skipped=3)
    assert (schedule.created_orders, schedule.skipped_runs, schedule.last) == (12, 3, NOW + 20 * DAY)
    assert [each.transport_order for each in schedule.last_runs][:2] == [None, "S-11"]
    assert len(schedule.last_runs) == 10
    again = Schedule.model_validate_json(schedule.model_dump_json(by_alias=True, exclude_unset=True))
    assert again == schedule


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"cron": "0 25 * * *"}, "Invalid hour '25' in '0 25 * * *'. Use 0-23"),
        ({"cron": "60 6 * * *"}, "Invalid minute '60' in '60 6 * * *'. Use 0-59"),
        ({"cron": "0 6 * * MONDAY"}, "Use 0-7 or SUN-SAT"),
        ({"cron": "0 6 * 13 *"}, "Use 1-12 or JAN-DEC"),
        ({"cron": "0 6 * * 5L/2"}, "day-of-week '5L/2'"),
        ({"cron": "*/0 * * * *"}, "minute '*/0'"),
        ({"cron": "0 6 30 2 *"}, "none of its months has such a day"),
        ({"cron": "0 0 6 * * *"}, "it has 6 fields. Use five fields: minute, hour"),
        ({"cron": "@daily"}, "it has 1 fields. Use five"),
        ({"cron": "tomorrow"}, "Example: '30 6 * * MON-FRI'"),
        ({"zone": "Europe/Berln"}, "Unknown time zone 'Europe/Berln'. Did you mean 'Europe/Berlin'"),
        ({"zone": "Berlin"}, "Did you mean"),
        ({"zone": "Europe"}, "Unknown time zone 'Europe'"),
        ({"zone": "../../etc/passwd"}, "Unknown time zone"),
        ({"zone": "CEST"}, "Unknown time zone 'CEST'"),
        ({"cron": "0 6 * * *", "valid_until": NOW}, "'0 6 * * *' has no run in the future"),
        ({"cron": "0 6 5 * *", "valid_from": NOW, "valid_until": NOW + DAY}, "no run in the future"),
    ],
)
def test_invalid_schedule(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(RefusedError) as caught:
        check_schedule("S", definition(**fields), NOW)
    assert problem in "\n".join(caught.value.problems)


def test_all_problems_are_reported_at_once() -> None:
    with pytest.raises(RefusedError) as caught:
        check_schedule(".x/y", definition("0 25 * * *", "Mars"), NOW)
    assert len(caught.value.problems) == 3


def test_template_is_never_due() -> None:
    template = ScheduleRequest.model_validate({**definition().model_dump(), "cron": None})
    check_schedule("pallets", template, NOW)
    assert list(planned_times(template, NOW)) == []


def test_disabled_schedule_is_checked_too() -> None:
    check_schedule("S", definition("0 6 * * *", enabled=False), NOW)


@given(st.text(alphabet="0123456789*/,-L#W?MONJA ", max_size=40))
def test_any_text_is_a_cron_expression_or_refused(cron: str) -> None:
    assume(cron)
    try:
        check_schedule("S", definition(cron), NOW)
    except RefusedError:
        return
    assert next(planned_times(definition(cron), NOW)) > NOW


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", "T-1"),
        ("idempotencyKey", "k"),
        ("deadline", "2026-03-01T00:00:00Z"),
        ("dependencies", ["T-0"]),
        ("wrappingSequence", "S"),
        ("incompleteName", True),
    ],
)
def test_template_has_no_fields_of_a_single_order(field: str, value: object) -> None:
    body = {"cron": "0 6 * * *", "transportOrder": {"destinations": [{"locationName": "A"}], field: value}}
    with pytest.raises(ValueError, match=field):
        ScheduleRequest.model_validate(body)
