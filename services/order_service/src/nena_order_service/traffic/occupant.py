"""A vehicle as traffic control sees it: what it holds, and what it will want on its way."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from nena_order_service.traffic.resources import ResourceSet


@dataclass(slots=True)
class Occupant:
    """One vehicle: the sets behind and under it, those that it may drive to, those that it claims.

    ``held`` begins with the oldest set that the vehicle still covers and ends with the last one that was
    allocated; ``reached`` is the index in it of the point where the vehicle is or which it has left last.
    """

    name: str
    length_mm: int
    held: deque[ResourceSet]
    reached: int = 0
    claimed: deque[ResourceSet] = field(default_factory=deque)
    entry: ResourceSet | None = None
    """What it needs to come to the point where its ways begin; None: it is there."""

    @property
    def resting(self) -> bool:
        """Whether it has come to the end of its way and wants nothing."""
        return not self.claimed and self.reached == len(self.held) - 1

    @property
    def point(self) -> str:
        """The point that it has reached last."""
        return self.held[self.reached].point

    @property
    def ahead(self) -> int:
        """How many sets it holds in front of it."""
        return len(self.held) - 1 - self.reached

    def at_end(self, way: Sequence[ResourceSet]) -> list[ResourceSet]:
        """Give the sets that it covers at the end of ``way``, which follows what it holds."""
        sets = [*self.held, *way]
        return sets[covered_from(sets, len(sets) - 1, self.length_mm) :]

    def arrive(self, index: int) -> list[ResourceSet]:
        """Come to the ``index``-th held set; gives the sets that are free now, as a vehicle has a length."""
        self.reached, self.entry = index, None
        first = covered_from(self.held, index, self.length_mm)
        self.reached -= first
        return [self.held.popleft() for _ in range(first)]


def covered_from(sets: Sequence[ResourceSet], at: int, length_mm: int) -> int:
    """Give the index of the oldest set that a vehicle of this length covers at the point of ``at``.

    The length is taken to lie behind the point as a whole: where the robot's own reference point is in its
    middle, that is more than it needs, and never less.
    """
    covered, index = sets[at].length_mm, at
    while index > 0 and covered < length_mm:
        index -= 1
        covered += sets[index].length_mm
    return index
