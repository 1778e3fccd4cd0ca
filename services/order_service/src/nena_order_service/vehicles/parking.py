"""Parking and recharging positions for vehicles without an order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from math import inf

from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import PlantModel, Point, Vehicle
from nena_shared.plant.property_keys import (
    ASSIGNED_PARKING_POSITION,
    ASSIGNED_RECHARGE_LOCATION,
    PARKING_POSITION_PRIORITY,
    PREFERRED_PARKING_POSITION,
    PREFERRED_RECHARGE_LOCATION,
    VDA5050_RECHARGE_OPERATION,
)
from nena_shared.plant_terms import PointType

R = ReasonCode

WAYS_TRIED = 8
"""Maximum number of positions whose routes are computed for a vehicle; farther ones are hardly better."""


@dataclass(frozen=True, slots=True)
class Prospect:
    """Knowledge about the points where a vehicle could park, and the routes there."""

    cost: Callable[[str], float]
    """Cost of the route to a point; infinity if there is none."""
    taken: Callable[[str], bool]
    """Whether another vehicle is at a point or is going there."""
    displaces: Callable[[str], bool]
    """Whether resting vehicles would have to make room for the drive to a point."""
    may_displace: bool = True
    """Whether others are asked to make room if there is no other route to a position."""

    def why_not(self, point: str) -> Reason | None:
        """Return why the vehicle cannot park at a point; None if it can."""
        if self.taken(point):
            return Reason(R.IS_TAKEN)
        if self.cost(point) == inf:
            return Reason(R.IS_UNREACHABLE)
        return None if self.may_displace or not self.displaces(point) else BARRED


@dataclass(frozen=True, slots=True)
class Parking:
    """Where to park. Without a ``point``, no drive is needed, or ``reason`` explains why none is possible."""

    point: str = ""
    reason: Reason | None = None


PARKED = Parking()
BARRED = Reason(R.IS_BARRED)


class ParkingPositions:
    """The parking positions of one plant."""

    def __init__(self, plant: PlantModel, *, priorities: bool, repark: bool) -> None:
        """With ``priorities``, a position with a smaller number is preferred to a near one.

        With ``repark``, a parked vehicle may move to a better position.
        """
        self._points = plant.points_by_name
        self._priorities = priorities
        self._repark = priorities and repark
        self._positions = {
            point.name: _priority_of(point) for point in plant.points if point.type is PointType.PARK_POSITION
        }

    def choose(self, model: Vehicle | None, here: str | None, prospect: Prospect) -> Parking:
        """Return the best position for a vehicle at the point ``here``; None: the vehicle is on no point."""
        properties = model.properties if model else {}
        if assigned := properties.get(ASSIGNED_PARKING_POSITION):
            # openTCS: a vehicle with an assigned position parks nowhere else.
            return self._assign_position(assigned, here, prospect)
        parked = here in self._positions
        if parked and not self._repark:
            return PARKED
        preferred = properties.get(PREFERRED_PARKING_POSITION, "")
        if not parked and here is not None and here == preferred:
            return PARKED
        if not parked and preferred in self._points and not prospect.why_not(preferred):
            return Parking(preferred)
        reachable = (
            (self._rank_of(name), prospect.cost(name), name)
            for name in self._positions
            if not prospect.taken(name)
        )
        free = sorted(position for position in reachable if position[1] < inf)
        # A parked vehicle moves for a better priority only: for a nearer position it would move for nothing.
        if parked:
            better = _best_position(
                [position for position in free if position[0] < self._rank_of(here or "")], prospect
            )
            return Parking(better[-1]) if better else PARKED
        best = _best_position(free, prospect)
        return Parking(best[-1]) if best else Parking(reason=self._why_none(free))

    def _assign_position(self, point: str, here: str | None, prospect: Prospect) -> Parking:
        if point == here:
            return PARKED
        why_not = prospect.why_not(point) if point in self._points else Reason(R.NO_POINT)
        return Parking(reason=Reason(R.ASSIGNED_PARKING, why_not, point=point)) if why_not else Parking(point)

    def _rank_of(self, name: str) -> float:
        return self._positions.get(name, inf) if self._priorities else 0.0

    def _why_none(self, free: Sequence[_Ranked]) -> Reason:
        if not self._positions:
            return Reason(R.NO_PARKING_POSITIONS)
        if free:
            return Reason(R.PARKING_BARRED)
        return Reason(R.NO_PARKING_FREE)


_Ranked = tuple[float, float, str]
"""A position's rank, the cost of its route, and its name."""


