"""A fleet that drives as traffic control lets it, event by event, in compressed time."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from heapq import heappop, heappush
from random import Random

from nena_order_service.routing.graph import Route
from nena_order_service.routing.router import Router
from nena_order_service.traffic.traffic_control import RouteRequest, TrafficControl
from nena_shared.plant import PlantModel

SPEED = 1000.0
"""mm/s"""


class CollisionError(AssertionError):
    """Two vehicles are at one place."""


class StandstillError(AssertionError):
    """Nothing can happen any more, and orders are left."""


@dataclass
class SimulatedVehicle:
    """One vehicle: where its body is, and what it still has to do."""

    name: str
    body: list[str]
    """Points and paths that it covers, in the order in which it came to them."""
    lengths: list[float]
    target: deque[str] = field(default_factory=deque)
    """Stations that are left of its order."""
    driving: bool = False
    busy: bool = False
    """It does something where it stands."""


class Simulation:
    """Transport orders of two stations each for a fleet."""

    def __init__(
        self, plant: PlantModel, stations: tuple[str, ...], random: Random, *, orders: int, length_mm: int
    ) -> None:
        self.random = random
        self.router = Router(plant)
        self.plant = plant
        self.length_mm = length_mm
        self.control = TrafficControl(plant, self)
        self.orders = deque(tuple(random.sample(stations, 2)) for _ in range(orders))
        self.finished = 0
        self.evasions = 0
        self.now = 0.0
        self.driven_mm = 0.0
        self._events: list[tuple[float, int, str, str]] = []
        self._count = 0
        self._route = lru_cache(maxsize=10_000)(self._find)
        starts = random.sample([each.name for each in plant.points], len(plant.vehicles))
        self.vehicles = {
            each.name: SimulatedVehicle(each.name, [start], [0.0])
            for each, start in zip(plant.vehicles, starts, strict=True)
        }
        for each in self.vehicles.values():
            self.control.scheduler.place(each.name, [self.control.resources.at(each.body[0])], length_mm)

    def _find(self, start: str, goal: str, avoid: frozenset[str]) -> Route:
        return self.router.route(start, goal, avoid=avoid)

    def route(
        self,
        vehicle: str,
        start: str,
        goal: str,
        *,
        avoid: Collection[str] = frozenset(),
        burden: Mapping[str, float] | None = None,
    ) -> Route:
        del vehicle
        if burden:
            return self.router.route(start, goal, avoid=avoid, burden=burden)
        return self._route(start, goal, frozenset(avoid))

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        del vehicle
        return self.router.costs_from(start)

    def run(self) -> None:
        """Run until every order is finished; raises CollisionError or StandstillError."""
        total = len(self.orders)
        while True:
            self._dispatch()
            self._decide()
            self._drive_on()
            if not self._events:
                break
            self.now, _, name, kind = heappop(self._events)
            getattr(self, f"_{kind}")(self.vehicles[name])
        if self.finished < total:
            raise StandstillError(self._report())

    def _report(self) -> str:
        lines = [f"{self.finished} orders finished at {self.now:.0f} s"]
        for each in self.vehicles.values():
            occupant = self.control.scheduler.occupant(each.name)
            why = self.control.why_waiting(each.name)
            lines.append(f"{each.name} at {occupant.point} target {list(each.target)} {why or ''}")
        return "\n".join(lines)

    def _after(self, seconds: float, vehicle: SimulatedVehicle, kind: str) -> None:
        self._count += 1
        heappush(self._events, (self.now + seconds, self._count, vehicle.name, kind))

    def _dispatch(self) -> None:
        """Give the oldest order to the vehicle that is nearest to its first station."""
        while self.orders:
            free = [
                each
                for each in self.vehicles.values()
                if not each.target and not each.busy and self.control.scheduler.occupant(each.name).resting
            ]
            if not free:
                return
            order = self.orders[0]
            costs = {each.name: self.route("", self._at(each), order[0]).cost for each in free}
            chosen = self.vehicles[min(costs, key=lambda name: (costs[name], name))]
            self.orders.popleft()
            chosen.target.extend(order)
            self._next_target(chosen)

    def _at(self, vehicle: SimulatedVehicle) -> str:
        return self.control.scheduler.occupant(vehicle.name).point

    def _next_target(self, vehicle: SimulatedVehicle) -> None:
        if self._at(vehicle) == vehicle.target[0]:
            self.control.drop(vehicle.name)
            vehicle.busy = True
            self._after(self.random.uniform(2, 20), vehicle, "worked")
        else:
            self.control.request_route(RouteRequest(vehicle.name, vehicle.target[0]))

    def _worked(self, vehicle: SimulatedVehicle) -> None:
        vehicle.busy = False
        vehicle.target.popleft()
        if vehicle.target:
            self._next_target(vehicle)
        else:
            self.finished += 1

    def _decide(self) -> None:
        for each in self.control.decide(lambda name: not self.vehicles[name].busy):
            self.evasions += each.__class__.__name__ == "Evasion"

    def _drive_on(self) -> None:
        for each in self.vehicles.values():
            self._allocate(each)
            occupant = self.control.scheduler.occupant(each.name)
            if occupant.ahead and not each.driving:
                each.driving = True
                step = occupant.held[occupant.reached + 1]
                path = next(name for name in step.uses if name in self.plant.paths_by_name)
                self._cover(each, path, step.length_mm)
                self._after(step.length_mm / SPEED, each, "arrived")

    def _allocate(self, vehicle: SimulatedVehicle) -> None:
        occupant = self.control.scheduler.occupant(vehicle.name)
        while occupant.claimed and occupant.ahead < 2:
            if self.control.scheduler.allocate(vehicle.name):
                return

    def _arrived(self, vehicle: SimulatedVehicle) -> None:
        scheduler = self.control.scheduler
        occupant = scheduler.occupant(vehicle.name)
        vehicle.driving = False
        self._cover(vehicle, occupant.held[occupant.reached + 1].point, 0.0)
        scheduler.arrive(vehicle.name, occupant.reached + 1)
        if occupant.resting and vehicle.target:
            self._next_target(vehicle)

    def _cover(self, vehicle: SimulatedVehicle, place: str, length: float) -> None:
        """Let the vehicle's front come to ``place``, its tail follow, and look who else is there."""
        vehicle.body.append(place)
        vehicle.lengths.append(length)
        self.driven_mm += length
        beginning = length  # of a path that is driven now, none lies behind yet
        while len(vehicle.body) > 1 and sum(vehicle.lengths[1:]) - beginning >= self.length_mm:
            del vehicle.body[0], vehicle.lengths[0]
        for other in self.vehicles.values():
            shared = set(other.body) & set(vehicle.body)
            if other is not vehicle and shared:
                message = f"{vehicle.name} and {other.name} at {sorted(shared)}, {self.now:.1f} s"
                raise CollisionError(message)
