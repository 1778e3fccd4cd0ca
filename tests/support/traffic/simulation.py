"""A fleet that drives as traffic control permits, event by event, in compressed time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from heapq import heappop, heappush
from random import Random

from nena_order_service.routing.router import Router
from nena_order_service.traffic.manager import EarlyEnd, TrafficManager
from nena_order_service.traffic.relocation import Relocation, no_vehicle
from nena_order_service.traffic.route_search import RouteRequest
from nena_shared.plant import PlantModel
from support.traffic.scenes import routes_over

SPEED = 1000.0
"""mm/s"""

PATIENCE = 3600.0
"""Simulated seconds in which an order has to end, or vehicles only drive to and fro."""


ROUNDS = 10
"""Times that traffic decides at most before time goes on; each time others may have to go another way."""


class CollisionError(AssertionError):
    """Two vehicles are at one place."""


class StandstillError(AssertionError):
    """Nothing can happen any more, or nothing comes of it, and orders are left."""


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
        self.routes = routes_over(self.router)
        self.traffic = TrafficManager(plant, self.routes)
        self.scheduler = self.traffic.scheduler
        self.orders = deque(tuple(random.sample(stations, 2)) for _ in range(orders))
        self.finished = 0
        self.finished_at = 0.0
        self.evasions = 0
        self.now = 0.0
        self.speed = SPEED
        self.driven_mm = 0.0
        self._events: list[tuple[float, int, str, str]] = []
        self._count = 0
        starts = random.sample([each.name for each in plant.points], len(plant.vehicles))
        self.vehicles = {
            each.name: SimulatedVehicle(each.name, [start], [0.0])
            for each, start in zip(plant.vehicles, starts, strict=True)
        }
        for each in self.vehicles.values():
            self.traffic.restore_position(
                each.name, [self.traffic.resources.at_point(each.body[0])], length_mm
            )

    def run(self) -> None:
        """Run until every order is finished; raises CollisionError or StandstillError."""
        total = len(self.orders)
        # Robots that stand report states, too, after which traffic decides again.
        while self.now <= self.finished_at + PATIENCE and (self.step() or self.step()):
            pass
        if self.finished < total:
            raise StandstillError(self._report())

    def step(self) -> bool:
        """Let traffic decide, and go on to the next event; return whether there was one."""
        self._dispatch()
        self._decide()
        self._resume_driving()
        if not self._events:
            return False
        self.now, _, name, kind = heappop(self._events)
        getattr(self, f"_{kind}")(self.vehicles[name])
        return True

    def _report(self) -> str:
        lines = [f"{self.finished} orders finished at {self.now:.0f} s"]
        for each in self.vehicles.values():
            why = self.traffic.refusal_of(each.name)
            lines.append(f"{each.name} at {self._at(each)} target {list(each.target)} {why}")
        return "\n".join(lines)

    def _after(self, seconds: float, vehicle: SimulatedVehicle, kind: str) -> None:
        self._count += 1
        heappush(self._events, (self.now + seconds, self._count, vehicle.name, kind))

    def _dispatch(self) -> None:
        """Assign the oldest order to the vehicle that is nearest to its first station."""
        while self.orders:
            free = [
                each
                for each in self.vehicles.values()
                if not each.target and not each.busy and not self.traffic.route_of(each.name)
            ]
            if not free:
                return
            order = self.orders[0]
            costs = {each.name: self.routes.route("", self._at(each), order[0]).cost for each in free}
            chosen = self.vehicles[min(costs, key=lambda name: (costs[name], name))]
            self.orders.popleft()
            chosen.target.extend(order)
            self._next_target(chosen)

    def _at(self, vehicle: SimulatedVehicle) -> str:
        return self.scheduler.occupant(vehicle.name).point

    def _next_target(self, vehicle: SimulatedVehicle) -> None:
        if self._at(vehicle) == vehicle.target[0]:
            self.traffic.drop_request(vehicle.name)
            vehicle.busy = True
            self._after(self.work_seconds(), vehicle, "worked")
        else:
            self.traffic.request_route(RouteRequest(vehicle.name, vehicle.target[0]))

    def work_seconds(self) -> float:
        """Draw how long a vehicle works at a station."""
        return self.random.uniform(2, 20)

    def _worked(self, vehicle: SimulatedVehicle) -> None:
        vehicle.busy = False
        vehicle.target.popleft()
        if vehicle.target:
            self._next_target(vehicle)
        else:
            self.finished += 1
            self.finished_at = self.now

    def _decide(self) -> None:
        for _ in range(ROUNDS):
            decided = list(self.traffic.decide(self._movable))
            self.evasions += sum(isinstance(each, Relocation) for each in decided)
            ending = {each.vehicle for each in decided if isinstance(each, EarlyEnd)}
            ending |= {*self.traffic.stuck_vehicles(self._movable, no_vehicle)}
            for name in ending:
                self._end_way_here(name)
            if not ending:
                return

    def _movable(self, name: str) -> bool:
        return not self.vehicles[name].busy and not self.traffic.route_of(name)

    def _end_way_here(self, name: str) -> None:
        """End a vehicle's route at its base, so that it requests another one."""
        self.traffic.shorten_route(name)
        self._came_to_end(self.vehicles[name])

    def _resume_driving(self) -> None:
        for name, _ in self.traffic.routes_to_extend():
            self.traffic.allocate(name, 2)
        for each in self.vehicles.values():
            occupant = self.scheduler.occupant(each.name)
            if occupant.ahead and not each.driving:
                each.driving = True
                step = occupant.held[occupant.reached + 1]
                path = next(name for name in step.uses if name in self.plant.paths_by_name)
                self._cover(each, path, step.length_mm)
                self._after(step.length_mm / self.speed, each, "arrived")

    def _arrived(self, vehicle: SimulatedVehicle) -> None:
        occupant = self.scheduler.occupant(vehicle.name)
        journey = self.traffic.route_of(vehicle.name)
        assert journey
        vehicle.driving = False
        self._cover(vehicle, occupant.held[occupant.reached + 1].point, 0.0)
        self.traffic.note_arrival(vehicle.name, journey.reached + 1)
        self._came_to_end(vehicle)

    def _came_to_end(self, vehicle: SimulatedVehicle) -> None:
        journey = self.traffic.route_of(vehicle.name)
        if journey and journey.reached == len(journey.way):
            self.traffic.finish_route(vehicle.name)
            if vehicle.target:
                self._next_target(vehicle)

    def _cover(self, vehicle: SimulatedVehicle, place: str, length: float) -> None:
        """Move the vehicle's front to ``place``, its tail after it, and check for others there."""
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
