"""Cheapest assignment of orders to vehicles; more urgent orders are served first.

Successive shortest augmenting paths with potentials, after Jonker and Volgenant (1987), over the feasible
pairs: each added order gets a vehicle, and others may change theirs for it, so that the total cost is
minimal. Costs are integers, so rounding loses nothing. No clock, no I/O.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heappop, heappush

Costs = Mapping[str, int]
"""Cost of each vehicle that could execute the order, at least 0."""


def assign(levels: Sequence[Mapping[int, Costs]]) -> dict[int, str]:
    """Return vehicle names by the numbers of the orders that get one; each vehicle gets at most one.

    Each level is served before the later ones: as many of its orders as possible, and never fewer for the
    sake of a later level or the cost. Within a level, the choice of orders and vehicles minimises the total
    cost. On equal cost, earlier orders keep the cheaper vehicle.
    """
    vehicles = {name for level in levels for costs in level.values() for name in costs}
    if len(vehicles) == 1:
        return _nearest(levels, vehicles.pop())
    search = _Search(levels)
    for level in levels:
        search.add(level)
    return search.found


def _nearest(levels: Sequence[Mapping[int, Costs]], vehicle: str) -> dict[int, str]:
    """Return the order of the first level that the only vehicle can execute at the lowest cost."""
    for level in levels:
        if costs := {order: each[vehicle] for order, each in level.items() if each}:
            return {min(costs, key=costs.__getitem__): vehicle}
    return {}


Place = str | int
"""A vehicle by its name, or an order's number: the order is left out."""


class _Search:
    """A matching that grows by one order at a time and is optimal after each step."""

    def __init__(self, levels: Sequence[Mapping[int, Costs]]) -> None:
        self._left_out = 1 + sum(
            max(costs.values(), default=0) for level in levels for costs in level.values()
        )
        """Cost of leaving out an order of the current level: more than any detour that avoids it."""
        self._costs: dict[int, dict[Place, int]] = {}
        self._order_of: dict[Place, int] = {}
        self._place_of: dict[int, Place] = {}
        self._of_orders: dict[int, int] = {}
        """Potentials: the sum of both potentials of a pair is at most its cost."""
        self._of_places: dict[Place, int] = {}

    @property
    def found(self) -> dict[int, str]:
        """The vehicles by the orders assigned to them."""
        return {order: place for order, place in self._place_of.items() if isinstance(place, str)}

    def add(self, level: Mapping[int, Costs]) -> None:
        """Add the orders of a level; orders left out stay left out, the others stay assigned."""
        for order, costs in level.items():
            self._costs[order] = dict[Place, int](costs.items()) | {order: self._left_out}
            self._of_orders[order] = 0
            self._augment(order)
        for order in level:
            if order in self._order_of:
                del self._order_of[order], self._place_of[order], self._costs[order]
            else:
                del self._costs[order][order]

    def _augment(self, new: int) -> None:
        """Assign the cheapest vehicle to an order; other orders change theirs if that costs less."""
        reached: dict[Place, int] = {}
        by: dict[Place, int] = {}
        heap: list[tuple[int, int, Place]] = []
        settled: dict[Place, None] = {}
        order: int | None = new
        distance = pushed = 0
        while order is not None:
            known = distance - self._of_orders[order]
            for place, cost in self._costs[order].items():
                length = known + cost - self._of_places.get(place, 0)
                if place not in settled and (place not in reached or length < reached[place]):
                    reached[place], by[place] = length, order
                    heappush(heap, (length, pushed, place))
                    pushed += 1
            distance, _, end = heappop(heap)  # there is one: an order that is new can be left out
            while end in settled:
                distance, _, end = heappop(heap)
            settled[end] = None
            order = self._order_of.get(end)
        self._of_orders[new] += distance
        for place in settled:
            change = distance - reached[place]
            self._of_places[place] = self._of_places.get(place, 0) - change
            if (taken_by := self._order_of.get(place)) is not None:
                self._of_orders[taken_by] += change
        while True:
            order = by[end]
            before = self._place_of.get(order)
            self._order_of[end], self._place_of[order] = order, end
            if before is None:
                return
            end = before
