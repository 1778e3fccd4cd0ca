"""Resources of the plant: what each step needs, who uses them, and what vehicles at rest occupy."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from math import hypot
from typing import Final

from nena_order_service.routing.graph import Step
from nena_shared.plant import DirectedEdge, PlantModel, Point
from nena_shared.plant.geometry import Box, PlanarIndex
from nena_shared.plant.model import Block, BlockType
from nena_shared.plant.track import BoundingBox
from nena_shared.plant_terms import ExecutionTrigger

BLOCK_ENTRY_DIRECTION: Final = "tcs:blockEntryDirection"
"""Path property: direction in which a vehicle enters a block on this path. Default: that of the edge."""

Uses = Mapping[str, str | None]
"""Resources by name, each with the direction in which others may share it; None: exclusive."""


def conflict(one: str | None, other: str | None) -> bool:
    """Return whether two vehicles cannot share a resource, given their directions."""
    return one is None or one != other


@dataclass(frozen=True, slots=True)
class ResourceSet:
    """What a vehicle needs to drive to ``point``: the point, the path to it, and the blocks of both.

    ``length_mm`` is the path's length; 0 if the vehicle did not arrive by a path.
    """

    point: str
    length_mm: int
    uses: Uses


def opposite_edges(plant: PlantModel) -> dict[tuple[str, str], list[str]]:
    """Return the edges in the opposite direction, for each path and the point to which it is driven."""
    edges: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for edge in plant.edges():
        edges[edge.source, edge.destination].append(edge.id)
    return {
        (edge.path.name, edge.destination): edges[edge.destination, edge.source]
        for edge in plant.edges()
        if (edge.destination, edge.source) in edges
    }


class Resources:
    """Finds the resources that each step in one plant needs; none unless ``exclusive``.

    A peripheral device for which vehicles wait is a resource, by the name of its location: one vehicle at a
    time may be on paths that need it. See :class:`DeviceUse`.
    """

    def __init__(self, plant: PlantModel, *, exclusive: bool = True, peripherals: bool = True) -> None:
        self._exclusive = exclusive
        self._devices = DeviceUse(plant if peripherals else None)
        driven = {(path.source, path.destination) for path in plant.paths}
        self._crossings = Crossings(plant)
        self._two_way = {
            path.name
            for path in plant.paths
            if path.max_reverse_velocity_mm_s or (path.destination, path.source) in driven
        }
        self._block_names = {block.name for block in plant.blocks} | self._devices.names
        self._blocks: defaultdict[str, list[Block]] = defaultdict(list)
        for block in plant.blocks:
            for member in block.members:
                self._blocks[member].append(block)

    def waiting_places(self, way: Sequence[ResourceSet]) -> Iterator[int]:
        """Yield after how many sets of a route a vehicle may wait until it can continue.

        It may always wait at the end. Elsewhere it must be outside all blocks, and either continue on a
        one-way path, so that no oncoming vehicle waits for it, or stand where others can drive around it.
        """
        for count, (here, following) in enumerate(pairwise(way), start=1):
            # One that waits inside a block keeps all others out of it, which may be why it has to wait.
            outside = self._block_names.isdisjoint(here.uses)
            if outside and (self._crossings.is_open(here.point) or self._two_way.isdisjoint(following.uses)):
                yield count
        if way:
            yield len(way)

    def set_locks(self, locks: Mapping[str, bool]) -> None:
        """Apply the path locks set by hosts, overriding the plant model."""
        self._crossings.set_locks(locks)

    def at_point(self, point: str) -> ResourceSet:
        """Return the resources of a vehicle found at ``point``."""
        return self.on_members(point, (point,))

    def on_members(self, point: str, members: Sequence[str], *, length_mm: int = 0) -> ResourceSet:
        """Return the resources of a vehicle on ``members`` whose routes begin or end at ``point``."""
        return ResourceSet(point, length_mm, self._uses_of(members, {}))

    def along_steps(
        self, steps: Iterable[Step], *, start: ResourceSet, at_goal: Sequence[str] = ()
    ) -> Iterator[ResourceSet]:
        """Yield the resources of each step of a route from ``start``; the last set includes ``at_goal``."""
        way = tuple(steps)
        last = start
        devices = self._devices.needed_along([step.path.name for step in way], start.uses)
        for index, step in enumerate(way):
            members = [step.path.name, step.destination, *devices.get(index, ())]
            if index == len(way) - 1:
                members.extend(at_goal)
            # As in openTCS, the direction in a SAME_DIRECTION_ONLY block is that of the entry, kept inside.
            entry = step.path.properties.get(BLOCK_ENTRY_DIRECTION, step.edge_id)
            directions = {
                block.name: last.uses.get(block.name, entry)
                for member in members
                for block in self._blocks.get(member, ())
                if block.type is BlockType.SAME_DIRECTION_ONLY
            }
            last = ResourceSet(step.destination, step.path.length_mm, self._uses_of(members, directions))
            yield last

    def for_route(
        self,
        steps: Sequence[Step],
        *,
        start: ResourceSet,
        entry: ResourceSet | None = None,
        at_goal: Sequence[str] = (),
    ) -> list[ResourceSet]:
        """Return the resources of a route, including the ``entry`` before it.

        ``at_goal`` are the location and the peripheral devices that the vehicle uses at its goal. If it is
        there already, it needs only those.
        """
        sets = [] if entry is None else [entry]
        if steps or not at_goal:
            return [*sets, *self.along_steps(steps, start=entry or start, at_goal=at_goal)]
        if entry is None:
            return [ResourceSet(start.point, 0, self._uses_of(at_goal, {}))]
        return [ResourceSet(entry.point, entry.length_mm, {**entry.uses, **self._uses_of(at_goal, {})})]

    def _uses_of(self, members: Sequence[str], directions: Mapping[str, str | None]) -> Uses:
        if not self._exclusive:
            return {}
        # openTCS: whoever is on a member of a block needs the block, too.
        uses: dict[str, str | None] = dict.fromkeys((*members, *self._devices.needed_on(members)))
        for member in members:
            for block in self._blocks.get(member, ()):
                uses[block.name] = directions.get(block.name)
        return uses


class DeviceUse:
    """Finds the peripheral devices that vehicles need along a route.

    A vehicle needs a device on each path with an operation for whose end vehicles wait, and from there up to
    the path with an AFTER_MOVEMENT operation of the same device, such as closing a door.
    """

    def __init__(self, plant: PlantModel | None) -> None:
        paths = plant.paths if plant else ()
        waited_for = {
            operation.location
            for path in paths
            for operation in path.peripheral_operations
            if operation.completion_required
        }
        self.names = frozenset(waited_for)
        self._opening: dict[str, tuple[str, ...]] = {}
        self._closing: dict[str, tuple[str, ...]] = {}
        for path in paths:
            for operation in path.peripheral_operations:
                if operation.location in waited_for:
                    closes = operation.execution_trigger is ExecutionTrigger.AFTER_MOVEMENT
                    devices = self._closing if closes else self._opening
                    devices[path.name] = (*devices.get(path.name, ()), operation.location)

    def needed_on(self, members: Iterable[str]) -> Iterator[str]:
        """Yield the devices that a vehicle needs wherever it is on a path among ``members``."""
        if self.names:
            for member in members:
                yield from self._opening.get(member, ())
                yield from self._closing.get(member, ())

    def needed_along(self, paths: Sequence[str], held: Iterable[str] = ()) -> dict[int, list[str]]:
        """Return the devices that are needed on each of the paths of a route, by index.

        ``held`` are the resources before the route; devices among them may be open.
        """
        needed: dict[int, list[str]] = {}
        if not self.names:
            return needed
        opened = dict.fromkeys(self.names.intersection(held), 0)
        for index, path in enumerate(paths):
            for device in self._opening.get(path, ()):
                opened.setdefault(device, index)
                needed.setdefault(index, []).append(device)
            for device in self._closing.get(path, ()):
                for between in range(opened.pop(device, index), index + 1):
                    if device not in needed.setdefault(between, []):
                        needed[between].append(device)
        return needed


CROSSING = 3
"""Minimum number of neighbours of a crossing."""

DETOUR_PATHS = 8
"""Maximum number of paths of a detour around a crossing."""

PASSING_PATHS = 3
"""The same for a point with two neighbours; a longer detour is a ring, not a passing place."""


class Crossings:
    """Finds the crossings and passing places that others can bypass when a vehicle waits there.

    Each neighbour of such a point still leads to each other one by a short route around it, over unlocked
    paths. Points are checked on first use, because there may be thousands.
    """

    def __init__(self, plant: PlantModel) -> None:
        self._edges: defaultdict[str, list[DirectedEdge]] = defaultdict(list)
        self._neighbours: defaultdict[str, set[str]] = defaultdict(set)
        for edge in plant.edges():
            self._edges[edge.source].append(edge)
            self._neighbours[edge.source].add(edge.destination)
            self._neighbours[edge.destination].add(edge.source)
        self._locks: dict[str, bool] = {}
        self._open: dict[str, bool] = {}

    def set_locks(self, locks: Mapping[str, bool]) -> None:
        """Set path locks, overriding the plant model, and drop all cached results."""
        self._locks = dict(locks)
        self._open.clear()

    def is_open(self, point: str) -> bool:
        """Return whether others can drive around a point."""
        is_open = self._open.get(point)
        if is_open is None:
            neighbours = self._neighbours.get(point, set())
            paths = DETOUR_PATHS if len(neighbours) >= CROSSING else PASSING_PATHS
            is_open = len(neighbours) > 1 and all(
                self._leads_to(neighbours, neighbour, point, paths) for neighbour in neighbours
            )
            self._open[point] = is_open
        return is_open

    def _leads_to(self, others: set[str], start: str, without: str, paths: int) -> bool:
        """Return whether ``start`` leads to all others by at most ``paths`` paths, avoiding ``without``."""
        reached = newest = {start}
        for _ in range(paths):
            newest = (
                {
                    edge.destination
                    for point in newest
                    for edge in self._edges.get(point, ())
                    if not self._locks.get(edge.path.name, edge.path.locked)
                }
                - reached
                - {without}
            )
            reached = reached | newest
            if others <= reached or not newest:
                break
        return others <= reached


class UseIndex:
    """Counts the uses of each resource by vehicle and direction, because a loop uses some of them twice."""

    def __init__(self) -> None:
        self._users: defaultdict[str, dict[tuple[str, str | None], int]] = defaultdict(dict)

    def add(self, vehicle: str, uses: Uses) -> Uses:
        """Count one use of these resources by ``vehicle``; return those that it did not use before."""
        new: dict[str, str | None] = {}
        for resource, direction in uses.items():
            users, user = self._users[resource], (vehicle, direction)
            count = users.get(user, 0)
            users[user] = count + 1
            if not count:
                new[resource] = direction
        return new

    def remove(self, vehicle: str, uses: Uses) -> Uses:
        """Revert one :meth:`add` of the same uses; return those that the vehicle no longer uses."""
        gone: dict[str, str | None] = {}
        for resource, direction in uses.items():
            users, user = self._users[resource], (vehicle, direction)
            users[user] -= 1
            if not users[user]:
                del users[user]
                gone[resource] = direction
            if not users:
                del self._users[resource]
        return gone

    def other_users(self, vehicle: str, *sets: Uses) -> Iterator[tuple[str, str]]:
        """Yield the other users of resources that ``vehicle`` cannot share with them, as (user, resource)."""
        for uses in sets:
            for resource, direction in uses.items():
                for user, their_direction in self._users.get(resource, ()):
                    if user != vehicle and (direction is None or direction != their_direction):
                        yield user, resource

    def users_of(self, resource: str) -> frozenset[str]:
        """Return the vehicles that use ``resource``."""
        return frozenset(vehicle for vehicle, _ in self._users.get(resource, ()))


@dataclass(slots=True)
class Occupant:
    """The resource sets that one vehicle holds and claims.

    ``held`` begins with the oldest set that the vehicle still covers and ends with the last one that was
    allocated. ``reached`` is the index in it of the last point that the vehicle has reached.
    """

    name: str
    length_mm: int
    held: deque[ResourceSet]
    reached: int = 0
    claimed: deque[ResourceSet] = field(default_factory=deque)
    entry: ResourceSet | None = None
    """What it needs to reach the point where its routes begin; None if it is there."""

    @property
    def resting(self) -> bool:
        """Whether it has arrived at the end of its route and claims nothing."""
        return not self.claimed and self.reached == len(self.held) - 1

    @property
    def point(self) -> str:
        """The last point that it has reached."""
        return self.held[self.reached].point

    @property
    def ahead(self) -> int:
        """Number of sets that it holds ahead of it."""
        return len(self.held) - 1 - self.reached

    @property
    def length_ahead_mm(self) -> int:
        """How far it may drive beyond the last point that it has reached, mm."""
        return sum(resource_set.length_mm for resource_set in islice(self.held, self.reached + 1, None))

    @property
    def length_behind_next_mm(self) -> int:
        """How far it may drive beyond the next set, mm."""
        return sum(resource_set.length_mm for resource_set in islice(self.held, self.reached + 2, None))

    def at_end(self, way: Sequence[ResourceSet]) -> list[ResourceSet]:
        """Return the sets that it covers at the end of ``way``, which follows what it holds."""
        sets = [*self.held, *way]
        return sets[covered_from(sets, len(sets) - 1, self.length_mm) :]

    def arrive(self, index: int) -> list[ResourceSet]:
        """Move to the ``index``-th held set; return the sets that the vehicle's length no longer covers."""
        self.reached, self.entry = index, None
        first = covered_from(self.held, index, self.length_mm)
        self.reached -= first
        return [self.held.popleft() for _ in range(first)]


