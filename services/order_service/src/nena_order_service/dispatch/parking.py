"""Parking: where a vehicle that has nothing to do waits without being in the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf

from nena_shared.plant import PlantModel, Point, Vehicle
from nena_shared.plant.point import PointType
from nena_shared.plant.property_keys import (
    ASSIGNED_PARKING_POSITION,
    PARKING_POSITION_PRIORITY,
    PREFERRED_PARKING_POSITION,
)


@dataclass(frozen=True, slots=True)
class Parking:
    """Where to park; without a ``point`` no drive is needed, or ``reason`` says why none is possible."""

    point: str = ""
    reason: str = ""


PARKED = Parking()


class ParkingPositions:
    """The parking positions of one plant."""

    def __init__(self, plant: PlantModel, *, priorities: bool, repark: bool) -> None:
        """By ``priorities`` a position of a smaller number is better than a near one.

        With ``repark`` a vehicle that is parked may go to a better one, too.
        """
        self._points = plant.points_by_name
        self._priorities = priorities
        self._repark = priorities and repark
        self._positions = {
            point.name: _priority(point) for point in plant.points if point.type is PointType.PARK_POSITION
        }

    def choose(
        self,
        model: Vehicle | None,
        here: str | None,
        *,
        cost: Callable[[str], float],
        taken: Callable[[str], bool],
    ) -> Parking:
        """Give the best position for a vehicle that stands at ``here``, None: beside any point.

        ``cost`` is that of the way to a point, infinity where there is none; ``taken`` tells of a point
        whether another vehicle is there or is to come there.
        """
        properties = model.properties if model else {}
        if assigned := properties.get(ASSIGNED_PARKING_POSITION):
            return self._assigned(assigned, here, cost=cost, taken=taken)
        parked = here in self._positions
        if parked and not self._repark:
            return PARKED
        preferred = properties.get(PREFERRED_PARKING_POSITION, "")
        if not parked and here is not None and here == preferred:
            return PARKED
        if not parked and preferred in self._points and not taken(preferred) and cost(preferred) < inf:
            return Parking(preferred)
        best = min(self._free(cost, taken), default=None)
        if parked:
            better = best is not None and best[0] < self._rank(here or "")
            return Parking(best[-1]) if best and better else PARKED
        return Parking(best[-1]) if best else Parking(reason=self._why_none())

    def _assigned(
        self, point: str, here: str | None, *, cost: Callable[[str], float], taken: Callable[[str], bool]
    ) -> Parking:
        if point == here:
            return PARKED
        named = f"its assigned parking position {point!r}"
        if point not in self._points:
            return Parking(reason=f"{named} is no point of the plant model")
        if taken(point):
            return Parking(reason=f"{named} is taken")
        return Parking(point) if cost(point) < inf else Parking(reason=f"no way leads to {named}")

    def _free(
        self, cost: Callable[[str], float], taken: Callable[[str], bool]
    ) -> Iterator[tuple[float, float, str]]:
        for name in self._positions:
            costs = inf if taken(name) else cost(name)
            if costs < inf:
                yield self._rank(name), costs, name

    def _rank(self, name: str) -> float:
        return self._positions.get(name, inf) if self._priorities else 0.0

    def _why_none(self) -> str:
        if not self._positions:
            return "the plant model has no parking positions"
        return "no parking position is free that it can reach"


def _priority(point: Point) -> float:
    """Give the priority of a position; those that have none come last."""
    try:
        return float(int(point.properties[PARKING_POSITION_PRIORITY]))
    except (KeyError, ValueError):
        return inf
