"""Recovery: restore the stored state after a restart; the robots' states decide how orders continue."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import ValidationError

from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import RestartGate
from nena_order_service.engine.positions import box_of
from nena_order_service.orders.drive import Drive
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.log import get_logger
from nena_shared.vda5050.malformed import problems_of

log = get_logger(__name__)


class Recovery:
    """Restores what robots hold: their last reported positions, and everything granted since."""

    def __init__(self, context: Context, gate: RestartGate) -> None:
        self._context = context
        self._plant = context.plant
        self._traffic = context.traffic
        self._registry = context.registry
        self._state = context.state
        self._vehicles = context.state.vehicles
        self._gate = gate

    def restore_vehicles(self, relocations: Iterable[str]) -> None:
        """Restore the resources that stored vehicles held, and continue the ``relocations`` (documents)."""
        vehicles = tuple(self._registry.discover(record.robot) for record in self._vehicles)
        # Before the restart, the others drove without regard to vehicles that had held nothing.
        is_first = not any(record.held for record in self._vehicles)
        self._gate.wait_for(
            vehicle
            for vehicle in self._registry
            if is_first or self._vehicles.of(vehicle.key).held
            if self._vehicles.of(vehicle.key).integration_level.holds_resources
        )
        for vehicle in vehicles:
            record = self._vehicles.of(vehicle.key)
            held = [place for place in record.held if place.point in self._plant.points_by_name]
            if held and record.integration_level.holds_resources:
                self._traffic.restore_position(
                    vehicle.name, held, box_of(vehicle).length_mm, beside=record.beside
                )
            self._vehicles.change(vehicle.key)
        for document in relocations:
            if drive := _read_drive(document):
                self._resume_drive(drive)

    def present_vehicle(self, name: str) -> FleetVehicle | None:
        """Return the current vehicle of the robot that had this name; None if it can no longer take orders.

        If the store does not name that robot, return the vehicle of this name, unless it is known to have had
        another name.
        """
        robot = self._vehicles.robot_before(name)
        if robot is not None:
            vehicle = self._registry.discover(robot)
            return None if vehicle.obstacle else vehicle
        named = self._registry.employed(name)
        return named if named and self._vehicles.name_before(named.key) in (None, name) else None

    def present_name(self, name: str) -> str:
        """Return the current name of the vehicle that had this name; unchanged if it no longer exists."""
        vehicle = self.present_vehicle(name)
        return vehicle.name if vehicle else name

    def restore_order(self, order: TransportOrder, document: str) -> FleetVehicle | None:
        """Restore an order's drive; return the vehicle of its robot, None if the drive cannot be read."""
        drive = _read_drive(document)
        if drive is None:
            return None
        self._state.drives.assign(order, drive.robot)
        return self._resume_drive(drive)

    def _resume_drive(self, drive: Drive) -> FleetVehicle:
        self._state.drives.load(drive)
        vehicle = self._registry.discover(drive.robot)
        if vehicle.name not in self._traffic:  # no record says where it stood, so it is where its order began
            start = drive.vda_order.nodes[0].node_id
            under = (
                self._traffic.resources.at_point(start) if start in self._plant.points_by_name else NOWHERE
            )
            self._traffic.restore_position(vehicle.name, [under], box_of(vehicle).length_mm)
        self._traffic.resume_route(vehicle.name, drive.way, drive.allocated)
        self._state.after_commit(
            # 0008: compared with the robot's state, so that nothing is sent under a second ID.
            lambda: self._context.fleet.adopt_vda_order(
                drive.robot, drive.as_released(), accepted=drive.accepted, update_id=drive.update_id
            )
        )
        if drive.cancelled:
            self._state.after_commit(lambda: self._context.fleet.cancel_vda_order(drive.robot))
        return vehicle


NOWHERE = ResourceSet("", 0, {})
"""Placeholder for a robot whose position is unknown: no resources."""


def _read_drive(document: str) -> Drive | None:
    try:
        return Drive.model_validate_json(document)
    except ValidationError as error:
        log.warning("stored drive is unreadable", problems=problems_of(error))
        return None
