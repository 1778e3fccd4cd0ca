"""The routing graph: which vehicle may use which paths, and what they cost."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain, pairwise
from math import inf, isfinite, isnan
from operator import attrgetter
from types import MappingProxyType
from typing import Final, Protocol, Self

import rustworkx as rx

from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import (
    BoundingBox,
    DirectedEdge,
    Orientation,
    Path,
    PlantModel,
    Vehicle,
    property_keys,
)
from nena_shared.plant.track import MM_PER_M, VehicleTypeOnPath

R = ReasonCode


@dataclass(frozen=True, slots=True)
class Step:
    """One edge of a route and its cost, in the unit of the configured evaluators (mm by default)."""

    edge: DirectedEdge
    cost: float

    @property
    def edge_id(self) -> str:
        """The edge ID: the path's name, with a suffix for the backward direction."""
        return self.edge.id

    @property
    def path(self) -> Path:
        """The path that is driven."""
        return self.edge.path

    @property
    def source(self) -> str:
        """The name of the start point."""
        return self.edge.source

    @property
    def destination(self) -> str:
        """The name of the end point."""
        return self.edge.destination

    @property
    def orientation(self) -> Orientation:
        """Whether the path is driven forward or backward."""
        return self.edge.orientation


@dataclass(frozen=True, slots=True)
class Route:
    """A route from ``source`` to ``destination``; without steps if the vehicle is already there."""

    source: str
    destination: str
    steps: tuple[Step, ...]

    @property
    def cost(self) -> float:
        """The sum of the steps' costs."""
        return sum((step.cost for step in self.steps), start=0.0)

    @property
    def length_m(self) -> float:
        """Length of the route, metres, independent of costs."""
        return sum(step.path.length_mm for step in self.steps) / MM_PER_M

    @property
    def points(self) -> tuple[str, ...]:
        """The names of all points of the route, including both ends."""
        return (self.source, *(step.destination for step in self.steps))


class NoRouteError(Exception):
    """There is no route from ``source`` to any of ``destinations`` that avoids what it must."""

    def __init__(
        self,
        source: str,
        destinations: Iterable[str],
        vehicle: Vehicle | None,
        avoid: Iterable[str],
        graph: RoutingGraph,
    ) -> None:
        self.source = source
        self.destinations = tuple(destinations)
        self.vehicle = None if vehicle is None else vehicle.name
        self.avoid = tuple(sorted(avoid))
        self._graph = graph
        super().__init__(source, self.destinations)

    def __str__(self) -> str:
        return str(self.reason)

    @property
    def reason(self) -> Reason:
        """Why there is none; searched when asked for, because traffic control seldom asks."""
        details = []
        if self.vehicle:
            details.append(Reason(R.FOR_VEHICLE, vehicle=self.vehicle))
        if self.avoid:
            details.append(Reason(R.WITHOUT_NAMES, names=", ".join(map(repr, self.avoid))))
        if not self.destinations:
            return Reason(R.NO_ROUTE_ANYWHERE, *details, source=self.source)
        details.append(self._graph.why_no_way(self.source, self.destinations[0]))
        goal = " or ".join(map(repr, self.destinations))
        return Reason(R.NO_ROUTE, *details, source=self.source, goal=goal)


