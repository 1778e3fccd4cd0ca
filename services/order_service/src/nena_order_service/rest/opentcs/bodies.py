"""Bodies as openTCS's web API has them, made from and into NeNa's own."""

from __future__ import annotations

from datetime import UTC, datetime
from math import degrees
from typing import Annotated, Any, Self

from pydantic import ConfigDict, Field

from nena_shared.fleet_api.base import CamelCase, Moment
from nena_shared.fleet_api.transport_order import (
    Destination,
    DriveOrderStatus,
    Property,
    TransportOrderRequest,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import AcceptableOrderType, OrderType, PrecisePosition, VehicleStatus
from nena_shared.plant import BoundingBox, Vehicle

MM_PER_M = 1000.0

END_OF_TIME = datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)
"""What openTCS says of an order without a deadline, as near as it can be written."""


class Body(CamelCase):
    """A JSON object; fields that openTCS has and NeNa has not are passed over."""

    model_config = ConfigDict(extra="ignore")


class DestinationRequest(Body):
    """One stop."""

    location_name: Annotated[str, Field(min_length=1, max_length=200)]
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "NOP"
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None


class CreationRequest(Body):
    """Asks for a transport order; its name stands in the path."""

    incomplete_name: bool = False
    deadline: Moment | None = None
    intended_vehicle: str | None = None
    type: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    destinations: Annotated[tuple[DestinationRequest, ...], Field(min_length=1, max_length=100)]
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] | None = None
    dependencies: tuple[str, ...] | None = None
    wrapping_sequence: str | None = None
    dispensable: bool = False
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None

    def request(self, name: str) -> dict[str, Any]:
        """Give the body of NeNa's own request; not yet validated."""
        return {
            "name": name,
            "incompleteName": self.incomplete_name,
            "destinations": [
                Destination(
                    location_name=each.location_name,
                    operation=each.operation,
                    properties=each.properties or (),
                )
                for each in self.destinations
            ],
            "intendedVehicle": self.intended_vehicle,
            "type": self.type or TransportOrderRequest.model_fields["type"].default,
            "deadline": self.deadline,
            "dispensable": self.dispensable,
            "peripheralReservationToken": self.peripheral_reservation_token,
            "properties": self.properties or (),
            "dependencies": self.dependencies or (),
            "wrappingSequence": self.wrapping_sequence,
        }


class AcceptableOrderTypes(Body):
    """The types of orders that a vehicle is to accept."""

    acceptable_order_types: Annotated[tuple[AcceptableOrderType, ...], Field(max_length=100)]


class AllowedOrderTypes(Body):
    """The same without priorities, as openTCS has it up to 6.0."""

    order_types: Annotated[tuple[OrderType, ...], Field(max_length=100)]

    def acceptable(self) -> tuple[AcceptableOrderType, ...]:
        """Give them with one priority for all."""
        return tuple(AcceptableOrderType(name=name) for name in dict.fromkeys(self.order_types))


class DestinationState(Body):
    """One stop as it stands."""

    location_name: str
    operation: str
    state: str
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, drive_order: DriveOrderStatus) -> Self:
        """Tell it of a drive order; a coordinate has no name."""
        destination = drive_order.destination
        return cls(
            location_name=destination.location_name or "",
            operation=destination.operation,
            state=drive_order.state.value,
            properties=destination.properties,
        )


class TransportOrderState(Body):
    """A transport order as it stands."""

    name: str
    type: str
    state: str
    category: str
    intended_vehicle: str | None
    processing_vehicle: str | None
    dispensable: bool
    peripheral_reservation_token: str | None
    wrapping_sequence: str | None
    dependencies: tuple[str, ...]
    creation_time: Moment
    deadline: Moment
    finished_time: Moment | None
    destinations: tuple[DestinationState, ...]
    properties: tuple[Property, ...]

    @classmethod
    def of(cls, order: TransportOrderStatus) -> Self:
        """Tell it of one of NeNa's orders."""
        return cls(
            name=order.name,
            type=order.type,
            category=order.type,
            state=order.state.value,
            intended_vehicle=order.intended_vehicle,
            processing_vehicle=order.processing_vehicle,
            dispensable=order.dispensable,
            wrapping_sequence=order.wrapping_sequence,
            dependencies=order.dependencies,
            peripheral_reservation_token=order.peripheral_reservation_token,
            creation_time=order.created,
            deadline=order.deadline or END_OF_TIME,
            finished_time=order.finished,
            destinations=tuple(DestinationState.of(each) for each in order.drive_orders),
            properties=order.properties,
        )


class Triple(Body):
    """A position in mm."""

    x: int
    y: int
    z: int = 0

    @classmethod
    def of(cls, position: PrecisePosition) -> Self:
        """Give it in whole mm of the plant's frame."""
        return cls(x=round(position.x * MM_PER_M), y=round(position.y * MM_PER_M))


class Size(Body):
    """How large a vehicle is, in mm."""

    length: int
    width: int
    height: int
    reference_offset: dict[str, int]

    @classmethod
    def of(cls, box: BoundingBox) -> Self:
        """Tell it of a vehicle of the plant model."""
        offset = {"x": box.reference_offset_x_mm, "y": box.reference_offset_y_mm}
        return cls(length=box.length_mm, width=box.width_mm, height=box.height_mm, reference_offset=offset)


class VehicleState(Body):
    """A vehicle as it stands."""

    name: str
    properties: dict[str, str]
    length: int
    bounding_box: Size
    energy_level_good: int
    energy_level_critical: int
    energy_level_sufficiently_recharged: int
    energy_level_fully_recharged: int
    energy_level: int
    integration_level: str
    paused: bool = False
    proc_state: str
    transport_order: str | None
    current_position: str | None
    precise_position: Triple | None
    orientation_angle: float | None
    """Degrees."""
    state: str
    allocated_resources: tuple[tuple[str, ...], ...] = ()
    claimed_resources: tuple[tuple[str, ...], ...] = ()
    acceptable_order_types: tuple[AcceptableOrderType, ...]
    allowed_order_types: tuple[str, ...]
    """The same as openTCS has it up to 6.0."""
    envelope_key: str | None = None

    @classmethod
    def of(cls, status: VehicleStatus, model: Vehicle | None) -> Self:
        """Tell it of one of NeNa's vehicles, and what the plant model says of it."""
        model = model or Vehicle(name=status.name)
        position, levels = status.precise_position, model.energy_thresholds
        return cls(
            name=status.name,
            properties=dict(model.properties),
            length=model.bounding_box.length_mm,
            bounding_box=Size.of(model.bounding_box),
            energy_level_good=levels.good,
            energy_level_critical=levels.critical,
            energy_level_sufficiently_recharged=levels.sufficiently_recharged,
            energy_level_fully_recharged=levels.fully_recharged,
            energy_level=round(status.energy_level or 0),
            integration_level=status.integration_level.value,
            proc_state=status.processing_state.value,
            transport_order=status.transport_order,
            current_position=status.current_position,
            precise_position=Triple.of(position) if position else None,
            acceptable_order_types=status.acceptable_order_types,
            allowed_order_types=tuple(each.name for each in status.acceptable_order_types),
            orientation_angle=round(degrees(position.theta), 3) if position else None,
            state=status.state.value,
        )
