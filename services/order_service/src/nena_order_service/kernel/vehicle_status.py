"""Puts what is known of a vehicle into what hosts are told."""

from __future__ import annotations

from datetime import datetime
from typing import NamedTuple, Self

from nena_order_service.fleet import NotLocatedError, RobotView, locate
from nena_order_service.fleet.robot import ErrorEntry, State
from nena_order_service.vehicles.registry import FleetVehicle, robot_maps
from nena_shared.fleet_api.vehicle import (
    AcceptableOrderType,
    IntegrationLevel,
    PrecisePosition,
    ProcessingState,
    RobotMap,
    VehicleState,
    VehicleStatus,
)
from nena_shared.plant import MapPose, PlantModel


class Essentials(NamedTuple):
    """What is told of a vehicle when it changes; all else changes all the time while a robot drives."""

    state: VehicleState
    processing_state: ProcessingState
    integration_level: IntegrationLevel
    acceptable_order_types: tuple[AcceptableOrderType, ...]
    reason: str
    connection: str
    operating_mode: str | None
    current_position: str | None
    maps: tuple[RobotMap, ...] | None
    transport_order: str | None
    order_sequence: str | None
    errors: tuple[str, ...]

    @classmethod
    def of(cls, status: VehicleStatus) -> Self:
        """Give those of a status."""
        return cls(*(getattr(status, name) for name in cls._fields))


def essentials(
    vehicle: FleetVehicle,
    view: RobotView,
    *,
    plant: PlantModel,
    level: IntegrationLevel,
    order_types: tuple[AcceptableOrderType, ...],
    transport_order: str | None,
    order_sequence: str | None,
    reason: str,
) -> Essentials:
    """Tell what matters of how a vehicle stands."""
    state = view.state
    return Essentials(
        state=view.vehicle_state,
        processing_state=_processing_state(transport_order, order_sequence),
        integration_level=level,
        acceptable_order_types=order_types,
        reason=reason,
        connection=view.link,
        operating_mode=state.operating_mode if state else None,
        current_position=_current_position(vehicle, state, plant) if state else None,
        maps=robot_maps(state) if state else None,
        transport_order=transport_order,
        order_sequence=order_sequence,
        errors=tuple(_in_words(error) for error in state.errors) if state else (),
    )


def vehicle_status(
    vehicle: FleetVehicle, view: RobotView, told: Essentials, last_state: datetime | None
) -> VehicleStatus:
    """Tell how a vehicle stands; positions are in m and rad of the plant's frame."""
    state = view.state
    return VehicleStatus(
        name=vehicle.name,
        manufacturer=vehicle.key.manufacturer,
        serial_number=vehicle.key.serial_number,
        precise_position=_precise_position(vehicle, state) if state else None,
        energy_level=state.power_supply.state_of_charge if state else None,
        last_state=last_state,
        **told._asdict(),
    )


def _processing_state(transport_order: str | None, order_sequence: str | None) -> ProcessingState:
    if transport_order:
        return ProcessingState.PROCESSING_ORDER
    return ProcessingState.AWAITING_ORDER if order_sequence else ProcessingState.IDLE


def _current_position(vehicle: FleetVehicle, state: State, plant: PlantModel) -> str | None:
    if state.last_node_id in plant.points_by_name:
        return state.last_node_id
    try:
        standing = locate(plant, state, vehicle.profile)
    except NotLocatedError:
        return None
    return standing.point if standing.on_point else None


def _precise_position(vehicle: FleetVehicle, state: State) -> PrecisePosition | None:
    position = state.mobile_robot_position
    profile = vehicle.profile
    if position is None or not position.localized or not profile.knows_frame(position.map_id):
        return None
    pose = profile.on(position.map_id).pose_to_plant(MapPose(position.x, position.y, position.theta))
    return PrecisePosition(x=pose.x_m, y=pose.y_m, theta=pose.heading_rad, map_id=position.map_id)


def _in_words(error: ErrorEntry) -> str:
    text = f"{error.error_level} {error.error_type}"
    return f"{text}: {error.error_description}" if error.error_description else text