@dataclass(frozen=True, slots=True)
class RoutingProfile:
    """The properties of a vehicle that affect its routes, in mm/s and mm; None: unlimited."""

    group: str = ""
    max_velocity_mm_s: int | None = None
    max_reverse_velocity_mm_s: int | None = None
    vehicle_types: frozenset[str] = frozenset()
    """Its possible types; it only uses resources open to all of them."""
    bounding_box: BoundingBox | None = None
    allowed_maps: frozenset[str] | None = None

    @classmethod
    def of(cls, vehicle: Vehicle | None, known_types: frozenset[str] = frozenset()) -> Self:
        """Return the routing profile of a vehicle; None: that of any vehicle.

        A vehicle without a type may be of any type that the plant knows.
        """
        if vehicle is None:
            return cls()
        named = frozenset({vehicle.vehicle_type}) if vehicle.vehicle_type else known_types
        return cls(
            group=vehicle.routing_group,
            max_velocity_mm_s=vehicle.max_velocity_mm_s,
            max_reverse_velocity_mm_s=vehicle.max_reverse_velocity_mm_s,
            vehicle_types=named if known_types else frozenset(),
            bounding_box=vehicle.bounding_box,
            allowed_maps=vehicle.allowed_maps,
        )

    def uses_of(self, path: Path) -> Iterator[VehicleTypeOnPath]:
        """Yield the rules of the path for the vehicle's possible types."""
        return (use for use in path.vehicle_types if use.vehicle_type_id in self.vehicle_types)

    def speed_mm_s(self, edge: DirectedEdge) -> int:
        """Return the maximum speed of such a vehicle along an edge, mm/s; 0 if it cannot drive it.

        A type that drives an edge backwards according to LIF is limited by its reverse speed.
        """
        return min((edge.max_velocity_mm_s, *self._limits_mm_s(edge)))

    def given_speed_mm_s(self, edge: DirectedEdge) -> int | None:
        """Return :meth:`speed_mm_s` from explicit limits only; None if the path only has its default."""
        limits = tuple(self._limits_mm_s(edge))
        if not edge.is_forward or "max_velocity_mm_s" in edge.path.model_fields_set:
            return min((edge.max_velocity_mm_s, *limits))
        return min(limits, default=None)

    def _limits_mm_s(self, edge: DirectedEdge) -> Iterator[int]:
        """Yield the speed limits of the vehicle's types along an edge, and its own maximum, mm/s."""
        # By its vehicleOrientation in LIF, a type may drive a forward edge backwards.
        backward = not edge.is_forward
        for use in self.uses_of(edge.path):
            backward = backward or use.is_backward
            if use.max_speed is not None:
                yield round(use.max_speed * MM_PER_M)
        own = self.max_reverse_velocity_mm_s if backward else self.max_velocity_mm_s
        if own is not None:
            yield own


class Access:
    """Which edges of a plant are open to vehicles of one profile.

    Closed are: locked paths; directions in which the path or the vehicle has no speed; paths and points that
    exclude the vehicle's type or height; points on maps where it must not drive. A vehicle may leave a
    point that is closed to it.
    """

    def __init__(
        self, plant: PlantModel, profile: RoutingProfile, locks: Mapping[str, bool] | None = None
    ) -> None:
        """Read a plant; ``locks`` maps paths to whether they are locked, overriding the plant model."""
        self._points = plant.points_by_name
        self._profile = profile
        self._locks = locks or {}

    def why_closed(self, edge: DirectedEdge) -> Reason | None:
        """Return why such a vehicle must not drive along the edge; None if it may."""
        path, point, profile = edge.path, self._points[edge.destination], self._profile
        if self._locks.get(path.name, path.locked):
            return Reason(R.WAY_LOCKED, path=path.name)
        if profile.speed_mm_s(edge) <= 0:
            one_way = Reason(R.WAY_ONE_WAY, path=path.name, source=edge.source, goal=edge.destination)
            return Reason(R.WAY_NO_SPEED, path=path.name) if edge.max_velocity_mm_s else one_way
        # A vehicle whose type is not known may be of any: it drives only where all of them may.
        for place in (path, point):
            if closed := [name for name in sorted(profile.vehicle_types) if not place.is_open_to(name)]:
                return Reason(R.WAY_OTHER_TYPES, place=place.name, types=", ".join(closed))
        box, heights = profile.bounding_box, [use.max_height for use in profile.uses_of(path)]
        if box and any(height is not None and box.height_mm > height * MM_PER_M for height in heights):
            return Reason(R.WAY_LOW, path=path.name)
        maps = profile.allowed_maps
        if maps is not None and point.map_id not in {None, *maps}:
            return Reason(R.WAY_OTHER_MAP, point=point.name, map=str(point.map_id))
        return None


@dataclass(frozen=True, slots=True)
class VehicleKind:
    """A routing profile, with a number that is quick to compare."""

    number: int
    profile: RoutingProfile


class VehicleKinds:
    """Caches the kind of each vehicle of the plant model."""

    def __init__(self, known_types: frozenset[str]) -> None:
        """``known_types`` are the vehicle types that the plant distinguishes."""
        self._known_types = known_types
        self._any_vehicle = VehicleKind(0, RoutingProfile())
        self._kinds = {self._any_vehicle.profile: self._any_vehicle}
        self._of: dict[str, tuple[Vehicle, VehicleKind]] = {}

    def kind_of(self, vehicle: Vehicle | None) -> VehicleKind:
        """Return the kind of a vehicle; None: any vehicle."""
        if vehicle is None:
            return self._any_vehicle
        cached = self._of.get(vehicle.name)
        if cached is None or cached[0] is not vehicle:
            profile = RoutingProfile.of(vehicle, self._known_types)
            cached = vehicle, self._kinds.setdefault(profile, VehicleKind(len(self._kinds), profile))
            self._of[vehicle.name] = cached
        return cached[1]


