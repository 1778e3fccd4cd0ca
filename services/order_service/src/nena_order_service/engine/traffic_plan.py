"""The traffic plan of the next minute: where vehicles will be when, and where and why they wait."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from itertools import repeat
from math import hypot
from typing import Final

from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import Driving
from nena_order_service.engine.positions import box_of
from nena_order_service.fleet.position import NotLocatedError
from nena_order_service.traffic.forecast import HORIZON, Drive, Forecast, Pace
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.traffic import PlannedPoint, TrafficPlan, VehiclePlan
from nena_shared.plant import MapPlace
from nena_shared.plant.track import MM_PER_M

AT_ONCE: Final = 20
"""Number of vehicles planned before other tasks run; takes a few milliseconds."""

_Plan = Callable[[Sequence[float]], VehiclePlan]


class TrafficPlans:
    """Computes the traffic plan for hosts."""

    def __init__(self, context: Context, driving: Driving) -> None:
        self._context = context
        self._traffic = context.traffic
        self._registry = context.registry
        self._driving = driving
        self._pace = Pace(context.plant)

    async def plan(self, horizon: float = HORIZON) -> TrafficPlan:
        """Return for each vehicle what it holds, its next points with arrival times, and what it waits for.

        Yields to other tasks every few vehicles.
        """
        time, drives, plans = self._context.clock.now(), dict[str, Drive](), list[_Plan]()
        for number, vehicle in enumerate(tuple(self._registry), start=1):
            if vehicle.name in self._traffic:
                drive = drives[vehicle.name] = self._drive(vehicle, horizon)
                plans.append(self._plan(vehicle, drive))
            if number % AT_ONCE == 0:
                await asyncio.sleep(0)
        forecast = Forecast(drives, horizon)
        planned = tuple(plan(forecast.arrivals(name)) for name, plan in zip(drives, plans, strict=True))
        return TrafficPlan(time=time, horizon=horizon, vehicles=planned)

    def _plan(self, vehicle: FleetVehicle, drive: Drive) -> _Plan:
        """Return a function that completes the plan of a vehicle with its arrival times, seconds."""
        name, journey = vehicle.name, self._traffic.route_of(vehicle.name)
        at = self._traffic.point(name)
        starts = (at, *(each.point for each in drive.ahead))
        plan = partial(
            VehiclePlan,
            vehicle=name,
            transport_order=self._order(vehicle),
            at=at,
            holds=tuple(dict.fromkeys(use for each in drive.held for use in each.uses)),
            goal=journey.way[-1].point if journey and journey.way else None,
            wait=self._driving.wait(vehicle),
        )
        ahead = tuple(
            partial(
                PlannedPoint,
                point=each.point,
                path=edge.path.name if (edge := self._pace.edge(start, each)) else None,
                held=index < drive.allocated,
            )
            for index, (start, each) in enumerate(zip(starts, drive.ahead, strict=False))
        )

        def planned(arrivals: Sequence[float]) -> VehiclePlan:
            seconds = [*(round(each, 1) for each in arrivals), *repeat(None, len(ahead) - len(arrivals))]
            return plan(ahead=tuple(each(seconds=at) for each, at in zip(ahead, seconds, strict=True)))

        return planned

    def _order(self, vehicle: FleetVehicle) -> str | None:
        number = self._context.state.sent_orders.order_number(vehicle.key)
        return None if number is None else self._context.state.orders.get(number).name

    def _drive(self, vehicle: FleetVehicle, horizon: float) -> Drive:
        """Return the steps that a vehicle could drive within the horizon, seconds."""
        name = vehicle.name
        journey, held = self._traffic.route_of(name), self._traffic.held(name)
        refusal = self._traffic.refusal(name)
        if journey is None:
            return Drive(held, refusal=refusal)
        at, seconds, in_all = self._traffic.point(name), list[float](), 0.0
        seconds_along = self._pace.of(vehicle.model, self._context.view(vehicle).factsheet)
        allocated = journey.allocated - journey.reached
        for index, each in enumerate(journey.way[journey.reached :]):
            if index >= allocated and in_all > horizon:
                break
            edge = self._pace.edge(at, each)
            length_mm = each.length_mm if index else self._left_mm(vehicle, each)
            seconds.append(seconds_along(edge, length_mm))
            in_all += seconds[-1]
            at = each.point
        ahead = journey.way[journey.reached : journey.reached + len(seconds)]
        return Drive(held, ahead, allocated, tuple(seconds), box_of(vehicle).length_mm, refusal)

    def _left_mm(self, vehicle: FleetVehicle, step: ResourceSet) -> float:
        """Return the remaining length of the path to the next point, mm, by the robot's reported position."""
        try:
            pose = self._context.planner.standing(vehicle, self._context.view(vehicle)).pose
        except NotLocatedError:
            pose = None
        if pose is None:
            return step.length_mm
        here, goal = (
            vehicle.profile.on(pose.map_id).to_plant(MapPlace(pose.x, pose.y)),
            self._context.plant.point(step.point),
        )
        straight_mm = hypot(goal.x_mm - here.x_m * MM_PER_M, goal.y_mm - here.y_m * MM_PER_M)
        return min(float(step.length_mm), straight_mm) if step.length_mm else straight_mm
