"""Resources: what a vehicle needs for itself on each step of its way (openTCS: scheduler, resource sets)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from nena_order_service.routing import Step
from nena_shared.plant import PlantModel
from nena_shared.plant.block import Block, BlockType

BLOCK_ENTRY_DIRECTION: Final = "tcs:blockEntryDirection"
"""Path property: the direction in which a vehicle enters a block by this path; without it the path's own."""

Uses = Mapping[str, str | None]
"""Resources by name, each with the direction that others may use it in meanwhile; None: nobody else."""


def conflict(one: str | None, other: str | None) -> bool:
    """Tell whether two vehicles cannot use one resource at the same time, each in its direction."""
    return one is None or one != other


@dataclass(frozen=True, slots=True)
class ResourceSet:
    """What a vehicle needs to come to ``point``: the point, the path to it, and the blocks of both.

    ``length_mm`` is that of the path; 0 where the vehicle has not come by a path.
    """

    point: str
    length_mm: int
    uses: Uses


class Resources:
    """Knows which resources each step over one plant needs; none at all where they are not ``exclusive``."""

    def __init__(self, plant: PlantModel, *, exclusive: bool = True) -> None:
        self._exclusive = exclusive
        self._blocks: defaultdict[str, list[Block]] = defaultdict(list)
        for block in plant.blocks:
            for member in block.members:
                self._blocks[member].append(block)

    def at(self, point: str) -> ResourceSet:
        """Give the resources of a vehicle that was found at ``point``, come by whatever way."""
        return self.on(point, (point,))

    def on(self, point: str, members: Sequence[str], *, length_mm: int = 0) -> ResourceSet:
        """Give the resources of a vehicle on ``members``, whose ways begin or end at ``point``."""
        return ResourceSet(point, length_mm, self._uses(members, {}))

    def along(
        self, steps: Iterable[Step], *, start: ResourceSet, location: str | None = None
    ) -> Iterator[ResourceSet]:
        """Give the resources of each step of a way from ``start`` on; the last also has ``location``."""
        way = tuple(steps)
        before = start
        for index, step in enumerate(way):
            members = [step.path.name, step.destination]
            if location is not None and index == len(way) - 1:
                members.append(location)
            directions = self._directions(members, step, before)
            before = ResourceSet(step.destination, step.path.length_mm, self._uses(members, directions))
            yield before

    def way(
        self,
        steps: Sequence[Step],
        *,
        start: ResourceSet,
        entry: ResourceSet | None = None,
        location: str | None = None,
    ) -> list[ResourceSet]:
        """Give the resources of a whole way, with the ``entry`` that comes before it and the ``location``.

        A vehicle that is to use a location where it is needs that alone, without a step.
        """
        before = [] if entry is None else [entry]
        if steps or location is None:
            return [*before, *self.along(steps, start=entry or start, location=location)]
        if entry is None:
            return [ResourceSet(start.point, 0, self._uses((location,), {}))]
        return [ResourceSet(entry.point, entry.length_mm, {**entry.uses, **self._uses((location,), {})})]

    def _directions(self, members: Iterable[str], step: Step, before: ResourceSet) -> dict[str, str | None]:
        """Give the direction of each same-direction block: a vehicle keeps the one in which it came in."""
        entry = step.path.properties.get(BLOCK_ENTRY_DIRECTION, step.edge_id)
        return {
            block.name: before.uses.get(block.name, entry)
            for member in members
            for block in self._blocks.get(member, ())
            if block.type is BlockType.SAME_DIRECTION_ONLY
        }

    def _uses(self, members: Sequence[str], directions: Mapping[str, str | None]) -> Uses:
        if not self._exclusive:
            return {}
        uses: dict[str, str | None] = dict.fromkeys(members)
        for member in members:
            for block in self._blocks.get(member, ()):
                uses[block.name] = directions.get(block.name)
        return uses