CLOSED_MM: Final = 1e9
WRONG_WAY_MM: Final = 1e13
"""Lengths added to closed edges and to the closed directions of one-way paths, to find what closes a way."""

_COST: Final[Callable[[Step], float]] = attrgetter("cost")
"""Implemented in C, because a search calls it for every edge."""


@dataclass(frozen=True, slots=True)
class CostMap:
    """Costs to reach one point from each start; compact, because many are cached."""

    indices: Mapping[str, int]
    costs: array[float]

    def cost_from(self, point: str) -> float:
        """Return the cost from a point; infinity if there is no route."""
        return self.costs[self.indices[point]]

    def costs_from_each(self, points: Iterable[str]) -> list[float]:
        """Return the cost from each of many points."""
        costs, indices = self.costs, self.indices
        return [costs[indices[point]] for point in points]


def burdened_cost(burden: Mapping[str, float]) -> Callable[[Step], float]:
    """Return a cost function that adds the given shares for edges and points to each step."""
    share = burden.get
    return lambda step: step.cost * (1.0 + share(step.edge.id, 0.0) + share(step.edge.destination, 0.0))


class RoutingGraph:
    """The drivable edges of a plant for one routing profile; only :meth:`apply_locks` changes it.

    It contains the edges that are open to the profile (see :class:`Access`) and have a finite cost.

    Raises:
        ValueError: an evaluator returned a negative cost.
    """

    def __init__(
        self,
        plant: PlantModel,
        costs: Sequence[CostEvaluator],
        profile: RoutingProfile,
        locks: Mapping[str, bool] | None = None,
    ) -> None:
        self._plant = plant
        self._costs = costs
        self._profile = profile
        self._indices = {point.name: index for index, point in enumerate(plant.points)}
        self._backward: rx.PyDiGraph[str, Step] | None = None
        self._graph: rx.PyDiGraph[str, Step] = rx.PyDiGraph()
        self._graph.add_nodes_from(list(self._indices))
        self._add_edges(plant.edges(), locks)

    def apply_locks(self, paths: Iterable[Path], locks: Mapping[str, bool]) -> None:
        """Remove or add the edges of the paths whose locks have changed."""
        for path in paths:
            for index in {*self._path_indices(path)}:
                self._graph.remove_edge_from_index(index)
            self._add_edges(path.edges(), locks)
        self._backward = None

    def _add_edges(self, edges: Iterable[DirectedEdge], locks: Mapping[str, bool] | None) -> None:
        self._access = Access(self._plant, self._profile, locks)
        edge_steps = []
        for edge in edges:
            if self._access.why_closed(edge):
                continue
            cost = sum((evaluate(edge, self._profile) for evaluate in self._costs), start=0.0)
            # Dijkstra's algorithm is only right without negative costs.
            if cost < 0:
                raise ValueError(f"edge {edge.id!r} has cost {cost}; costs must not be below 0")
            if isfinite(cost):
                step = Step(edge, cost)
                edge_steps.append((self._indices[step.source], self._indices[step.destination], step))
        self._graph.add_edges_from(edge_steps)

    def without(self, points: Iterable[str], paths: Iterable[Path]) -> RoutingGraph:
        """Return a copy in which no edge leads to these points or along these paths.

        Edges from an avoided point are kept, because a vehicle may be standing on it.
        """
        to_points = (self._graph.in_edge_indices(self._indices[point]) for point in points)
        along_paths = (self._path_indices(path) for path in paths)
        pruned = copy(self)
        pruned._graph = self._graph.copy()  # noqa: SLF001 - an object of this class
        pruned._backward = None  # noqa: SLF001 - an object of this class
        for index in {*chain.from_iterable(to_points), *chain.from_iterable(along_paths)}:
            pruned._graph.remove_edge_from_index(index)  # noqa: SLF001 - an object of this class
        return pruned

    def shortest_steps(self, source: str, destination: str) -> tuple[Step, ...] | None:
        """Return the cheapest steps between two points, or None if there is no route."""
        start, goal = self._indices[source], self._indices[destination]
        if start == goal:
            return ()
        ways = rx.digraph_dijkstra_shortest_paths(self._graph, start, target=goal, weight_fn=_COST)
        return self._steps_along(ways[goal], _COST) if goal in ways else None

    def why_no_way(self, source: str, destination: str) -> Reason:
        """Return what closes the way there: of the ways with the fewest closed edges, the shortest."""
        open_edges = {step.edge_id for step in self._graph.edges()}
        steps = []
        for edge in (DirectedEdge(path, each) for path in self._plant.paths for each in Orientation):
            wrong_way = 0.0 if edge.max_velocity_mm_s else WRONG_WAY_MM
            cost = edge.path.length_mm + (0.0 if edge.id in open_edges else CLOSED_MM + wrong_way)
            steps.append((self._indices[edge.source], self._indices[edge.destination], Step(edge, cost)))
        everything = copy(self)
        everything._graph = rx.PyDiGraph()  # noqa: SLF001 - an object of this class
        everything._graph.add_nodes_from(list(self._indices))  # noqa: SLF001 - an object of this class
        everything._graph.add_edges_from(steps)  # noqa: SLF001 - an object of this class
        for step in everything.shortest_steps(source, destination) or ():
            if step.cost >= CLOSED_MM:
                costs = [evaluate(step.edge, self._profile) for evaluate in self._costs]
                avoided = R.WAY_NEEDED if isfinite(sum(costs)) else R.WAY_BY_COST
                return self._access.why_closed(step.edge) or Reason(avoided, path=step.path.name)
        return Reason(R.WAY_MISSING)

    def shortest_steps_now(
        self, source: str, destination: str, burden: Mapping[str, float], usual: CostMap
    ) -> tuple[Step, ...] | None:
        """Return the cheapest steps while ``burden`` adds shares of their costs to edges and points.

        ``usual`` has the costs to the destination without it, or lower ones: the heuristic of the A* search.
        It confines the search to points near the route, because calling Python for each edge of a large plant
        is slow.
        """
        start, goal = self._indices[source], self._indices[destination]
        if start == goal:
            return ()
        # Without a path, A* would visit every point that can be reached before it raises.
        if not rx.has_path(self._graph, start, goal):
            return None
        cost = burdened_cost(burden)
        points = rx.digraph_astar_shortest_path(self._graph, start, destination.__eq__, cost, usual.cost_from)
        return self._steps_along(points, cost)

    def _steps_along(self, points: Sequence[int], cost: Callable[[Step], float]) -> tuple[Step, ...]:
        """Return the steps between these points, each on the cheapest path that joins two of them."""
        return tuple(min(self._graph.get_all_edge_data(a, b), key=cost) for a, b in pairwise(points))

    def steps_along(self, start: str, way: Iterable[tuple[str, Collection[str]]]) -> tuple[Step, ...] | None:
        """Return the steps to these points in turn, each on one of the paths named with its point.

        None if one of them is closed.
        """
        steps: list[Step] = []
        for point, paths in way:
            a, b = self._indices.get(start), self._indices.get(point)
            if a is None or b is None or not self._graph.has_edge(a, b):
                return None
            open_steps = [step for step in self._graph.get_all_edge_data(a, b) if step.path.name in paths]
            if not open_steps:
                return None
            steps.append(min(open_steps, key=_COST))
            start = point
        return tuple(steps)

    def costs_from(self, source: str, destinations: Iterable[str]) -> dict[str, float]:
        """Return the costs of the reachable destinations."""
        start, indices = self._indices[source], {name: self._indices[name] for name in destinations}
        goals = {*indices.values()} - {start}
        # A search with one goal stops there; with several goals it covers all reachable points.
        goal = next(iter(goals)) if len(goals) == 1 else None
        search = rx.digraph_dijkstra_shortest_path_lengths
        lengths = search(self._graph, start, _COST, goal) if goals else {}
        costs = {name: lengths[index] for name, index in indices.items() if index in lengths}
        return {**costs, source: 0.0} if source in indices else costs

    def costs_to(self, destination: str) -> CostMap:
        """Return the costs to reach a point from each point."""
        # One search against the edges gives the costs from all starts; the reversed graph is kept for it.
        if self._backward is None:
            self._backward = self._graph.copy()
            self._backward.reverse()
        goal = self._indices[destination]
        costs = array("d", [inf]) * len(self._indices)
        for index, cost in rx.digraph_dijkstra_shortest_path_lengths(self._backward, goal, _COST).items():
            costs[index] = cost
        costs[goal] = 0.0
        return CostMap(self._indices, costs)

    def keeps_costs(self, costs: CostMap, goal: str, changed: Iterable[Path]) -> bool:
        """Return whether the costs to a goal are the same after these paths were locked or unlocked.

        They are if each point at which such a path starts has the same cost over one of its edges as before.
        An edge with cost 0 proves nothing, because it may be part of a cycle.
        """
        for source in {edge.source for path in changed for edge in path.edges()} - {goal}:
            cost = costs.cost_from(source)
            ways = [
                (step.cost + costs.cost_from(step.destination), step.cost)
                for _, _, step in self._graph.out_edges(self._indices[source])
            ]
            cheapest, last = min(ways, default=(inf, inf))
            if cheapest != cost or not last:
                return False
        return True

    def _path_indices(self, path: Path) -> list[int]:
        ends = (self._indices[path.source], self._indices[path.destination])
        return [
            index
            for a, b in (ends, reversed(ends))
            for index in self._graph.edge_indices_from_endpoints(a, b)
            if self._graph.get_edge_data_by_index(index).path == path
        ]


