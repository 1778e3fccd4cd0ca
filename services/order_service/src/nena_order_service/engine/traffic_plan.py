"""The traffic plan of the next minute: where vehicles will be when, and where and why they wait."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from math import hypot

from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import Driving
from nena_order_service.engine.positions import box_of
from nena_order_service.fleet.position import NotLocatedError
from nena_order_service.traffic.forecast import HORIZON, ExpectedDrive, Forecast, Pace
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.traffic import PlannedPoint, TrafficPlan, VehiclePlan
from nena_shared.plant import MapPlace
from nena_shared.plant.track import MM_PER_M


class TrafficPlans:
    """Computes the traffic plan for hosts."""

    def __init__(self, context: Context, driving: Driving) -> None:
        self._context = context
        self._traffic = context.traffic
        self._registry = context.registry
        self._driving = driving
        self._pace = Pace(context.plant)

    def current_plan(self) -> TrafficPlan:
        """Return what each vehicle holds, its next points with arrival times, and what it waits for."""
        located = [vehicle for vehicle in self._registry if vehicle.name in self._traffic]
        drives = {vehicle.name: self._expected_drive(vehicle) for vehicle in located}
        forecast = Forecast(drives, HORIZON)
        plans = (
            self._vehicle_plan(vehicle, drives[vehicle.name], forecast.arrivals(vehicle.name))
            for vehicle in located
        )
        return TrafficPlan(time=self._context.clock.now(), horizon=HORIZON, vehicles=tuple(plans))

    def _vehicle_plan(
        self, vehicle: FleetVehicle, drive: ExpectedDrive, arrivals: Sequence[float]
    ) -> VehiclePlan:
        """Return the plan of a vehicle that arrives at its next points after so many seconds."""
        route, at = self._traffic.route_of(vehicle.name), self._traffic.scheduler.occupant(vehicle.name).point
        ahead: list[PlannedPoint] = []
        start, order = at, self._context.state.order_of(vehicle.key)
        for index, (step, seconds) in enumerate(zip_longest(drive.ahead, arrivals)):
            edge = self._pace.edge_to(start, step)
            ahead.append(
                PlannedPoint(
                    point=step.point,
                    path=edge.path.name if edge else None,
                    held=index < drive.allocated,
                    seconds=None if seconds is None else round(seconds, 1),
                )
            )
            start = step.point
        return VehiclePlan(
            vehicle=vehicle.name,
            transport_order=order.name if order else None,
            at=at,
            holds=tuple(dict.fromkeys(use for held in drive.held for use in held.uses)),
            ahead=tuple(ahead),
            goal=route.way[-1].point if route and route.way else None,
            wait=self._driving.traffic_wait(vehicle),
        )

    def _expected_drive(self, vehicle: FleetVehicle) -> ExpectedDrive:
        """Return the steps that a vehicle could drive within :data:`HORIZON`, and those that it holds."""
        name = vehicle.name
        route, held = self._traffic.route_of(name), self._traffic.held_by(name)
        refusal = self._traffic.refusal_of(name)
        if route is None:
            return ExpectedDrive(held, refusal=refusal)
        at, seconds, in_all = self._traffic.scheduler.occupant(name).point, list[float](), 0.0
        seconds_along = self._pace.travel_time_for(vehicle.model, self._context.view(vehicle).factsheet)
        allocated = route.allocated - route.reached
        for index, step in enumerate(route.way[route.reached :]):
            if index >= allocated and in_all > HORIZON:
                break
            edge = self._pace.edge_to(at, step)
            # Of the first path, only what is left counts: a robot may be in the middle of 50 m.
            length_mm = step.length_mm if index else self._left_mm(vehicle, step)
            seconds.append(seconds_along(edge, length_mm))
            in_all += seconds[-1]
            at = step.point
        ahead = route.way[route.reached : route.reached + len(seconds)]
        length_mm = box_of(vehicle, self._context.view(vehicle).state).length_mm
        return ExpectedDrive(held, ahead, allocated, tuple(seconds), length_mm, refusal)

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
