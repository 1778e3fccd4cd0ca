from __future__ import annotations

from datetime import timedelta

from nena_status_aggregator.fleet_model.clock_skew import SAMPLES, ClockSkew
from support.fleet_examples import START


def measured(*differences: float) -> float | None:
    skew = ClockSkew()
    for each in differences:
        skew.measure(START + timedelta(seconds=each), START)
    return skew.seconds


def test_nothing_is_known_before_the_first_message() -> None:
    assert measured() is None


def test_delays_do_not_count_as_skew() -> None:
    assert measured(-0.1, -30.0, -2.0) == -0.1


def test_a_fast_clock_shows() -> None:
    assert measured(59.8, 60.0, 59.9) == 60.0


def test_a_clock_that_was_put_right_is_believed_after_some_messages() -> None:
    assert measured(60.0, *[0.0] * SAMPLES) == 0.0
