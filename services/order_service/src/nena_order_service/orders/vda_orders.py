"""VDA 5050 orders: built from drive orders, or to make room for others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from pydantic import JsonValue

from nena_order_service.fleet.position import NotLocatedError, RobotProfile, Standing, locate
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.type_rules import TypeRules, make_action
from nena_order_service.fleet.vda_order import (
    DROP,
    PICK,
    OperationMap,
    SpeedLimit,
    VdaOrder,
    build_vda_order,
    order_id,
    unique_id,
    unlimited,
)
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing.graph import NoRouteError, Route, RoutingProfile
from nena_order_service.routing.router import Leg, RouteFinder, RoutePlan
from nena_order_service.traffic.route_search import RouteRequest
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.plant import DirectedEdge, PlantModel, UnknownObjectError
from nena_shared.plant.driver_properties import (
    ACTION_TAGS,
    DESTINATION_ACTION,
    DRIVER_PREFIX,
    ActionTrigger,
    find_actions,
    find_destination_action,
)
from nena_shared.plant.model import RECHARGE_OPERATION
from nena_shared.plant.property_keys import VDA5050_RECHARGE_OPERATION
from nena_shared.plant.track import MM_PER_M
from nena_shared.vda5050.action import LOAD_HANDLING_DEVICE, Action

R = ReasonCode


RELOCATION_PREFIX = "evasion-"
"""Prefix of the IDs of VDA orders that make room for others."""


class Pick(NamedTuple):
    """The load that an order picks up first, before it drops any."""

    load_type: str = ""
    """Empty: unknown."""
    place: str = ""
    """The load handling device for it (parameter lhd); empty: any."""


class OrderPlanner:
    """Builds VDA orders for drive orders, from the plant, its routes and the actions of operations."""

    def __init__(
        self,
        plant: PlantModel,
        finder: RouteFinder,
        operations: OperationMap,
        *,
        speed_limits: bool = True,
        peripherals: bool = False,
    ) -> None:
        """``speed_limits``: whether robots receive them; ``peripherals``: whether devices are used."""
        self.plant = plant
        self._peripherals = peripherals
        self._speed_limits = speed_limits
        self.finder = finder
        self._operations = operations
        self._own_recharging = {
            vehicle.properties[VDA5050_RECHARGE_OPERATION]
            for vehicle in plant.vehicles
            if VDA5050_RECHARGE_OPERATION in vehicle.properties
        }
        self._standings: dict[str, tuple[tuple[object, str], RobotProfile, Standing]] = {}
        """The last position of each vehicle, and the reported place and profile that it was found by."""

    def recharging(self, operation: str) -> bool:
        """Return whether an operation recharges the vehicle."""
        return self._operations.recharges(operation)

    def standing(self, vehicle: FleetVehicle, view: RobotView) -> Standing:
        """Return where a vehicle is; the same object while it stays.

        Raises:
            NotLocatedError: its position is unknown.
        """
        if view.state is None:
            raise NotLocatedError(Reason(R.NO_STATE))
        state, profile = view.state, vehicle.profile
        # Each decision asks for every vehicle, and most of them have not moved.
        place = state.mobile_robot_position, state.last_node_id
        located = self._standings.get(vehicle.name)
        if located is None or located[0] != place or located[1] is not profile:
            located = self._standings[vehicle.name] = place, profile, locate(self.plant, state, profile)
        return located[2]

    def map_id(self, point: str, vehicle: FleetVehicle) -> str:
        """Return the map on which a vehicle is sent to a point."""
        return self.plant.point(point).map_id or vehicle.profile.map_id

    def action_type(self, operation: str) -> str:
        """Return the VDA 5050 action type of an operation; empty for none."""
        return self._operations.action_type(operation)

    def paths(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return those of the names that are paths."""
        return tuple(name for name in names if name in self.plant.paths_by_name)

    def way(
        self,
        order: TransportOrder,
        vehicle: FleetVehicle,
        standing: Standing,
        avoid: frozenset[str] = frozenset(),
    ) -> RoutePlan:
        """Find the route through the remaining destinations, which also avoids ``avoid``.

        Raises:
            NoRouteError: there is none.
        """
        return self.finder.find(
            standing.point,
            [drive_order.destination for drive_order in order.status.drive_orders[order.index :]],
            vehicle=vehicle.model,
            avoid=order.resources_to_avoid | avoid,
        )

    def recharges(self, order: TransportOrder) -> bool:
        """Return whether the next operation of an order recharges the vehicle."""
        operation = order.current.destination.operation
        return operation in self._own_recharging or self._operations.recharges(operation)

    def pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None: nothing, or it drops something before."""
        for drive_order in order.status.drive_orders[order.index :]:
            action_type = self._operations.action_type(drive_order.destination.operation)
            if action_type == PICK:
                texts = {parameter.key: parameter.text for parameter in drive_order.destination.properties}
                place = next((texts[key] for key in LOAD_HANDLING_DEVICE if key in texts), "")
                return Pick(texts.get("loadType", ""), place)
            if action_type == DROP:
                return None  # what it drops frees a place, so a later pick does not tell the room needed
        return None

    def locked_out(self, order: TransportOrder, vehicle: FleetVehicle, standing: Standing) -> Reason | None:
        """Return what a vehicle waits for if only path locks of hosts close its route; else empty."""
        try:
            self.way(order, vehicle, standing)
        except NoRouteError as error:
            closed = self.finder.locks_on_way(
                standing.point,
                [drive_order.destination for drive_order in order.status.drive_orders[order.index :]],
                vehicle.model,
                order.resources_to_avoid,
            )
            return Reason(R.PATH_LOCKED, error.reason, path=closed[0]) if closed else None
        except UnknownObjectError:
            return None
        return None

    def route_request(self, order: TransportOrder, vehicle: FleetVehicle, leg: Leg) -> RouteRequest:
        """Return the vehicle's route request for the current drive order, with the route ``leg``."""
        destination = order.status.drive_orders[order.status.current_drive_order_index].destination
        needed = (
            operation for operation in destination.peripheral_operations if operation.completion_required
        )
        devices = (
            tuple(dict.fromkeys(operation.location for operation in needed)) if self._peripherals else ()
        )
        if destination.coordinate:
            goal = self.finder.nearest_point(destination.coordinate)
            return RouteRequest(vehicle.name, goal, devices, straight_mm=round(leg.cost))
        name = destination.location_name or ""
        location = (name,) if name in self.plant.locations_by_name else ()
        at_goal = (*location, *devices)
        return RouteRequest(vehicle.name, leg.points[-1], at_goal, order.resources_to_avoid)

    def vda_order(
        self,
        order: TransportOrder,
        vehicle: FleetVehicle,
        standing: Standing,
        route: Route | None,
        *,
        retriable: bool = False,
    ) -> VdaOrder:
        """Build the VDA order of the current drive order, along ``route`` or straight to its coordinate.

        With ``retriable``, the robot may retry its actions (VDA 5050 3.0, section 6.6.9).

        Raises:
            ValueError: the route does not start at the vehicle.
        """
        index, destination = order.index, order.current.destination
        rules = TypeRules.of(vehicle.model, self.plant)
        return build_vda_order(
            order_id(order.name, index, order.current.attempts),
            plant=self.plant,
            standing=standing,
            profile=vehicle.profile,
            route=route,
            coordinate=destination.coordinate,
            actions=self._actions(destination, rules, retriable=retriable),
            speed_limit=self._speed_limit(vehicle),
            rules=rules,
        )

    def _actions(self, destination: Destination, rules: TypeRules, *, retriable: bool) -> tuple[Action, ...]:
        """Return the actions at a destination: those of its location, of its operation, and its own."""
        location = self.plant.locations_by_name.get(destination.location_name or "")
        kind = self.plant.location_types_by_name.get(location.type) if location else None
        operation, texts = destination.operation, dict[str, str]()
        parameters: dict[str, JsonValue] = {}
        for each in destination.properties:
            if each.key.startswith(DRIVER_PREFIX):
                texts[each.key.replace(DESTINATION_ACTION, f"{DESTINATION_ACTION}{operation}.", 1)] = (
                    each.text
                )
            else:
                parameters[each.key] = each.value
        properties = location.properties if location else {}
        own = rules.properties.get(VDA5050_RECHARGE_OPERATION)
        planned = None
        if operation != (own or RECHARGE_OPERATION):  # openTCS's driver: recharging has no parameters
            sources = (kind.properties if kind else {}, properties, texts)
            planned = find_destination_action(operation, *sources)
        at_location = rules.demanded_actions(properties, ActionTrigger.ORDER_END, texts.get(ACTION_TAGS))
        return (
            *(make_action(each, unique_id()) for each in at_location),
            *self._operations.actions(
                operation,
                parameters,
                location,
                planned=planned,
                recharges=operation == own,
                retriable=retriable,
            ),
            *(make_action(each, unique_id()) for each in find_actions(texts)),
        )

    def relocation(self, vehicle: FleetVehicle, standing: Standing, route: Route) -> VdaOrder:
        """Build a VDA order by which a vehicle makes room for others."""
        return build_vda_order(
            f"{RELOCATION_PREFIX}{unique_id()}",
            plant=self.plant,
            standing=standing,
            profile=vehicle.profile,
            route=route,
            speed_limit=self._speed_limit(vehicle),
            rules=TypeRules.of(vehicle.model, self.plant),
        )

    def _speed_limit(self, vehicle: FleetVehicle) -> SpeedLimit:
        """Return a vehicle's speed limits by the plant model; defaults do not count."""
        if not self._speed_limits:
            return unlimited
        profile = RoutingProfile.of(vehicle.model, self.plant.vehicle_types)
        # A default of the plant model is nobody's wish, and would slow down faster robots.
        own_fields = vehicle.model.model_fields_set if vehicle.model else ()
        profile = replace(
            profile,
            max_velocity_mm_s=profile.max_velocity_mm_s if "max_velocity_mm_s" in own_fields else None,
            max_reverse_velocity_mm_s=(
                profile.max_reverse_velocity_mm_s if "max_reverse_velocity_mm_s" in own_fields else None
            ),
        )
        own = profile.max_velocity_mm_s

        def limit(edge: DirectedEdge | None) -> float | None:
            speed_mm_s = profile.given_speed_mm_s(edge) if edge else own
            return speed_mm_s / MM_PER_M if speed_mm_s else None

        return limit
