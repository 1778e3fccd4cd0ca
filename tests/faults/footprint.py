"""Resources of programs before and after the faults: none may grow without bound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import psutil

MORE_DESCRIPTORS = 24
"""What else a program may have open: clients come and go, and a database has a pool."""
MORE_THREADS = 8
"""Workers of a pool are made when they are first needed."""
MORE_MB = 60.0
"""Caches fill, and an allocator keeps what it once had."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """Of one program, at one moment."""

    megabytes: float
    """Resident memory."""
    descriptors: int
    threads: int

    @classmethod
    def of(cls, pid: int) -> Self:
        """Measure a process."""
        process = psutil.Process(pid)
        with process.oneshot():
            megabytes = process.memory_info().rss / 1e6
            return cls(round(megabytes, 1), process.num_fds(), process.num_threads())

    def growth_to(self, after: Footprint) -> list[str]:
        """Return what has grown more than allowed; empty if nothing has."""
        grown = {
            f"{after.megabytes} MB after {self.megabytes}": after.megabytes - self.megabytes - MORE_MB,
            f"{after.descriptors} descriptors after {self.descriptors}": after.descriptors
            - self.descriptors
            - MORE_DESCRIPTORS,
            f"{after.threads} threads after {self.threads}": after.threads - self.threads - MORE_THREADS,
        }
        return [said for said, beyond in grown.items() if beyond > 0]


def grown(before: Mapping[str, Footprint], after: Mapping[str, Footprint]) -> dict[str, list[str]]:
    """Return what has grown more than allowed, by program; programs that did not exist before are new."""
    found = {name: before[name].growth_to(each) for name, each in after.items() if name in before}
    return {name: said for name, said in found.items() if said}
