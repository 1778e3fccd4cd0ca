"""Forecast of when driving vehicles arrive at their points.

It starts from the current state of traffic control, which it does not change: each vehicle drives its route
at the speeds of its paths, and enters a resource that another vehicle holds once that one has left it.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import chain
from typing import Final

from nena_order_service.routing.graph import RoutingProfile
from nena_order_service.traffic.resources import ResourceSet, UseIndex, covered_from
from nena_order_service.traffic.scheduler import Refusal, WaitReason
from nena_shared.plant import DirectedEdge, PlantModel, Vehicle
from nena_shared.plant.track import MM_PER_M
from nena_shared.vda5050.factsheet import Factsheet

HORIZON: Final = 60.0
"""How far the plan looks ahead, seconds."""


@dataclass(frozen=True, slots=True)
class ExpectedDrive:
    """The near future of a vehicle: the sets that it holds, and those ahead of it.

    The first ``allocated`` sets ``ahead`` are among the held ones. ``seconds`` has the travel time to each
    set ahead.
    """

    held: tuple[ResourceSet, ...]
    ahead: tuple[ResourceSet, ...] = ()
    allocated: int = 0
    seconds: tuple[float, ...] = ()
    length_mm: int = 1
    refusal: Refusal | None = None


@dataclass(slots=True)
class _Course:
    """One vehicle in the forecast."""

    drive: ExpectedDrive
    held: deque[ResourceSet]
    reached: int = 0
    """Number of sets ahead that it has reached."""
    arrivals: list[float] = field(default_factory=list)


class Forecast:
    """Drives vehicles along their routes, in forecast time only."""

    def __init__(self, drives: Mapping[str, ExpectedDrive], horizon: float = HORIZON) -> None:
        self._holds = UseIndex()
        self._arrivals: list[tuple[float, str]] = []
        self._standing: set[str] = set()
        self._waiting: defaultdict[str, list[str]] = defaultdict(list)
        """By resource: the vehicles that may be able to continue once it is free."""
        self._courses: dict[str, _Course] = {}
        for name, drive in drives.items():
            self._courses[name] = _Course(drive, deque(drive.held))
            for resource_set in drive.held:
                self._holds.add(name, resource_set.uses)
        for name in drives:
            self._start_or_wait(name, 0.0)
        while self._arrivals and self._arrivals[0][0] <= horizon:
            now, name = heappop(self._arrivals)
            freed = self._reach_next_set(name, now)
            self._start_or_wait(name, now)
            for waiting in dict.fromkeys(chain.from_iterable(self._waiting.pop(use, ()) for use in freed)):
                if waiting in self._standing:
                    self._start_or_wait(waiting, now)

    def arrivals(self, vehicle: str) -> tuple[float, ...]:
        """Return the seconds until a vehicle arrives at each set ahead, as far as they are known."""
        return tuple(self._courses[vehicle].arrivals)

    def _reach_next_set(self, name: str, now: float) -> list[str]:
        """Move a vehicle to its next set; return the resources that it has left."""
        course = self._courses[name]
        course.arrivals.append(now)
        course.reached += 1
        at = len(course.held) - 1 - max(course.drive.allocated - course.reached, 0)
        gone = [course.held.popleft() for _ in range(covered_from(course.held, at, course.drive.length_mm))]
        return [use for resource_set in gone for use in self._holds.remove(name, resource_set.uses)]

    def _start_or_wait(self, name: str, now: float) -> None:
        """Start a vehicle's drive to its next set, or let it wait until what blocks it has changed."""
        course = self._courses[name]
        drive, index = course.drive, course.reached
        self._standing.discard(name)
        if index == len(drive.ahead):
            return
        following = drive.ahead[index]
        if index >= drive.allocated:
            if self._is_kept(course, name, following):
                self._standing.add(name)
                for use in (*following.uses, *((drive.refusal.resource,) if drive.refusal else ())):
                    self._waiting[use].append(name)
                return
            self._holds.add(name, following.uses)
            course.held.append(following)
        heappush(self._arrivals, (now + drive.seconds[index], name))

    def _is_kept(self, course: _Course, name: str, following: ResourceSet) -> bool:
        if any(self._holds.other_users(name, following.uses)):
            return True
        refusal = course.drive.refusal
        if not refusal or refusal.reason is not WaitReason.ORDER or course.reached > course.drive.allocated:
            return False
        # The order of claims only matters until the first vehicle has passed the resource.
        courses = (self._courses[vehicle] for vehicle in refusal.vehicles if vehicle in self._courses)
        return any(
            refusal.resource in resource_set.uses
            for first in courses
            for resource_set in (*first.held, *first.drive.ahead[first.reached :])
        )


UNKNOWN_SPEED_MM_S: Final = 1000
"""Speed of vehicles that define none, mm/s."""


class Pace:
    """Travel times of vehicles on the paths of one plant, at the maximum speed that both allow."""

    def __init__(self, plant: PlantModel) -> None:
        self._known_types = plant.vehicle_types
        self._edges: defaultdict[tuple[str, str], list[DirectedEdge]] = defaultdict(list)
        for path in plant.paths:
            for edge in path.edges():
                self._edges[edge.source, edge.destination].append(edge)

    def edge_to(self, start: str, step: ResourceSet) -> DirectedEdge | None:
        """Return the edge that leads to a set; None if the vehicle drives there straight, off the paths."""
        edges = self._edges.get((start, step.point), ())
        return next((edge for edge in edges if edge.path.name in step.uses), edges[0] if edges else None)

    def travel_time_for(
        self, vehicle: Vehicle | None, robot: Factsheet | None
    ) -> Callable[[DirectedEdge | None, float], float]:
        """Return a function that computes the seconds for a distance (mm) on an edge.

        ``robot`` is the robot's factsheet.
        """
        own = vehicle.max_velocity_mm_s if vehicle else 0
        by_robot = robot.physical_parameters.maximum_speed * MM_PER_M if robot else 0.0
        profile = RoutingProfile.of(vehicle, self._known_types)

        def seconds(edge: DirectedEdge | None, length_mm: float) -> float:
            by_plant = profile.speed_mm_s(edge) if edge else own
            speeds = [speed for speed in (by_plant, by_robot) if speed > 0]
            return length_mm / min(speeds, default=UNKNOWN_SPEED_MM_S)

        return seconds
