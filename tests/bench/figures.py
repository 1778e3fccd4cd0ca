"""Figures of a benchmark: percentiles of samples, ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import quantiles

Figures = dict[str, float]


def milliseconds(samples: Sequence[float]) -> Figures:
    """Give median, 99th percentile, least and most of ``samples`` (s) in ms, and how many they are."""
    hundredths = quantiles(samples, n=100, method="inclusive")
    return {
        "samples": len(samples),
        "p50_ms": round(hundredths[49] * 1e3, 3),
        "p99_ms": round(hundredths[98] * 1e3, 3),
        "min_ms": round(min(samples) * 1e3, 3),
        "max_ms": round(max(samples) * 1e3, 3),
    }


def ratio(one: Figures, other: Figures) -> Figures:
    """Give how many times as long ``one`` takes as ``other``."""
    return {key: round(one[f"{key}_ms"] / other[f"{key}_ms"], 2) for key in ("p50", "p99")}


def within(value: float, target: float) -> dict[str, float | bool]:
    """Give a figure with the most that it may be, and whether it keeps to it."""
    return {"value": value, "target": target, "met": value <= target}


def at_least(value: float, target: float) -> dict[str, float | bool]:
    """Give a figure with the least that it may be, and whether it keeps to it."""
    return {"value": value, "target": target, "met": value >= target}
