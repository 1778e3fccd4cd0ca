"""Makes missions: of a transport order's next drive order, and to make room for others."""

from __future__ import annotations

from nena_order_service.dispatch.way import Leg, Way, WayFinder
from nena_order_service.fleet import (
    Mission,
    OperationMap,
    RobotView,
    Standing,
    build_mission,
    locate,
    mission_id,
)
from nena_order_service.fleet.operations import fresh_id
from nena_order_service.fleet.standing import NotLocatedError
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import Route
from nena_order_service.traffic.traffic_control import Wish
from nena_shared.plant import PlantModel

EVASION_PREFIX = "evasion-"
"""Before what is unique, in the ids of missions that make room for others."""


class MissionPlanner:
    """Knows the plant, its ways and which action an operation stands for."""

    def __init__(self, plant: PlantModel, finder: WayFinder, operations: OperationMap) -> None:
        self._plant = plant
        self._finder = finder
        self._operations = operations

    def standing(self, vehicle: FleetVehicle, view: RobotView) -> Standing:
        """Tell where a vehicle stands; raises NotLocatedError."""
        if view.state is None:
            raise NotLocatedError("it has not told its state yet")
        return locate(self._plant, view.state, vehicle.profile)

    def way(self, order: TransportOrder, vehicle: FleetVehicle, standing: Standing) -> Way:
        """Find the way through the destinations that are not reached yet; raises NoRouteError."""
        first = max(order.status.current_drive_order_index, 0)
        return self._finder.find(
            standing.point,
            [each.destination for each in order.status.drive_orders[first:]],
            vehicle=vehicle.model,
            avoid=order.resources_to_avoid,
        )

    def wish(self, order: TransportOrder, vehicle: FleetVehicle, leg: Leg) -> Wish:
        """Give what a vehicle wants of traffic for the current drive order, whose way is ``leg``."""
        destination = order.status.drive_orders[order.status.current_drive_order_index].destination
        if destination.coordinate:
            goal = self._finder.nearest(destination.coordinate)
            return Wish(vehicle.name, goal, straight_mm=round(leg.cost))
        name = destination.location_name or ""
        location = name if name in self._plant.locations_by_name else None
        return Wish(vehicle.name, leg.points[-1], location, order.resources_to_avoid)

    def mission(
        self,
        order: TransportOrder,
        vehicle: FleetVehicle,
        standing: Standing,
        route: Route | None,
        tries: int = 0,
    ) -> Mission:
        """Make the mission of the current drive order, along ``route`` or straight to its coordinate.

        ``tries`` counts the missions of the same drive order before it.
        """
        index = order.status.current_drive_order_index
        destination = order.status.drive_orders[index].destination
        location = self._plant.locations_by_name.get(destination.location_name or "")
        return build_mission(
            mission_id(order.name, index, tries),
            plant=self._plant,
            standing=standing,
            profile=vehicle.profile,
            route=route,
            coordinate=destination.coordinate,
            actions=self._operations.actions(
                destination.operation, {each.key: each.value for each in destination.properties}, location
            ),
        )

    def evasion(self, vehicle: FleetVehicle, standing: Standing, route: Route) -> Mission:
        """Make a mission that takes a vehicle out of the way of others."""
        return build_mission(
            f"{EVASION_PREFIX}{fresh_id()}",
            plant=self._plant,
            standing=standing,
            profile=vehicle.profile,
            route=route,
        )
