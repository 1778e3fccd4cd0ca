"""What processes have taken of the machine."""

from __future__ import annotations

from collections.abc import Mapping

import psutil


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process, seconds."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def cpu_of_each(processes: Mapping[str, int]) -> dict[str, float]:
    """Return the CPU time of each process (name to pid), seconds."""
    return {name: cpu_of(pid) for name, pid in processes.items()}


def rss_mb_of(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    return round(psutil.Process(pid).memory_info().rss / 1e6, 1)
