"""Messages of a small fleet, as robots and the order service send them."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from typing import Any

from nena_demo.plants import sample_plant_path
from nena_plant_formats.opentcs_xml import read
from nena_shared.fleet_api.peripherals import (
    PeripheralJobState,
    PeripheralJobStatus,
    PeripheralState,
    PeripheralStatus,
)
from nena_shared.fleet_api.transport_order import (
    Destination,
    DriveOrderState,
    DriveOrderStatus,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus
from nena_shared.plant.model import PlantModel
from nena_shared.plant_terms import ExecutionTrigger
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet, MobileRobotAction
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.visualization import Visualization
from nena_status_aggregator.fleet.robot import Timestamp

START = datetime(2026, 1, 1, tzinfo=UTC)
ROBOT = RobotKey("ACME", "r1")


def header(number: int = 1, *, robot: RobotKey = ROBOT, at: float = 0.0) -> dict[str, Any]:
    """Return the header of message ``number``, sent ``at`` seconds after the start."""
    return {
        "header_id": number,
        "timestamp": START + timedelta(seconds=at),
        "version": "2.1.0",
        "manufacturer": robot.manufacturer,
        "serial_number": robot.serial_number,
    }


def connection(
    state: str = "ONLINE", number: int = 1, *, robot: RobotKey = ROBOT, at: float = 0.0
) -> Connection:
    """Return a connection message."""
    return Connection(connection_state=ConnectionState(state), **header(number, robot=robot, at=at))


def state(number: int = 1, *, robot: RobotKey = ROBOT, at: float = 0.0, **fields: Any) -> State:
    """Return the state of an idle robot, changed by ``fields`` (in snake case)."""
    content = {
        **header(number, robot=robot, at=at),
        "order_id": "",
        "order_update_id": 0,
        "last_node_id": "",
        "last_node_sequence_id": 0,
        "node_states": (),
        "edge_states": (),
        "driving": False,
        "action_states": (),
        "instant_action_states": (),
        "power_supply": {"state_of_charge": 80.0, "charging": False},
        "operating_mode": "AUTOMATIC",
        "errors": (),
        "safety_state": {"active_emergency_stop": "NONE", "field_violation": False},
        **fields,
    }
    return State.model_validate(content, strict=False)


def position(x: float, y: float, theta: float = 0.0, *, localized: bool = True) -> dict[str, Any]:
    """Return a position on the sample plant's map."""
    return {"x": x, "y": y, "theta": theta, "map_id": "hall", "localized": localized}


def way(*node_ids: str, first: int = 2, released: int | None = None) -> dict[str, Any]:
    """Return the node and edge states of a route through ``node_ids``; ``first``: sequenceId of the first."""
    base = len(node_ids) if released is None else released
    nodes = [
        {"node_id": name, "sequence_id": first + 2 * at, "released": at < base}
        for at, name in enumerate(node_ids)
    ]
    edges = [
        {"edge_id": f"to {name}", "sequence_id": first - 1 + 2 * at, "released": at < base}
        for at, name in enumerate(node_ids)
        if first + at > 0
    ]
    return {"node_states": tuple(nodes), "edge_states": tuple(edges)}


def visualization(
    number: int = 1, *, robot: RobotKey = ROBOT, at: float = 0.0, x: float = 0.0, y: float = 0.0
) -> Visualization:
    """Return a visualization."""
    return Visualization.model_validate(
        {
            **header(number, robot=robot, at=at),
            "reference_state_header_id": 0,
            "mobile_robot_position": position(x, y),
        },
        strict=False,
    )


def factsheet(
    number: int = 1,
    *,
    robot: RobotKey = ROBOT,
    at: float = 0.0,
    version: str = "2.1.0",
    state_interval: float | None = None,
    order_interval: float = 0.1,
    actions: Iterable[MobileRobotAction] = (),
    takes: Iterable[str] = (),
    demands: Iterable[str] = (),
    arrays: dict[str, int] | None = None,
    strings: dict[str, Any] | None = None,
) -> Factsheet:
    """Return the factsheet of a small carrier, which ``takes`` and ``demands`` optional fields of orders."""
    fields = [
        *({"parameter": each, "support": "SUPPORTED"} for each in takes),
        *({"parameter": each, "support": "REQUIRED"} for each in demands),
    ]
    return Factsheet.model_validate(
        {
            **header(number, robot=robot, at=at),
            "version": version,
            "type_specification": {
                "series_name": "Carrier 100",
                "mobile_robot_kinematics": "DIFFERENTIAL",
                "mobile_robot_class": "CARRIER",
                "maximum_load_mass": 100.0,
                "localization_types": ("NATURAL",),
                "navigation_types": ("FREELY_NAVIGATING",),
            },
            "physical_parameters": {
                "minimum_speed": 0.0,
                "maximum_speed": 1.2,
                "maximum_acceleration": 1.0,
                "maximum_deceleration": 1.0,
                "minimum_height": 0.4,
                "maximum_height": 0.4,
                "width": 0.7,
                "length": 1.1,
            },
            "protocol_limits": {
                "maximum_string_lengths": strings or {},
                "maximum_array_lengths": arrays or {},
                "timing": {
                    "minimum_order_interval": order_interval,
                    "minimum_state_interval": 0.1,
                    "default_state_interval": state_interval,
                },
            },
            "protocol_features": {
                "optional_parameters": tuple(fields),
                "mobile_robot_actions": tuple(actions),
            },
            "mobile_robot_geometry": {},
            "load_specification": {},
        },
        strict=False,
    )


