"""CPU cost of work, measured so that a busy machine changes it little."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time


def least_cpu(work: Callable[[], object], rounds: int = 3) -> float:
    """Return the least processor time of some rounds of ``work``, in seconds."""
    costs = []
    for _ in range(rounds):
        start = process_time()
        work()
        costs.append(process_time() - start)
    return min(costs)