def covered_from(sets: Sequence[ResourceSet], at: int, length_mm: int) -> int:
    """Return the index of the oldest set that a vehicle of this length covers at the point of ``at``.

    The whole length is assumed to lie behind the point. For a robot with its reference point in the middle
    this is more than it needs, never less.
    """
    covered, index = sets[at].length_mm, at
    while index > 0 and covered < length_mm:
        index -= 1
        covered += sets[index].length_mm
    return index


@dataclass(frozen=True, slots=True)
class Found:
    """Where a vehicle was found, in mm in the plant's frame.

    ``point`` is where its routes start: the vehicle is there or, if ``on_point`` is False, it is the nearest
    point. Without ``place_mm`` the vehicle has reported only the point.
    """

    point: str
    on_point: bool
    place_mm: tuple[float, float] | None = None
    map_id: str = ""
    """The map of ``place_mm``; points on other maps are ignored."""


@dataclass(frozen=True, slots=True)
class OccupiedResources:
    """The resources that a vehicle occupies, and those that it needs to reach the start of its routes."""

    under: ResourceSet
    entry: ResourceSet | None = None


class OccupancyFinder:
    """Finds what vehicles occupy in one plant.

    A vehicle on a point occupies that point. Elsewhere it occupies the points and paths (as straight lines)
    that are within its own extent; far from all of them, nothing.
    """

    def __init__(self, plant: PlantModel, resources: Resources) -> None:
        self._plant = plant
        self._resources = resources
        places = plant.points_by_name
        self._points = PlanarIndex((_box_around(point), point) for point in plant.points)
        self._paths = PlanarIndex(
            (_box_around(places[path.source], places[path.destination]), path) for path in plant.paths
        )

    def find_occupied(self, found: Found, box: BoundingBox) -> OccupiedResources:
        """Return what a vehicle of this size occupies."""
        # The heading is not used: within this radius the vehicle may extend in any direction.
        reach_mm = box.length_mm / 2 + abs(box.reference_offset_x_mm)
        members = list(dict.fromkeys(self._names_under(found, reach_mm)))
        under = self._resources.on_members(found.point, members)
        if found.on_point or found.place_mm is None:
            return OccupiedResources(under)
        point = self._plant.point(found.point)
        way_mm = hypot(point.x_mm - found.place_mm[0], point.y_mm - found.place_mm[1])
        return OccupiedResources(
            under, self._resources.on_members(found.point, (found.point,), length_mm=round(way_mm))
        )

    def _names_under(self, found: Found, reach_mm: float) -> Iterator[str]:
        if found.on_point or found.place_mm is None:
            yield found.point
        if found.place_mm is None:
            return
        x_mm, y_mm = found.place_mm
        for point in self._points.near(x_mm, y_mm, reach_mm):
            near = hypot(point.x_mm - x_mm, point.y_mm - y_mm) < reach_mm
            if near and self._on_map(point.name, found):
                yield point.name
        if found.on_point:
            return
        points = self._plant.points_by_name
        for path in self._paths.near(x_mm, y_mm, reach_mm):
            source, target = points[path.source], points[path.destination]
            ends = ((source.x_mm, source.y_mm), (target.x_mm, target.y_mm))
            if self._on_map(source.name, found) and _distance_mm(found.place_mm, *ends) < reach_mm:
                yield path.name

    def _on_map(self, point: str, found: Found) -> bool:
        map_id = self._plant.points_by_name[point].map_id
        return not map_id or not found.map_id or map_id == found.map_id


def _box_around(*points: Point) -> Box:
    xs, ys = [point.x_mm for point in points], [point.y_mm for point in points]
    return Box(min(xs), min(ys), max(xs), max(ys))


def _distance_mm(place: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the distance of a position from the segment between two others, mm."""
    along = (end[0] - start[0], end[1] - start[1])
    apart = (place[0] - start[0], place[1] - start[1])
    square = along[0] ** 2 + along[1] ** 2
    share = min(max((apart[0] * along[0] + apart[1] * along[1]) / square, 0.0), 1.0) if square else 0.0
    return hypot(apart[0] - share * along[0], apart[1] - share * along[1])
