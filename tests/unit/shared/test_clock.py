from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from nena_shared.clock import ManualClock, SystemClock


def test_manual_clock_moves_only_when_told() -> None:
    clock = ManualClock()
    start = clock.now()

    clock.advance(1.5)
    clock.advance(0)

    assert clock.monotonic() == 1.5
    assert clock.now() - start == timedelta(seconds=1.5)
    assert clock.now().tzinfo is UTC


def test_manual_clock_does_not_go_back() -> None:
    with pytest.raises(ValueError, match="does not go back"):
        ManualClock().advance(-0.1)


def test_system_clock_is_utc_and_goes_on() -> None:
    clock = SystemClock()
    before = clock.monotonic()

    assert abs(clock.now() - datetime.now(UTC)) < timedelta(seconds=5)
    assert clock.now().tzinfo is UTC
    assert clock.monotonic() >= before
