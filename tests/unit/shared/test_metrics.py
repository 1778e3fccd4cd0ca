from __future__ import annotations

import pytest

from nena_shared.histogram import Histogram
from nena_shared.metrics import Exposition, Section, counter, gauge, histogram


def exposed(*metrics: object) -> list[str]:
    text = Exposition(None, [Section("x", metrics)], process=False).text().decode()  # type: ignore[arg-type]
    return [line for line in text.splitlines() if not line.startswith("#")]


def test_durations_fall_into_buckets_with_inclusive_upper_bounds() -> None:
    seen = Histogram((1.0, 2.0))
    for seconds in (0.5, 1.0, 1.5, 9.0):
        seen.observe(seconds)
    assert seen.counts == [2, 1, 1]
    assert seen.buckets() == [("1.0", 2.0), ("2.0", 3.0), ("+Inf", 4.0)]


def test_a_block_is_timed_also_if_it_fails() -> None:
    seen = Histogram((60.0,))
    with pytest.raises(KeyError), seen.timed():
        raise KeyError
    assert seen.counts == [1, 0]
    assert seen.total > 0


def test_values_with_and_without_labels_and_none_at_all() -> None:
    seen = Histogram((1.0,))
    seen.observe(0.5)
    assert exposed(
        gauge("a", "A.", lambda _: True),
        gauge("none", "None.", lambda _: None),
        counter("b_total", "B.", lambda _: {("x", "y"): 2}, "one", "two"),
        histogram("c", "C.", lambda _: {"z": seen}, "three"),
    ) == [
        "a 1.0",
        'b_total{one="x",two="y"} 2.0',
        'c_bucket{le="1.0",three="z"} 1.0',
        'c_bucket{le="+Inf",three="z"} 1.0',
        'c_count{three="z"} 1.0',
        'c_sum{three="z"} 0.5',
    ]