def _best_position(free: Sequence[_Ranked], prospect: Prospect) -> _Ranked | None:
    """Return the first position for which no vehicle has to make room, otherwise the first if allowed."""
    # Whether a vehicle has to make room needs a route search, so only the nearest positions are asked.
    quiet = (position for position in islice(free, WAYS_TRIED) if not prospect.displaces(position[-1]))
    return next(quiet, free[0] if free and prospect.may_displace else None)


def _priority_of(point: Point) -> float:
    """Return the priority of a position; those without one come last."""
    # openTCS: tcs:parkingPositionPriority is a decimal integer, and a smaller one is preferred.
    try:
        return float(int(point.properties[PARKING_POSITION_PRIORITY]))
    except (KeyError, ValueError):
        return inf


@dataclass(frozen=True, slots=True)
class Recharging:
    """Where to recharge, and by which operation. Without a ``location``, ``reason`` explains why."""

    location: str = ""
    operation: str = ""
    reason: Reason | None = None


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
        """``recharges`` returns whether an operation recharges vehicles that name no operation themselves."""
        self._plant = plant
        self._recharges = recharges

    def choose(
        self,
        model: Vehicle | None,
        *,
        cost: Callable[[str], float],
        taken: Callable[[str], bool],
        idly_occupied: Callable[[str], bool] = lambda _point: False,
    ) -> Recharging:
        """Return the best location for a vehicle.

        ``cost`` returns the cost of the route to a point, infinity if there is none. ``taken`` returns
        whether another vehicle is at a point or on its way there, ``idly_occupied`` whether that vehicle need
        not be there: such a location is used if none is free.
        """
        properties = model.properties if model else {}
        assigned = properties.get(ASSIGNED_RECHARGE_LOCATION)
        places = sorted(
            self._recharge_places(model, assigned, cost), key=lambda place: (place.cost, place.point)
        )
        if not places:
            if not assigned:
                return Recharging(reason=Reason(R.NO_RECHARGE_LOCATION))
            why = R.IS_UNREACHABLE if assigned in self._plant.locations_by_name else R.NOT_IN_PLANT
            return Recharging(reason=Reason(R.ASSIGNED_RECHARGE, Reason(why), location=assigned))
        free = [place for place in places if not taken(place.point)]
        preferred_location = properties.get(PREFERRED_RECHARGE_LOCATION)
        preferred = [place for place in free if place.location == preferred_location]
        cleared = [place for place in places if idly_occupied(place.point)]
        if best := (preferred or free or cleared):
            return Recharging(best[0].location, best[0].operation)
        if assigned:
            return Recharging(reason=Reason(R.ASSIGNED_RECHARGE, Reason(R.IS_TAKEN), location=assigned))
        return Recharging(reason=Reason(R.RECHARGE_TAKEN))

    def _recharge_places(
        self, model: Vehicle | None, assigned: str | None, cost: Callable[[str], float]
    ) -> Iterator[_Place]:
        # A vehicle that names its own operation uses no other: those of the settings may not fit its charger.
        own = model.properties.get(VDA5050_RECHARGE_OPERATION) if model else None
        for location in self._plant.locations:
            if location.locked or assigned not in (None, location.name):
                continue
            links = location.links
            possible = chain.from_iterable(self._plant.link_operations(location, link) for link in links)
            suitable = (name for name in possible if (name == own if own else self._recharges(name)))
            for operation in islice(suitable, 1):
                for point in self._plant.access_points(location.name, operation):
                    if (costs := cost(point)) < inf:
                        yield _Place(costs, location.name, operation, point)
