from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.clock import SystemClock, in_utc, iso


def test_system_clock_is_utc_and_advances() -> None:
    clock = SystemClock()
    before = clock.monotonic()

    assert abs(clock.now() - datetime.now(UTC)) < timedelta(seconds=5)
    assert clock.now().tzinfo is UTC
    assert clock.monotonic() >= before


ZONES = st.timedeltas(timedelta(hours=-14), timedelta(hours=14)).map(timezone)
HERE = st.datetimes(datetime(2, 1, 1), datetime(9998, 1, 1), timezones=ZONES)  # noqa: DTZ001 - the zones come with it


@given(HERE)
def test_it_is_the_same_moment_in_utc(moment: datetime) -> None:
    found = in_utc(moment)

    assert found == moment
    assert found.tzinfo is UTC


def test_time_without_a_zone_is_utc() -> None:
    assert in_utc(datetime(2026, 1, 2, 3)) == datetime(2026, 1, 2, 3, tzinfo=UTC)  # noqa: DTZ001 - that is the case


@pytest.mark.parametrize(("year", "hours"), [(1, 14), (9999, -14)])
def test_times_outside_years_of_utc_are_refused(year: int, hours: int) -> None:
    edge = datetime(year, 1 if year == 1 else 12, 1 if year == 1 else 31, 0 if year == 1 else 23)  # noqa: DTZ001
    with pytest.raises(ValueError, match="years 1 to 9999"):
        in_utc(edge.replace(tzinfo=timezone(timedelta(hours=hours))))


@given(st.datetimes(timezones=st.just(UTC)))
def test_written_time_has_milliseconds_and_a_four_digit_year(moment: datetime) -> None:
    written = iso(moment)

    assert len(written) == len("2026-01-01T00:00:00.000Z")
    assert datetime.fromisoformat(written) == moment.replace(microsecond=moment.microsecond // 1000 * 1000)
