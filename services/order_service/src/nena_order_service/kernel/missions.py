"""Makes the mission of a transport order's next drive order."""

from __future__ import annotations

from nena_order_service.dispatch.way import Way, WayFinder
from nena_order_service.fleet import (
    Mission,
    OperationMap,
    RobotView,
    Standing,
    build_mission,
    locate,
    mission_id,
)
from nena_order_service.fleet.standing import NotLocatedError
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.plant import PlantModel


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

    def mission(self, order: TransportOrder, vehicle: FleetVehicle, standing: Standing, way: Way) -> Mission:
        """Make the mission of the current drive order, which is the first leg of ``way``."""
        index = order.status.current_drive_order_index
        destination = order.status.drive_orders[index].destination
        location = self._plant.locations_by_name.get(destination.location_name or "")
        return build_mission(
            mission_id(order.name, index),
            plant=self._plant,
            standing=standing,
            profile=vehicle.profile,
            route=way.legs[0].route,
            coordinate=destination.coordinate,
            actions=self._operations.actions(
                destination.operation, {each.key: each.value for each in destination.properties}, location
            ),
        )
