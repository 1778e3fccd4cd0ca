"""The status of vehicles for hosts, with the reason why a vehicle has no order."""

from __future__ import annotations

from datetime import datetime, timedelta
from operator import attrgetter
from typing import NamedTuple, Self

from nena_order_service.engine.conditions import Sequences
from nena_order_service.engine.context import Context
from nena_order_service.engine.dispatching import Dispatching
from nena_order_service.engine.driving import Driving
from nena_order_service.engine.idle import IdleVehicles
from nena_order_service.engine.state import VehicleRecord
from nena_order_service.engine.stops import Stops
from nena_order_service.fleet.position import NotLocatedError, locate
from nena_order_service.fleet.robot import RobotView
from nena_order_service.vehicles.registry import FleetVehicle, robot_maps
from nena_shared.fleet_api.reasons import CodedReason, Reason, ReasonCode, explained
from nena_shared.fleet_api.stops import SetBy, VehicleStop
from nena_shared.fleet_api.traffic import TrafficWait
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
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.state import State

R = ReasonCode


class Essentials(NamedTuple):
    """The fields whose changes are published; all others change continuously while a robot drives."""

    state: VehicleState
    processing_state: ProcessingState
    integration_level: IntegrationLevel
    level_set: SetBy | None
    acceptable_order_types: tuple[AcceptableOrderType, ...]
    taken_out: bool
    reason: str
    coded_reason: CodedReason | None
    wait: TrafficWait | None
    stop: VehicleStop | None
    connection: str
    operating_mode: str | None
    active_emergency_stop: str | None
    field_violation: bool
    paused: bool
    localized: bool | None
    current_position: str | None
    maps: tuple[RobotMap, ...] | None
    transport_order: str | None
    order_sequence: str | None
    errors: tuple[str, ...]

    @classmethod
    def of(cls, status: VehicleStatus) -> Self:
        """Return these fields of a status."""
        return cls(*_ESSENTIAL(status))


_ESSENTIAL = attrgetter(*Essentials._fields)


def essentials(
    vehicle: FleetVehicle,
    view: RobotView,
    *,
    plant: PlantModel,
    record: VehicleRecord,
    order_types: tuple[AcceptableOrderType, ...],
    transport_order: str | None,
    order_sequence: str | None,
    reason: Reason,
    wait: TrafficWait | None = None,
    stop: VehicleStop | None = None,
) -> Essentials:
    """Return the essential status of a vehicle."""
    state = view.state
    position = state.mobile_robot_position if state else None
    return Essentials(
        state=view.vehicle_state,
        processing_state=_processing_state(transport_order, order_sequence),
        integration_level=record.integration_level,
        level_set=record.level_set,
        acceptable_order_types=order_types,
        taken_out=bool(record.taken_out),
        **explained(reason),
        wait=wait,
        stop=stop,
        connection=view.link,
        operating_mode=state.operating_mode if state else None,
        active_emergency_stop=state.safety_state.active_emergency_stop if state else None,
        field_violation=state is not None and state.safety_state.field_violation,
        paused=state is not None and bool(state.paused),
        localized=position.localized if position else None,
        current_position=current_position(vehicle, state, plant) if state else None,
        maps=robot_maps(state) if state else None,
        transport_order=transport_order,
        order_sequence=order_sequence,
        errors=tuple(_in_words(error) for error in state.errors) if state else (),
    )


def vehicle_status(
    vehicle: FleetVehicle, view: RobotView, essentials: Essentials, last_state: datetime | None
) -> VehicleStatus:
    """Return the status of a vehicle; its position is in m and rad, in the plant's frame."""
    state = view.state
    return VehicleStatus(
        name=vehicle.name,
        manufacturer=vehicle.key.manufacturer,
        serial_number=vehicle.key.serial_number,
        precise_position=_precise_position(vehicle, state) if state else None,
        energy_level=state.power_supply.state_of_charge if state else None,
        last_state=last_state,
        deviations=tuple(map(str, view.deviations)),
        **essentials._asdict(),
    )


def _processing_state(transport_order: str | None, order_sequence: str | None) -> ProcessingState:
    if transport_order:
        return ProcessingState.PROCESSING_ORDER
    # openTCS: a vehicle that is bound to a sequence awaits its next order, and is not idle.
    return ProcessingState.AWAITING_ORDER if order_sequence else ProcessingState.IDLE


def current_position(vehicle: FleetVehicle, state: State, plant: PlantModel) -> str | None:
    """Return the point at which a vehicle is, or which it has passed last."""
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


class StatusReporter:
    """Builds the status of vehicles, including the reason why a vehicle has no order."""

    def __init__(
        self,
        context: Context,
        driving: Driving,
        dispatching: Dispatching,
        sequences: Sequences,
        idle: IdleVehicles,
        *,
        stops: Stops,
    ) -> None:
        self._context = context
        self._state = context.state
        self._dispatching = dispatching
        self._sequences = sequences
        self._idle = idle
        self._driving = driving
        self._stops = stops

    def status_of(self, name: str) -> VehicleStatus | None:
        """Return the status of the vehicle of this name; None if it does not exist."""
        vehicle = self._context.registry.named(name)
        return self.vehicle_status(vehicle) if vehicle else None

    def vehicle_status(self, vehicle: FleetVehicle) -> VehicleStatus:
        """Return the status of a vehicle."""
        view = self._context.view(vehicle)
        clock, last_state = self._context.clock, None
        if view.state_at is not None:
            # Counted back from now, so that it stays right after the wall clock was set.
            last_state = clock.now() - timedelta(seconds=clock.monotonic() - view.state_at)
        return vehicle_status(vehicle, view, self._essentials(vehicle, view), last_state)

    def essentials(self, vehicle: FleetVehicle) -> Essentials:
        """Return the essential status of a vehicle, which takes a tenth of the time of the full status."""
        return self._essentials(vehicle, self._context.view(vehicle))

    def _essentials(self, vehicle: FleetVehicle, view: RobotView) -> Essentials:
        order = self._state.orders.visible(self._state.drives.order_number(vehicle.key))
        order = order if order and order.vehicle == vehicle.name else None
        return essentials(
            vehicle,
            view,
            plant=self._context.plant,
            record=self._state.vehicles.of(vehicle.key),
            order_types=self._dispatching.fit.order_types(vehicle),
            transport_order=order.name if order else None,
            order_sequence=self._sequences.bound_to(vehicle.name),
            reason=order.reason if order else self._idle_reason(vehicle),
            wait=self._driving.traffic_wait(vehicle)
            if order or self._state.drives.sent.get(vehicle.key)
            else None,
            stop=self._stops.vehicle_stop(vehicle),
        )

    def _idle_reason(self, vehicle: FleetVehicle) -> Reason:
        reason = self._dispatching.idle_reason(vehicle)
        bound = self._sequences.bound_to(vehicle.name)
        awaits = Reason(R.WAITS_FOR_SEQUENCE, sequence=bound) if bound else None
        more = (
            self._driving.positions.why_unprotected(vehicle),
            awaits,
            self._idle.why_not_sent(vehicle),
            self._context.traffic.shared_with(vehicle.name),
        )
        reasons = [*filter(None, (reason, *more))]
        return reasons[0] if len(reasons) == 1 else Reason(R.ALL, *reasons)
