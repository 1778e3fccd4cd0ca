"""Rerouting: replan routes of driving vehicles (openTCS: rerouting).

Routes are replanned on request, after path locks, and for vehicles that wait for others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import Driving
from nena_order_service.errors import NotReroutableError, VehicleNotReachedError
from nena_order_service.fleet.feasibility import fitted_order, order_problem
from nena_order_service.fleet.position import Standing
from nena_order_service.fleet.robot import Abilities, LinkStatus
from nena_order_service.fleet.vda_order import VdaOrder, with_other_horizon
from nena_order_service.orders.drive import Drive
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing.graph import NoRouteError, Route
from nena_order_service.routing.router import Leg
from nena_order_service.traffic.scheduler import Refusal, WaitReason
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode, reason_of
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import ReroutingOutcome, ReroutingType
from nena_shared.log import get_logger
from nena_shared.plant import BACKWARD_SUFFIX, UnknownObjectError
from nena_shared.vda5050.order import Edge

log = get_logger(__name__)

R = ReasonCode

CHOSEN_LATER = Reason(R.CHOSEN_LATER)
NOTHING_AHEAD = Reason(R.NOTHING_AHEAD)
FORCED = Reason(R.FORCED)
REROUTED_PER_CHECK = 20
"""Maximum number of waiting vehicles rerouted in one check; each route search takes milliseconds."""
NO_OTHER_WAY = Reason(R.BEST_ROUTE)


@dataclass(frozen=True, slots=True)
class Rerouted:
    """The result: the outcome, its reason, and the points of the route from the end of the base."""

    outcome: ReroutingOutcome
    reason: Reason
    route: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _UnderWay:
    """A driving vehicle whose VDA order still has a horizon."""

    vehicle: FleetVehicle
    drive: Drive
    order: TransportOrder
    base_end: str


class Rerouting:
    """Replans routes of driving vehicles, in the engine's units of work.

    The robot's base and what it holds never change. A *regular* rerouting replaces the claims beyond the
    base with another route; if traffic control does not grant it, the old one stays. A *forced* one makes the
    robot cancel its order: it keeps everything it holds until it is seen standing, and its transport order
    continues from there.
    """

    def __init__(self, context: Context, driving: Driving) -> None:
        self._plant = context.plant
        self._traffic = context.traffic
        self._state = context.state
        self._orders = context.state.orders
        self._drives = context.state.drives
        self._driving = driving
        self._planner = context.planner
        self._finder = context.finder
        self._registry = context.registry
        self._clock = context.clock
        self._view = context.view
        self._waiting: Mapping[str, int] = {}
        """Vehicles that were waiting at the last check, and how far each had driven."""
        self._last_rerouted: dict[str, tuple[str, int]] = {}
        """By vehicle: the order for which it was last rerouted while waiting, and how far it had driven."""
        self._tried: frozenset[str] = frozenset()
        """Vehicles already checked in the current round."""

    def reroute_on_request(self, vehicle: FleetVehicle, kind: ReroutingType) -> Rerouted:
        """Replan the route of the order that a vehicle works on.

        Raises:
            NotReroutableError: it has no order, or its route must not change.
            VehicleNotReachedError: it has to be stopped and cannot be reached.
        """
        number = self._drives.order_number(vehicle.key)
        if number is None:
            raise NotReroutableError(vehicle.name, "it has no transport order")
        order = self._orders.get(number)
        if order.state is not TransportOrderState.BEING_PROCESSED:
            raise NotReroutableError(vehicle.name, f"its order {order.name!r} is {order.state}")
        drive = self._drives.of_order(order)
        if drive is None:
            return Rerouted(ReroutingOutcome.UNCHANGED, CHOSEN_LATER)
        if drive.cancelled:
            return Rerouted(ReroutingOutcome.STOPPING, Reason.of("it is already stopping"))
        if kind is ReroutingType.REGULAR:
            return self._replan(vehicle, order, drive, Reason(R.BY_REQUEST))
        if order.is_operating:
            raise NotReroutableError(vehicle.name, "it is executing its operation at the destination")
        link = self._view(vehicle).link
        if link is not LinkStatus.ONLINE:
            raise VehicleNotReachedError(vehicle.name, f"it is {link}")
        self._driving.cancel_drive(drive)
        self._orders.put(order.rerouted(None, FORCED, self._clock.now()))
        return Rerouted(ReroutingOutcome.STOPPING, FORCED)

    def reroute_off_locked_paths(self) -> None:
        """Reroute vehicles from paths that are now locked; without another route, they stop before them.

        Those that have not started request their routes again.
        """
        self._driving.request_routes_again(lambda drive: self._any_locked(drive.vda_order.edges))
        for drive in tuple(self._drives.sent.values()):
            horizon = drive.vda_order.edges[drive.allocated :]
            if drive.cancelled or drive.all_released or not self._any_locked(horizon):
                continue
            vehicle = self._registry.discover(drive.robot)
            try:
                self._reroute_or_end(vehicle, drive)
            except ValueError:  # a failure for one vehicle must not let others drive over the path
                log.exception("cannot reroute a vehicle around a locked path", vehicle=vehicle.name)
                self._driving.end_early(drive, partial=True)

    def _reroute_or_end(self, vehicle: FleetVehicle, drive: Drive) -> None:
        """Reroute a vehicle from the end of its base, or end its drive there."""
        order = None if drive.relocation else self._order_driven_for(vehicle)
        if order is None or order.state is not TransportOrderState.BEING_PROCESSED:
            self._driving.end_early(drive, partial=False)
            return
        rerouted = self._replan(vehicle, order, drive, Reason(R.PATH_WAS_LOCKED))
        if rerouted.outcome is ReroutingOutcome.UNCHANGED:
            log.info("vehicle stops before a locked path", vehicle=vehicle.name, reason=str(rerouted.reason))
            self._driving.end_early(drive, partial=True)

    def next_waiting(self) -> Sequence[str]:
        """Return vehicles that have waited since the last call; if there are many, some of them in turn."""
        last_waiting, self._waiting = self._waiting, self._traffic.waiting_at_end()
        waiting = [name for name, reached in self._waiting.items() if last_waiting.get(name) == reached]
        self._tried = self._tried.intersection(waiting)
        if self._tried.issuperset(waiting):
            self._tried = frozenset()
        chosen = [name for name in waiting if name not in self._tried][:REROUTED_PER_CHECK]
        self._tried = self._tried.union(chosen)
        return chosen

    def reroute_waiting(self, name: str) -> None:
        """Reroute a waiting vehicle to a route with less traffic, if traffic control grants one.

        The robot must be able to drive it, and must have made progress since it was last rerouted like this.
        """
        vehicle = self._registry.named(name)
        drive = self._drives.sent.get(vehicle.key) if vehicle else None
        current = self._traffic.route_of(name)
        if not vehicle or not drive or drive.cancelled or drive.relocation or not current:
            return
        order = self._order_driven_for(vehicle)
        base_end = drive.vda_order.nodes[current.allocated].node_id
        if (
            order.state is not TransportOrderState.BEING_PROCESSED
            or current.all_allocated
            or current.allocated > current.released  # it waits for a device, not for traffic
            or base_end not in self._plant.points_by_name
        ):
            return
        # Without progress in between, two vehicles could send each other to and fro forever.
        if self._last_rerouted.get(name) == (drive.order_id, current.reached):
            return
        route = self._traffic.route_around(name, order.resources_to_avoid, self._may_stay_long)
        under_way = _UnderWay(vehicle, drive.released(current), order, base_end)
        if route is None or self._is_current_route(under_way, route):
            return
        if not self._route_problem(under_way, route) and not self._claim_route(under_way, route):
            self._last_rerouted[name] = drive.order_id, current.reached
            self._send_route(under_way, route, Reason(R.LESS_TRAFFIC))

    def _may_stay_long(self, name: str) -> bool:
        """Return whether a vehicle at rest may stay for long: it has no order, or cannot continue it."""
        vehicle = self._registry.named(name)
        has_order = vehicle is not None and self._drives.order_number(vehicle.key) is not None
        return not has_order or self._driving.mobility.is_lost(name)

    def _order_driven_for(self, vehicle: FleetVehicle) -> TransportOrder:
        number = self._drives.order_number(vehicle.key)
        assert number is not None, "a robot with an order's VDA order works on the order"  # noqa: S101 - for the type
        return self._orders.get(number)

    def _replan(self, vehicle: FleetVehicle, order: TransportOrder, drive: Drive, why: Reason) -> Rerouted:
        self._traffic.give_back(vehicle.name)  # what the robot was not sent yet need not bind the new route
        current = self._traffic.route_of(vehicle.name)
        if current is None or drive.all_released or current.all_allocated:
            return Rerouted(ReroutingOutcome.UNCHANGED, NOTHING_AHEAD)
        base_end = drive.vda_order.nodes[current.allocated].node_id
        if base_end not in self._plant.points_by_name:
            return Rerouted(ReroutingOutcome.UNCHANGED, Reason(R.OFF_PATHS))
        under_way = _UnderWay(vehicle, drive.released(current), order, base_end)
        try:
            route = self._claim_best_route(under_way)
        except (NoRouteError, UnknownObjectError) as error:  # the plant may have lost a place
            return Rerouted(ReroutingOutcome.UNCHANGED, reason_of(error))
        if isinstance(route, Reason):
            return Rerouted(ReroutingOutcome.UNCHANGED, route)
        self._send_route(under_way, route, why)
        return Rerouted(ReroutingOutcome.REROUTED, why, route.points)

    def _claim_best_route(self, under_way: _UnderWay) -> Route | Reason:
        """Claim the cheapest other route, or one around vehicles at rest; return it, or why there is none.

        Raises:
            NoRouteError: there is no route at all.
        """
        base_end = Standing(under_way.base_end, on_point=True, pose=None)
        avoid: frozenset[str] = frozenset()
        refusal: Refusal | None = None
        while True:
            try:
                plan = self._planner.way(under_way.order, under_way.vehicle, base_end, avoid=avoid)
            except NoRouteError:
                if refusal is None:
                    raise
                return Reason(R.IT, refusal.in_words())
            route = plan.legs[0].route
            if route is None or self._is_current_route(under_way, route):
                return NO_OTHER_WAY
            if problem := self._route_problem(under_way, route):
                return problem
            is_first, refusal = refusal is None, self._claim_route(under_way, route)
            if refusal is None:
                return route
            # A detour pays around vehicles at rest; those that drive free the way themselves.
            if not is_first or refusal.reason is not WaitReason.RESTING:
                return Reason(R.IT, refusal.in_words())
            held = (resources for name in refusal.vehicles for resources in self._traffic.held_by(name))
            drivable = self._plant.points_by_name.keys() | self._plant.paths_by_name.keys()
            occupied = frozenset(name for resources in held for name in resources.uses if name in drivable)
            avoid = occupied - {under_way.base_end}

    def _claim_route(self, under_way: _UnderWay, route: Route) -> Refusal | None:
        leg = Leg(route.cost, route)
        at_goal = self._planner.route_request(under_way.order, under_way.vehicle, leg).at_goal
        return self._traffic.replace_route(under_way.vehicle.name, route.steps, at_goal)

    def _is_current_route(self, under_way: _UnderWay, route: Route) -> bool:
        """Return whether the vehicle already drives this route, or the route is empty."""
        rest = under_way.drive.vda_order.edges[under_way.drive.allocated :]
        return not route.steps or [edge.edge_id for edge in rest] == [step.edge_id for step in route.steps]

    def _route_problem(self, under_way: _UnderWay, route: Route) -> Reason | None:
        """Return why the robot, by its factsheet, cannot execute the order along another route; or None."""
        factsheet = self._view(under_way.vehicle).factsheet
        if factsheet is None:
            return None
        abilities = Abilities(factsheet)
        return order_problem(fitted_order(self._with_route(under_way, route), abilities), abilities)

    def _with_route(self, under_way: _UnderWay, route: Route) -> VdaOrder:
        """Return the VDA order with this route from the end of its base (section 6.1.2)."""
        drive, standing = under_way.drive, Standing(under_way.base_end, on_point=True, pose=None)
        retriable = any(action.retriable for action in drive.vda_order.actions)
        tail = self._planner.vda_order(
            under_way.order, under_way.vehicle, standing, route, retriable=retriable
        )
        return with_other_horizon(drive.vda_order, drive.allocated, tail)

    def _send_route(self, under_way: _UnderWay, route: Route, why: Reason) -> None:
        vehicle, drive = under_way.vehicle, under_way.drive
        vda_order = self._with_route(under_way, route)
        current = self._traffic.route_of(vehicle.name)
        assert current, "requested by the caller"  # noqa: S101 - for the type
        self._driving.send_update(drive.updated(vda_order=vda_order, way=current.way))
        self._state.drive_due = True
        node_ids = (node.node_id for node in vda_order.nodes)
        points = tuple(point for point in node_ids if point in self._plant.points_by_name)
        self._orders.put(under_way.order.rerouted(points, why, self._clock.now()))
        log.info("vehicle rerouted", vehicle=vehicle.name, reason=str(why), route=route.points)

    def _any_locked(self, edges: Iterable[Edge]) -> bool:
        return any(self._finder.is_locked(edge.edge_id.removesuffix(BACKWARD_SUFFIX)) for edge in edges)