class CostEvaluator(Protocol):
    """Returns the cost of an edge, 0 or more; infinity and NaN exclude the edge."""

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return the cost of the edge for a vehicle of this profile."""
        ...


class CostKey(StrEnum):
    """The names of the evaluators in the settings."""

    DISTANCE = "DISTANCE"
    TRAVELTIME = "TRAVELTIME"
    HOPS = "HOPS"
    EXPLICIT_PROPERTIES = "EXPLICIT_PROPERTIES"
    BOUNDING_BOX = "BOUNDING_BOX"


def distance(edge: DirectedEdge, _profile: RoutingProfile, /) -> float:
    """Return the length of the path in mm."""
    return float(edge.path.length_mm)


def travel_time(edge: DirectedEdge, profile: RoutingProfile, /) -> float:
    """Return the travel time, seconds, at the lower of the path's and the vehicle's maximum speeds."""
    speed_mm_s = profile.speed_mm_s(edge)
    return edge.path.length_mm / speed_mm_s if speed_mm_s else inf


def hops(_edge: DirectedEdge, _profile: RoutingProfile, /) -> float:
    """Return 1, so that the route with the fewest paths is the cheapest."""
    return 1.0


@dataclass(frozen=True, slots=True)
class ExplicitProperties:
    """Costs from the path properties ``tcs:routingCostForward<GROUP>``, ``tcs:routingCostReverse<GROUP>``.

    If the property is missing, negative or not a number, the cost is ``missing``: so high that the path is
    used only if there is no other route.
    """

    missing: float = 1_000_000.0

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return the cost from the property; ``Infinity`` excludes the edge."""
        forward = edge.orientation is Orientation.FORWARD
        # openTCS adds the vehicle's routing group to the name of the property.
        key = property_keys.ROUTING_COST_FORWARD if forward else property_keys.ROUTING_COST_REVERSE
        try:
            cost = float(edge.path.properties[key + profile.group])
        except (KeyError, ValueError):
            return self.missing
        return self.missing if isnan(cost) or cost < 0 else cost


class BoundingBoxLimit:
    """Excludes edges to points where the vehicle would exceed the maximum bounding box.

    It adds no cost, so it can be combined with other evaluators. Boxes are aligned at their reference points.
    """

    def __init__(self, plant: PlantModel) -> None:
        self._points = plant.points_by_name

    def __call__(self, edge: DirectedEdge, profile: RoutingProfile, /) -> float:
        """Return 0, or infinity if the vehicle is too large."""
        box = profile.bounding_box
        limit = self._points[edge.destination].max_vehicle_bounding_box
        return 0.0 if box is None or limit.contains(box) else inf


_EVALUATORS: Final[Mapping[CostKey, CostEvaluator]] = MappingProxyType(
    {
        CostKey.DISTANCE: distance,
        CostKey.TRAVELTIME: travel_time,
        CostKey.HOPS: hops,
        CostKey.EXPLICIT_PROPERTIES: ExplicitProperties(),
    }
)


def cost_evaluators(keys: Iterable[CostKey], plant: PlantModel) -> tuple[CostEvaluator, ...]:
    """Return the configured evaluators for one plant."""
    return tuple(BoundingBoxLimit(plant) if key is CostKey.BOUNDING_BOX else _EVALUATORS[key] for key in keys)
