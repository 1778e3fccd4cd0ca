"""Small scenes for traffic control: vehicles on a plant of a few words."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from nena_order_service.routing.router import Router, VehicleRoutes
from nena_order_service.traffic.manager import RouteGrant, TrafficManager
from nena_order_service.traffic.relocation import Relocation
from nena_order_service.traffic.resources import ResourceSet
from nena_shared.plant import PlantModel


def routes_over(router: Router) -> VehicleRoutes:
    """Return the routes of vehicles of which the plant says nothing."""
    return VehicleRoutes(router, lambda _: None)


class Scene:
    """A plant, its traffic manager, and vehicles of one length on points of it."""

    def __init__(self, plant: PlantModel, *, length_mm: int = 0, **places: str) -> None:
        self.router = Router(plant)
        self.routes = routes_over(self.router)
        self.manager = TrafficManager(plant, self.routes)
        self.scheduler = self.manager.scheduler
        for name, point in places.items():
            self.scheduler.place_at_rest(name, [self.manager.resources.at_point(point)], length_mm)

    def way(self, vehicle: str, *points: str) -> list[ResourceSet]:
        """Return the sets of a way along ``points``, which follows the last set that the vehicle holds."""
        start = self.scheduler.occupant(vehicle).held[-1]
        ends = [start.point, *points]
        steps = (step for one, other in pairwise(ends) for step in self.router.route(one, other).steps)
        return list(self.manager.resources.along_steps(steps, start=start))

    def claim(self, vehicle: str, *points: str) -> str:
        """Claim a route; return the refusal as text."""
        return str(self.scheduler.claim(vehicle, self.way(vehicle, *points)) or "")

    def allocate(self, vehicle: str) -> str:
        """Allocate the next set; return the refusal as text."""
        if route := self.manager.route_of(vehicle):
            self.manager.allocate(vehicle, self.scheduler.occupant(vehicle).ahead + 1)
            return str(route.refusal or "")
        return str(self.scheduler.allocate(vehicle) or "")

    def drive(self, vehicle: str) -> None:
        """Arrive at the next point that the vehicle holds."""
        if route := self.manager.route_of(vehicle):
            self.manager.note_arrival(vehicle, route.reached + 1)
            return
        self.scheduler.arrive(vehicle, self.scheduler.occupant(vehicle).reached + 1)

    def drive_to_end(self, vehicle: str) -> None:
        """Drive the whole claimed way, which must be free."""
        for _ in tuple(self.scheduler.occupant(vehicle).claimed):
            assert self.allocate(vehicle) == ""
            self.drive(vehicle)
        if self.manager.route_of(vehicle):
            self.manager.finish_route(vehicle)

    def decide(self, *busy: str) -> Iterator[str]:
        """Run traffic control's decisions; yield each grant and relocation as text."""
        for each in self.manager.decide(lambda name: name not in busy):
            assert isinstance(each, RouteGrant | Relocation)
            points = each.route.points if each.route else ()
            yield f"{type(each).__name__} {each.vehicle} {' '.join(points)}"
