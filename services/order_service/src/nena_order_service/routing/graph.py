"""The graph that is searched: what one kind of vehicle may drive, and what each edge costs it."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite
from operator import attrgetter

import rustworkx as rx

from nena_order_service.routing.costs import CostEvaluator
from nena_order_service.routing.profile import RoutingProfile
from nena_order_service.routing.route import Step
from nena_shared.plant import DirectedEdge, PlantModel

_cost: Callable[[Step], float] = attrgetter("cost")
"""A function in C: it is called for every edge that a search meets."""


@dataclass(frozen=True, slots=True)
class Avoided:
    """Points and paths that must not be used; a point may still be left, for a vehicle can stand on it."""

    points: frozenset[str] = frozenset()
    paths: frozenset[str] = frozenset()

    def weight(self) -> Callable[[Step], float]:
        """Return what the search asks for the cost of a step."""
        return self._cost if self.points or self.paths else _cost

    def _cost(self, step: Step) -> float:
        avoided = step.path.name in self.paths or step.destination in self.points
        return inf if avoided else step.cost


class RoutingGraph:
    """The drivable edges of a plant for one routing profile; built once, then only read.

    Locked paths have no edge, nor have directions in which path or vehicle have no speed. A cost that is
    infinite or NaN excludes an edge too. Raises ValueError for a cost below 0, which no evaluator may return.
    """

    def __init__(self, plant: PlantModel, costs: Sequence[CostEvaluator], profile: RoutingProfile) -> None:
        self._names = tuple(point.name for point in plant.points)
        self._indices = {name: index for index, name in enumerate(self._names)}
        self._graph: rx.PyDiGraph[str, Step] = rx.PyDiGraph()
        self._graph.add_nodes_from(self._names)
        self._graph.add_edges_from(
            [
                (self._indices[step.source], self._indices[step.destination], step)
                for step in _steps(plant.edges(), costs, profile)
            ]
        )

    def shortest(self, source: str, destination: str, avoided: Avoided) -> tuple[Step, ...] | None:
        """Return the cheapest steps between two points, or None if there is no way."""
        start, goal = self._indices[source], self._indices[destination]
        if start == goal:
            return ()
        weight = avoided.weight()
        ways = rx.digraph_dijkstra_shortest_paths(self._graph, start, target=goal, weight_fn=weight)
        if goal not in ways:
            return None
        way = ways[goal]
        # Two points may be joined by several paths: the search used the cheapest.
        steps = tuple(min(self._graph.get_all_edge_data(a, b), key=weight) for a, b in pairwise(way))
        return steps if all(isfinite(weight(step)) for step in steps) else None

    def costs_from(self, source: str, destinations: Collection[str], avoided: Avoided) -> dict[str, float]:
        """Return what it costs to reach those of the destinations that can be reached."""
        start = self._indices[source]
        lengths = rx.digraph_dijkstra_shortest_path_lengths(self._graph, start, avoided.weight())
        indices = {name: self._indices[name] for name in destinations}
        costs = {name: lengths[index] for name, index in indices.items() if index in lengths}
        if source in destinations:
            costs[source] = 0.0
        return {name: cost for name, cost in costs.items() if isfinite(cost)}


def _steps(
    edges: Iterable[DirectedEdge], costs: Sequence[CostEvaluator], profile: RoutingProfile
) -> Iterable[Step]:
    for edge in edges:
        if edge.path.locked or not profile.speed_mm_s(edge):
            continue
        cost = sum((evaluate(edge, profile) for evaluate in costs), start=0.0)
        if cost < 0:
            msg = f"edge {edge.id!r} has cost {cost}; costs must not be below 0"
            raise ValueError(msg)
        if isfinite(cost):
            yield Step(edge, cost)
