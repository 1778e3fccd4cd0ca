"""Idle vehicles: they recharge, and they park."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import inf

from nena_order_service.dispatching.manager import Candidate, Dispatching
from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.dispatching.way import WayFinder
from nena_order_service.fleet import RobotView
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.orders.automatic import PARK_TYPE, goal_of, park_request, recharge_request
from nena_order_service.traffic.desk import TrafficDesk
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.plant import Location, PlantModel, Point, Vehicle
from nena_shared.plant.property_keys import (
    ASSIGNED_PARKING_POSITION,
    ASSIGNED_RECHARGE_LOCATION,
    PARKING_POSITION_PRIORITY,
    PREFERRED_PARKING_POSITION,
    PREFERRED_RECHARGE_LOCATION,
    VDA5050_RECHARGE_OPERATION,
)
from nena_shared.plant.track import PointType


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


WAYS_TRIED = 8
"""Positions whose ways are looked at for one vehicle; what is farther away is hardly better."""


@dataclass(frozen=True, slots=True)
class Prospect:
    """What a vehicle would find at points where it could park, and on its ways there."""

    cost: Callable[[str], float]
    """Of the way to a point; infinity where there is none."""
    taken: Callable[[str], bool]
    """Whether another vehicle is at a point or is to come there."""
    displaces: Callable[[str], bool]
    """Whether others that rest have to make room for the drive to a point."""
    may_displace: bool = True
    """Whether they are asked to, where there is no other way."""

    def why_not(self, point: str) -> str:
        """Say what keeps the vehicle from parking at a point; empty: nothing."""
        if self.taken(point):
            return "is taken"
        if self.cost(point) == inf:
            return "cannot be reached"
        return "" if self.may_displace or not self.displaces(point) else BARRED


@dataclass(frozen=True, slots=True)
class Parking:
    """Where to park; without a ``point`` no drive is needed, or ``reason`` says why none is possible."""

    point: str = ""
    reason: str = ""


PARKED = Parking()
BARRED = "has others in its way, who have made room often enough"


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

    def choose(self, model: Vehicle | None, here: str | None, prospect: Prospect) -> Parking:
        """Give the best position for a vehicle that stands at ``here``, None: beside any point."""
        properties = model.properties if model else {}
        if assigned := properties.get(ASSIGNED_PARKING_POSITION):
            return self._assigned(assigned, here, prospect)
        parked = here in self._positions
        if parked and not self._repark:
            return PARKED
        preferred = properties.get(PREFERRED_PARKING_POSITION, "")
        if not parked and here is not None and here == preferred:
            return PARKED
        if not parked and preferred in self._points and not prospect.why_not(preferred):
            return Parking(preferred)
        free = sorted(self._free(prospect))
        if parked:
            better = _best([each for each in free if each[0] < self._rank(here or "")], prospect)
            return Parking(better[-1]) if better else PARKED
        best = _best(free, prospect)
        return Parking(best[-1]) if best else Parking(reason=self._why_none(free))

    def _assigned(self, point: str, here: str | None, prospect: Prospect) -> Parking:
        if point == here:
            return PARKED
        named = f"its assigned parking position {point!r}"
        if point not in self._points:
            return Parking(reason=f"{named} is no point of the plant model")
        why_not = prospect.why_not(point)
        return Parking(reason=f"{named} {why_not}") if why_not else Parking(point)

    def _free(self, prospect: Prospect) -> Iterator[_Ranked]:
        for name in self._positions:
            costs = inf if prospect.taken(name) else prospect.cost(name)
            if costs < inf:
                yield self._rank(name), costs, name

    def _rank(self, name: str) -> float:
        return self._positions.get(name, inf) if self._priorities else 0.0

    def _why_none(self, free: Sequence[_Ranked]) -> str:
        if not self._positions:
            return "the plant model has no parking positions"
        if free:
            return f"each free parking position near it {BARRED}"
        return "no parking position is free that it can reach"


_Ranked = tuple[float, float, str]
"""A position's rank, the cost of the way there, and its name."""


def _best(free: Sequence[_Ranked], prospect: Prospect) -> _Ranked | None:
    """Give the first one for which nobody has to make room; where there is none, and they may: the first."""
    quiet = (each for each in islice(free, WAYS_TRIED) if not prospect.displaces(each[-1]))
    return next(quiet, free[0] if free and prospect.may_displace else None)


