"""Recharging: where a vehicle that needs energy gets it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf

from nena_shared.plant import Location, PlantModel, Vehicle
from nena_shared.plant.property_keys import (
    ASSIGNED_RECHARGE_LOCATION,
    PREFERRED_RECHARGE_LOCATION,
    VDA5050_RECHARGE_OPERATION,
)


@dataclass(frozen=True, slots=True)
class Recharging:
    """Where to recharge by which operation; without a ``location`` nowhere, and ``reason`` says why."""

    location: str = ""
    operation: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _Place:
    """One way to recharge."""

    cost: float
    location: str
    operation: str
    point: str


class RechargeLocations:
    """The locations of one plant at which vehicles recharge."""

    def __init__(self, plant: PlantModel, recharges: Callable[[str], bool]) -> None:
        """``recharges`` tells of an operation whether it recharges a vehicle that says no other one."""
        self._plant = plant
        self._recharges = recharges

    def choose(
        self,
        model: Vehicle | None,
        *,
        cost: Callable[[str], float],
        taken: Callable[[str], bool],
        held_in_vain: Callable[[str], bool] = lambda _point: False,
    ) -> Recharging:
        """Give the best location for a vehicle.

        ``cost`` is that of the way to a point, infinity where there is none; ``taken`` tells of a point
        whether another vehicle is there or is to come there, ``held_in_vain`` whether that one has no need
        to be there: such a place is taken where none is free.
        """
        properties = model.properties if model else {}
        assigned = properties.get(ASSIGNED_RECHARGE_LOCATION)
        places = sorted(self._places(model, assigned, cost), key=lambda each: (each.cost, each.point))
        if not places:
            return Recharging(reason=_why_none(assigned))
        free = [each for each in places if not taken(each.point)]
        wished = [each for each in free if each.location == properties.get(PREFERRED_RECHARGE_LOCATION)]
        cleared = [each for each in places if held_in_vain(each.point)]
        if found := (wished or free or cleared):
            return Recharging(found[0].location, found[0].operation)
        whose = f"its assigned recharge location {assigned!r}" if assigned else "each recharge location"
        return Recharging(reason=f"{whose} is taken")

    def _places(
        self, model: Vehicle | None, assigned: str | None, cost: Callable[[str], float]
    ) -> Iterator[_Place]:
        for location in self._plant.locations:
            if location.locked or assigned not in (None, location.name):
                continue
            for operation in self._operations(model, location)[:1]:
                for point in self._plant.access_points(location.name, operation):
                    if (costs := cost(point)) < inf:
                        yield _Place(costs, location.name, operation, point)

    def _operations(self, model: Vehicle | None, location: Location) -> Sequence[str]:
        """Give the operations by which the vehicle recharges at a location."""
        own = model.properties.get(VDA5050_RECHARGE_OPERATION) if model else None
        possible = dict.fromkeys(
            operation for link in location.links for operation in self._plant.link_operations(location, link)
        )
        return [each for each in possible if (each == own if own else self._recharges(each))]


def _why_none(assigned: str | None) -> str:
    if assigned is None:
        return "there is no recharge location that it can reach"
    return (
        f"it cannot recharge at its assigned recharge location {assigned!r}: there is none, or no way to it"
    )