def vehicle_status(name: str = "Vehicle-1", *, robot: RobotKey = ROBOT, **fields: Any) -> VehicleStatus:
    """Return the order service's status of an idle vehicle, changed by ``fields``."""
    content: dict[str, Any] = {
        "name": name,
        "manufacturer": robot.manufacturer,
        "serial_number": robot.serial_number,
        "state": VehicleState.IDLE,
        "processing_state": ProcessingState.IDLE,
        "reason": "No order waits for it.",
        "connection": "ONLINE",
        **fields,
    }
    return VehicleStatus(**content)


def order_status(
    name: str = "TO-1",
    version: int = 1,
    state: TransportOrderState = TransportOrderState.BEING_PROCESSED,
    **fields: Any,
) -> TransportOrderStatus:
    """Return the status of an order on its way to the first of two destinations, changed by ``fields``."""
    content: dict[str, Any] = {
        "name": name,
        "version": version,
        "state": state,
        "reason": "Vehicle-1 drives to Goods in.",
        "type": "-",
        "priority": 0,
        "intended_vehicle": None,
        "processing_vehicle": "Vehicle-1",
        "drive_orders": (
            drive_order("Goods in", "Load", DriveOrderState.TRAVELLING, ("A", "B", "C", "D", "E")),
            drive_order("Packing", "Unload", DriveOrderState.PRISTINE),
        ),
        "current_drive_order_index": 0,
        "created": START,
        **fields,
    }
    return TransportOrderStatus(**content)


def peripheral_job(
    operation: str = "open",
    state: PeripheralJobState = PeripheralJobState.BEING_PROCESSED,
    **fields: Any,
) -> PeripheralJobStatus:
    """Return the status of a peripheral job, changed by ``fields``."""
    content: dict[str, Any] = {
        "name": f"PeripheralJob-{operation}",
        "state": state,
        "location": "Door 1",
        "operation": operation,
        "execution_trigger": ExecutionTrigger.AFTER_ALLOCATION,
        "completion_required": True,
        "reservation_token": "token",
        "created": START,
        "finished": START if state.final else None,
        **fields,
    }
    return PeripheralJobStatus(**content)


def peripheral_status(
    location: str = "Door 1",
    state: PeripheralState = PeripheralState.IDLE,
    *jobs: PeripheralJobStatus,
    **fields: Any,
) -> PeripheralStatus:
    """Return the status of a peripheral device that executes the first of ``jobs`` that was sent to it."""
    sent = [job for job in jobs if job.state is PeripheralJobState.BEING_PROCESSED]
    waiting = [job.name for job in jobs if job.state is PeripheralJobState.TO_BE_PROCESSED]
    content: dict[str, Any] = {
        "operations": ("open", "close"),
        "job": next(iter(sent), None),
        "waiting": tuple(waiting),
        "jobs": jobs,
        **fields,
    }
    return PeripheralStatus(location=location, state=state, **content)


def drive_order(
    place: str, operation: str, state: DriveOrderState, route: tuple[str, ...] | None = None
) -> DriveOrderStatus:
    """Return the status of a destination."""
    return DriveOrderStatus(
        destination=Destination(location_name=place, operation=operation), state=state, route=route
    )


def sample_plant() -> PlantModel:
    """Read the sample plant."""
    return read(sample_plant_path().read_bytes()).model


def power(percent: float, *, charging: bool = False) -> dict[str, Any]:
    """Return the battery fields of a state."""
    return {"power_supply": {"state_of_charge": percent, "charging": charging}}


def timestamp(seconds: float) -> Timestamp:
    """Return the time ``seconds`` after :data:`START` in the aggregator's form."""
    return Timestamp(seconds, START + timedelta(seconds=seconds))