def _priority(point: Point) -> float:
    """Give the priority of a position; those that have none come last."""
    try:
        return float(int(point.properties[PARKING_POSITION_PRIORITY]))
    except (KeyError, ValueError):
        return inf


PAUSE = 10.0
"""Seconds before a vehicle is sent to do the same once more, so that nobody tries all the time."""

DISPLACES_AT_MOST = 2
"""How often a vehicle has others make room for it to park, until a host has work for it.

They may have to park again then, for which it may have to make room: without an end, two could do that for
good, and somebody who recharges would never come to the end of it.
"""


@dataclass(slots=True)
class _Idle:
    """What is remembered of a vehicle."""

    since: float | None = None
    """When it was first seen with nothing to do; None: it has something."""
    not_before: dict[str, float] = field(default_factory=dict)
    """When it may be sent again, by the type of the order."""
    displaced: int = 0
    """How often others had to make room for it to park since it worked for a host."""
    note: str = ""
    """Why it does not recharge though it should; empty where it need not."""
    parking_note: str = ""
    """Why it does not park though it should."""


@dataclass(frozen=True, slots=True)
class _Round:
    """What is true while the vehicles are looked at once."""

    now: float
    goals: dict[str, str] = field(default_factory=dict)
    """Where vehicles with orders will stand at last, by their names."""


def _has_nothing_to_do(candidate: Candidate) -> bool:
    seen = candidate.seen
    return not (seen.obstacle or seen.gives_up or seen.kept_for is not None)


