"""The benchmarks name each target that they miss."""

from __future__ import annotations

from bench.figures import at_least, within
from bench.run import missed


def test_missed_targets_are_listed_with_their_values() -> None:
    figures = {
        "load_before": 0.5,
        "grid": {"targets": {"rate": at_least(250.0, 300.0), "event_loop_ms": within(12.0, 50.0)}},
        "traffic": {"aisles": {"20": {"target": at_least(0.8, 0.9)}}},
    }
    assert list(missed(figures)) == [
        "grid.targets.rate: 250.0, target 300.0",
        "traffic.aisles.20.target: 0.8, target 0.9",
    ]
