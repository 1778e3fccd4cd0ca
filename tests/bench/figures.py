"""Figures of a benchmark: percentiles of samples, ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import quantiles

Figures = dict[str, float]


def milliseconds(samples: Sequence[float]) -> Figures:
    """Return median, 99th percentile, minimum, maximum and count of ``samples`` (s) in ms."""
    hundredths = quantiles(samples, n=100, method="inclusive")
    return {
        "samples": len(samples),
        "p50_ms": round(hundredths[49] * 1e3, 3),
        "p99_ms": round(hundredths[98] * 1e3, 3),
        "min_ms": round(min(samples) * 1e3, 3),
        "max_ms": round(max(samples) * 1e3, 3),
    }


def ratio(one: Figures, other: Figures) -> Figures:
    """Return the ratio of ``one`` to ``other``."""
    return {key: round(one[f"{key}_ms"] / other[f"{key}_ms"], 2) for key in ("p50", "p99")}


def within(value: float, target: float) -> dict[str, float | bool]:
    """Return a figure with its maximum, and whether it is within it."""
    return {"value": value, "target": target, "met": value <= target}


def at_least(value: float, target: float) -> dict[str, float | bool]:
    """Return a figure with its minimum, and whether it reaches it."""
    return {"value": value, "target": target, "met": value >= target}