class IdleVehicles:
    """Makes orders for vehicles that have nothing to do.

    Ask it after all orders that wait were dispatched: what is idle then is idle because nothing suits it.
    """

    def __init__(
        self,
        plant: PlantModel,
        settings: DispatchSettings,
        *,
        recharges: Callable[[str], bool],
        registry: VehicleRegistry,
        book: OrderBook,
        missions: MissionBook,
        dispatching: Dispatching,
        desk: TrafficDesk,
        finder: WayFinder,
        view: Callable[[FleetVehicle], RobotView],
        clock: Clock,
        order: Callable[[TransportOrderRequest], bool],
    ) -> None:
        """``order`` makes an order and tells whether its vehicle has begun it."""
        self._settings = settings
        self._locations = RechargeLocations(plant, recharges)
        parking = settings.parking
        self._positions = ParkingPositions(plant, priorities=parking.priorities, repark=parking.repark)
        self._registry = registry
        self._book = book
        self._missions = missions
        self._dispatching = dispatching
        self._desk = desk
        self._finder = finder
        self._view = view
        self._clock = clock
        self._order = order
        self._idle: dict[str, _Idle] = {}

    def attend(self) -> None:
        """Send those to recharge who need it, and those to park who are in the way."""
        if not (self._settings.recharging.enabled or self._settings.parking.enabled):
            return
        round_ = _Round(self._clock.monotonic(), self._goals())
        for vehicle in self._registry:
            candidate = self._dispatching.consider(vehicle)
            known = self._idle.setdefault(vehicle.name, _Idle())
            if not _has_nothing_to_do(candidate):
                known.since, known.note, known.parking_note = None, "", ""
                if self._works_for_a_host(vehicle):
                    known.displaced = 0
                continue
            if known.since is None:
                known.since = round_.now
            self._attend(candidate, known, round_)

    def note(self, vehicle: FleetVehicle) -> str:
        """Say why an idle vehicle neither recharges nor parks though it should; empty where it need not."""
        known = self._idle.get(vehicle.name)
        return "; ".join(filter(None, (known.note, known.parking_note))) if known else ""

    def _attend(self, candidate: Candidate, known: _Idle, round_: _Round) -> None:
        vehicle, known.note = candidate.vehicle, ""
        energy = self._dispatching.energy(vehicle, self._view(vehicle))
        if energy and energy.charging:
            return
        bound, request = self._dispatching.is_bound(vehicle), None
        wants_energy = energy and (energy.critical if bound else energy.degraded)
        if self._settings.recharging.enabled and energy and wants_energy:
            request = self._recharging(candidate, known, round_, urgent=energy.critical)
        if request is not None or bound or not self._is_to_park(candidate, known, round_):
            known.parking_note = ""
        elif round_.now >= known.not_before.get(PARK_TYPE, 0.0):
            request = self._parking(candidate, known, round_)
        if request and round_.now >= known.not_before.get(request.type, 0.0):
            known.not_before[request.type] = round_.now + PAUSE
            displaces = request.type == PARK_TYPE and self._displaces(vehicle, goal_of(request))
            if self._order(request):
                known.since = None
                known.displaced += displaces
                round_.goals.update(self._goals())

    def _works_for_a_host(self, vehicle: FleetVehicle) -> bool:
        number = self._missions.order_number(vehicle.key)
        order = None if number is None else self._book.at_hand(number)
        return order is not None and not order.status.automatic

    def _recharging(
        self, candidate: Candidate, known: _Idle, round_: _Round, *, urgent: bool
    ) -> TransportOrderRequest | None:
        vehicle = candidate.vehicle
        found = self._locations.choose(
            vehicle.model,
            cost=self._cost(candidate),
            taken=lambda point: self._is_taken(point, vehicle, round_),
            held_in_vain=lambda point: urgent and self._is_held_in_vain(point, vehicle, round_),
        )
        if not found.location:
            known.note = f"it should recharge, but {found.reason}"
            return None
        return recharge_request(vehicle.name, found.location, found.operation, dispensable=not urgent)

    def _is_to_park(self, candidate: Candidate, known: _Idle, round_: _Round) -> bool:
        parking = self._settings.parking
        since = round_.now if known.since is None else known.since
        return parking.enabled and not candidate.seen.restriction and round_.now - since >= parking.delay

    def _parking(self, candidate: Candidate, known: _Idle, round_: _Round) -> TransportOrderRequest | None:
        vehicle, standing = candidate.vehicle, candidate.standing
        assert standing, "who has no obstacle stands somewhere"  # noqa: S101 - for the type
        found = self._positions.choose(
            vehicle.model,
            standing.point if standing.on_point else None,
            Prospect(
                cost=self._cost(candidate),
                taken=lambda point: self._is_taken(point, vehicle, round_),
                displaces=lambda point: self._displaces(vehicle, point),
                may_displace=known.displaced < DISPLACES_AT_MOST,
            ),
        )
        known.parking_note = f"it should park, but {found.reason}" if found.reason else ""
        if found.reason:  # to find that out may take many looks at ways
            known.not_before[PARK_TYPE] = round_.now + PAUSE
        return park_request(vehicle.name, found.point) if found.point else None

    def _cost(self, candidate: Candidate) -> Callable[[str], float]:
        """Give what it costs a vehicle to reach points."""
        model, standing = candidate.vehicle.model, candidate.standing
        assert standing, "who has no obstacle stands somewhere"  # noqa: S101 - for the type
        return lambda point: self._finder.costs_to(point, vehicle=model).source(standing.point)

    def _displaces(self, vehicle: FleetVehicle, point: str) -> bool:
        return vehicle.name in self._desk and self._desk.displaces(vehicle.name, point)

    def _goals(self) -> dict[str, str]:
        goals = {}
        for vehicle in self._registry:
            number = self._missions.order_number(vehicle.key)
            order = None if number is None else self._book.at_hand(number)
            if order and (route := order.status.drive_orders[-1].route):
                goals[vehicle.name] = route[-1]
        return goals

    def _is_taken(self, point: str, vehicle: FleetVehicle, round_: _Round) -> bool:
        """Tell whether another vehicle is at a point, passes it now or is to come there."""
        return bool(self._users(point, vehicle, round_))

    def _users(self, point: str, vehicle: FleetVehicle, round_: _Round) -> set[str]:
        coming = {name for name, goal in round_.goals.items() if goal == point}
        return {*self._desk.users(point), *coming} - {vehicle.name}

    def _is_held_in_vain(self, point: str, vehicle: FleetVehicle, round_: _Round) -> bool:
        """Tell whether all who are at a point have energy enough and nothing to do."""
        others = (self._registry.named(name) for name in self._users(point, vehicle, round_))
        seen = (self._dispatching.consider(each).seen for each in others if each)
        return all(not (each.obstacle or each.restriction or each.gives_up) for each in seen)
