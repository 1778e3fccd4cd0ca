"""What processes have taken of the machine."""

from __future__ import annotations

from collections.abc import Mapping

import psutil


def cpu_of(pid: int) -> float:
    """Give the seconds of CPU that a process has taken."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def cpu_of_each(processes: Mapping[str, int]) -> dict[str, float]:
    """Give the seconds of CPU that each process, name to pid, has taken."""
    return {name: cpu_of(pid) for name, pid in processes.items()}


def rss_mb_of(pid: int) -> float:
    """Give the resident memory of a process, MB."""
    return round(psutil.Process(pid).memory_info().rss / 1e6, 1)
