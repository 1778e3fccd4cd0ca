"""Recovery: takes up after a restart what is in the store; what the robots say decides how it goes on."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import ValidationError

from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.steps import Steps
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import MissionRecord
from nena_order_service.traffic.desk import TrafficDesk
from nena_order_service.traffic.driving import Driving, RestartGate
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.positions import box_of
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.plant import PlantModel


class LostMissionError(Exception):
    """What had been sent to a robot for an order is in the store, but nobody can read it."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """Puts robots back to where they were: each holds what it said last, and all that it was given since."""

    plant: PlantModel
    desk: TrafficDesk
    registry: VehicleRegistry
    vehicles: VehicleBook
    missions: MissionBook
    driving: Driving
    gate: RestartGate
    steps: Steps
    fleet: FleetControl

    def take_up_vehicles(self) -> None:
        """Let the vehicles of the book hold what they held, and go on making room."""
        known = tuple(self.registry.discover(record.robot) for record in self.vehicles)
        self.gate.begin(known)
        for vehicle in known:
            record = self.vehicles.of(vehicle.key)
            held = [each for each in record.held if each.point in self.plant.points_by_name]
            if held and record.integration_level.holds_resources:
                self.desk.restore(vehicle.name, held, box_of(vehicle).length_mm, beside=record.beside)
            if record.evasion:
                self._resume(record.evasion)
            self.vehicles.change(vehicle.key)

    def present_vehicle(self, name: str) -> FleetVehicle | None:
        """Give the vehicle that is now the robot that had this name; None: it has no orders any more.

        Where nobody has noted which robot that was, it is the vehicle of this name, unless that one is known
        to have been called otherwise.
        """
        robot = self.vehicles.robot_before(name)
        if robot is not None:
            vehicle = self.registry.discover(robot)
            return None if vehicle.obstacle else vehicle
        named = self.registry.employed(name)
        return named if named and self.vehicles.name_before(named.key) in (None, name) else None

    def present_name(self, name: str) -> str:
        """Give what the vehicle is called now that had this name; the same where it is none any more."""
        vehicle = self.present_vehicle(name)
        return vehicle.name if vehicle else name

    def take_up_mission(self, order: TransportOrder, document: str) -> FleetVehicle:
        """Take up an order's mission; gives the vehicle that its robot is now. Raises LostMissionError."""
        try:
            record = MissionRecord.model_validate_json(document)
        except ValidationError as error:
            raise LostMissionError from error
        self.missions.assign(order, record.robot)
        return self._resume(record)

    def _resume(self, record: MissionRecord) -> FleetVehicle:
        self.missions.load(record)
        vehicle = self.registry.discover(record.robot)
        if vehicle.name not in self.desk:
            start = record.mission.nodes[0].node_id
            under = self.desk.resources.at(start) if start in self.plant.points_by_name else NOWHERE
            self.desk.restore(vehicle.name, [under], box_of(vehicle).length_mm)
        self.driving.resume(vehicle, record)
        self.steps.after_commit(
            lambda: self.fleet.adopt_mission(
                record.robot, record.as_released(), accepted=record.accepted, update_id=record.update_id
            )
        )
        if record.cancelled:
            self.steps.after_commit(lambda: self.fleet.cancel_mission(record.robot))
        return vehicle


NOWHERE = ResourceSet("", 0, {})
"""What a robot holds of which nothing is known but what it was sent."""
