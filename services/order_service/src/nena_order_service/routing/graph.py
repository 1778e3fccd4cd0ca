"""The graph that is searched: what one kind of vehicle may drive, and what each edge costs it."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import chain, pairwise
from math import inf, isfinite
from operator import attrgetter
from typing import Final

import rustworkx as rx

from nena_order_service.routing.access import Access
from nena_order_service.routing.costs import CostEvaluator
from nena_order_service.routing.profile import RoutingProfile
from nena_order_service.routing.route import Step
from nena_shared.plant import DirectedEdge, Path, PlantModel

_COST: Final[Callable[[Step], float]] = attrgetter("cost")
"""A function in C, for it is called for every edge that a search meets."""


@dataclass(frozen=True, slots=True)
class CostMap:
    """What it costs to reach one point, wherever a vehicle starts; kept small, for there are many."""

    indices: Mapping[str, int]
    costs: "array[float]"

    def source(self, point: str) -> float:
        """Return the cost from a point; infinity where there is no way."""
        return self.costs[self.indices[point]]


class RoutingGraph:
    """The drivable edges of a plant for one routing profile; built once, then only read.

    It has the edges that are open to the profile (see `Access`). A cost that is infinite or NaN excludes an
    edge too. Raises ValueError for a cost below 0, which no evaluator may return.
    """

    def __init__(
        self,
        plant: PlantModel,
        costs: Sequence[CostEvaluator],
        profile: RoutingProfile,
        locks: Mapping[str, bool] | None = None,
    ) -> None:
        access = Access(plant, profile, locks)
        self._indices = {point.name: index for index, point in enumerate(plant.points)}
        self._backward: rx.PyDiGraph[str, Step] | None = None
        self._graph: rx.PyDiGraph[str, Step] = rx.PyDiGraph()
        self._graph.add_nodes_from(list(self._indices))
        self._graph.add_edges_from(
            [
                (self._indices[step.source], self._indices[step.destination], step)
                for step in _steps(filter(access.allows, plant.edges()), costs, profile)
            ]
        )

    def without(self, points: Iterable[str], paths: Iterable[Path]) -> "RoutingGraph":
        """Return a copy in which no edge leads to these points or along these paths.

        A point that is to be avoided may still be left: a vehicle can stand on it.
        """
        to_points = (self._graph.in_edge_indices(self._indices[point]) for point in points)
        along_paths = (self._path_indices(path) for path in paths)
        pruned = copy(self)
        pruned._graph = self._graph.copy()  # noqa: SLF001 - an object of this class
        pruned._backward = None  # noqa: SLF001 - an object of this class
        for index in {*chain.from_iterable(to_points), *chain.from_iterable(along_paths)}:
            pruned._graph.remove_edge_from_index(index)  # noqa: SLF001 - an object of this class
        return pruned

    def shortest(self, source: str, destination: str) -> tuple[Step, ...] | None:
        """Return the cheapest steps between two points, or None if there is no way."""
        start, goal = self._indices[source], self._indices[destination]
        if start == goal:
            return ()
        ways = rx.digraph_dijkstra_shortest_paths(self._graph, start, target=goal, weight_fn=_COST)
        if goal not in ways:
            return None
        # Two points may be joined by several paths: the search went by the cheapest.
        return tuple(min(self._graph.get_all_edge_data(a, b), key=_COST) for a, b in pairwise(ways[goal]))

    def costs_from(self, source: str, destinations: Iterable[str]) -> dict[str, float]:
        """Return what it costs to reach those of the destinations that can be reached."""
        start, indices = self._indices[source], {name: self._indices[name] for name in destinations}
        goals = {*indices.values()} - {start}
        # A search for one goal ends there, one for several goes through all that can be reached.
        goal = next(iter(goals)) if len(goals) == 1 else None
        search = rx.digraph_dijkstra_shortest_path_lengths
        lengths = search(self._graph, start, _COST, goal) if goals else {}
        costs = {name: lengths[index] for name, index in indices.items() if index in lengths}
        return {**costs, source: 0.0} if source in indices else costs

    def costs_to(self, destination: str) -> "CostMap":
        """Return what it costs to reach a point from each point."""
        if self._backward is None:
            self._backward = self._graph.copy()
            self._backward.reverse()
        goal = self._indices[destination]
        costs = array("d", [inf]) * len(self._indices)
        for index, cost in rx.digraph_dijkstra_shortest_path_lengths(self._backward, goal, _COST).items():
            costs[index] = cost
        costs[goal] = 0.0
        return CostMap(self._indices, costs)

    def _path_indices(self, path: Path) -> list[int]:
        ends = (self._indices[path.source], self._indices[path.destination])
        return [
            index
            for a, b in (ends, reversed(ends))
            for index in self._graph.edge_indices_from_endpoints(a, b)
            if self._graph.get_edge_data_by_index(index).path == path
        ]


def _steps(
    edges: Iterable[DirectedEdge], costs: Sequence[CostEvaluator], profile: RoutingProfile
) -> Iterator[Step]:
    for edge in edges:
        cost = sum((evaluate(edge, profile) for evaluate in costs), start=0.0)
        if cost < 0:
            msg = f"edge {edge.id!r} has cost {cost}; costs must not be below 0"
            raise ValueError(msg)
        if isfinite(cost):
            yield Step(edge, cost)
