"""Builds the views of robots, orders and peripheral devices for API and event stream."""

from __future__ import annotations

from itertools import islice
from typing import cast

from nena_shared.clock import iso
from nena_shared.fleet_api.peripherals import PeripheralJobStatus
from nena_shared.fleet_api.plant import MapImage
from nena_shared.fleet_api.reasons import CodedReason
from nena_shared.fleet_api.stops import StopStatus
from nena_shared.fleet_api.transport_order import Destination, Hold
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.fleet_api.wait_chains import WaitChain
from nena_shared.vda5050.action import ActionState
from nena_shared.vda5050.error import ErrorEntry, ErrorReference
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.state import Information, State
from nena_status_aggregator.fleet.condition import ros_session, session_of
from nena_status_aggregator.fleet.orders import TrackedOrder, order_progress
from nena_status_aggregator.fleet.peripherals import TrackedPeripheral
from nena_status_aggregator.fleet.queues import Jam
from nena_status_aggregator.fleet.robot import Robot
from nena_status_aggregator.fleet.views import (
    ActionView,
    AheadView,
    AreaView,
    BodyView,
    CodedReasonView,
    ErrorView,
    GridView,
    HoldView,
    InformationView,
    JamView,
    KnownActionView,
    LoadView,
    MapView,
    OrderView,
    PeripheralJobView,
    PeripheralView,
    RobotOrderView,
    RobotView,
    RosSessionView,
    StopView,
    VehicleView,
)

TEXT_LIMIT = 500
"""Maximum length of a published free text, characters."""

LIST_LIMIT = 200
"""Maximum length of a published list: errors, actions, loads, nodes."""

DEPTH_LIMIT = 10
"""Maximum depth of nested reasons."""


def short(text: str | None) -> str | None:
    """Shorten a free text to TEXT_LIMIT."""
    return text if text is None or len(text) <= TEXT_LIMIT else f"{text[: TEXT_LIMIT - 1]}…"


def view_robot(
    robot: Robot, *, silence_limit: float, skew_limit: float, chain: WaitChain | None = None
) -> RobotView:
    """Build the view of a robot; nothing in it changes with time alone. ``chain``: the robots it waits for.

    ``clockSkew`` is None below ``skew_limit`` (s), so that noise causes no changes.
    """
    state, vehicle, skew = robot.state, robot.vehicle, robot.skew.seconds
    header = state or robot.connection or robot.factsheet
    position, velocity = robot.position, robot.velocity
    power = state.power_supply if state else None
    # VDA 5050 3.0 reports instant actions in a list of their own; operators see one list of actions.
    actions = (*state.action_states, *state.instant_action_states)[:LIST_LIMIT] if state else ()
    information = ((state.information if state else None) or ())[:LIST_LIMIT]
    return {
        "id": robot.id,
        "manufacturer": robot.key.manufacturer,
        "serialNumber": robot.key.serial_number,
        "name": vehicle.name if vehicle else robot.key.serial_number,
        "protocolVersion": header.version if header else None,
        "condition": robot.condition.value,
        "conditionSince": iso(robot.condition_since),
        "urgent": robot.reason.urgent,
        "reason": short(robot.reason.text) or "",
        "reasonCode": robot.reason.code,
        "reasonValues": robot.reason.values,
        "codedReason": view_reason(robot.reason.coded),
        "connection": robot.connection.connection_state.value if robot.connection else None,
        "connectionSince": iso(robot.connection_since) if robot.connection else None,
        "session": session_of(robot.condition, state).value,
        "rosSession": _ros_session(state) if state else None,
        "lastState": iso(robot.state_at.utc) if state else None,
        "silenceLimit": silence_limit,
        "clockSkew": None if skew is None or abs(skew) < skew_limit else float(round(skew)),
        "operatingMode": state.operating_mode.value if state else None,
        "driving": state.driving if state else None,
        "paused": state.paused if state else None,
        "position": {
            "x": round(position.x, 3),
            "y": round(position.y, 3),
            "theta": round(position.theta, 4),
            "mapId": position.map_id,
            "localized": position.localized,
        }
        if position
        else None,
        "velocity": {"vx": velocity.vx, "vy": velocity.vy, "omega": velocity.omega} if velocity else None,
        "battery": {
            "charge": power.state_of_charge,
            "charging": power.charging,
            "voltage": power.battery_voltage,
            "range": power.range,
        }
        if power
        else None,
        "maps": _view_maps(state) if state else None,
        "grid": _view_grid(robot.map) if robot.map else None,
        "plan": _view_plan(robot, state) if state else None,
        "loads": _view_loads(state) if state else None,
        "errors": [_view_error(error) for error in state.errors[:LIST_LIMIT]] if state else [],
        "information": [_view_information(entry) for entry in information],
        "actions": [_view_action(action) for action in actions],
        "order": _view_robot_order(robot, state) if state and state.order_id else None,
        "body": _view_body(robot.factsheet) if robot.factsheet else None,
        "vehicle": _view_vehicle(robot.vehicle, chain) if robot.vehicle else None,
        "malformed": robot.malformed,
        "problem": short(robot.problem) or None,
        "deviations": [short(str(deviation)) or "" for deviation in robot.deviations],
    }


def view_stop(stop: StopStatus, *, direct: bool = False) -> StopView:
    """Build the view of a stop; ``direct``: the order service does not know it yet."""
    return {
        "name": stop.name,
        "by": stop.by,
        "reason": short(stop.reason) or "",
        "since": iso(stop.since),
        "area": cast("AreaView", stop.area.model_dump(by_alias=True)) if stop.area else None,
        "vehicles": stop.vehicles,
        "paused": stop.paused,
        "notPaused": [
            {
                "vehicle": vehicle.vehicle,
                "reason": short(vehicle.reason) or "",
                "codedReason": view_reason(vehicle.coded_reason),
            }
            for vehicle in stop.not_paused[:LIST_LIMIT]
        ],
        "direct": direct,
    }


def _ros_session(state: State) -> RosSessionView | None:
    session = ros_session(state)
    if session is None:
        return None
    return {
        "state": session.state.value,
        "namespace": short(session.namespace) or "",
        "domainId": short(session.domain_id) or "",
    }


def _view_maps(state: State) -> list[MapView] | None:
    if state.maps is None:
        return None
    return [
        {"mapId": entry.map_id, "mapVersion": entry.map_version, "status": entry.map_status.value}
        for entry in state.maps[:LIST_LIMIT]
    ]


def _view_plan(robot: Robot, state: State) -> list[tuple[float, float]] | None:
    path, position = state.intermediate_path, robot.reported
    if path is None:
        return None
    # The intermediate path has no map ID (VDA 5050 3.0, 7.8): it is on the map of the reported position.
    map_id = position.map_id if position else None
    points = path.polyline[:LIST_LIMIT]
    places = (robot.frame.to_plant_point(point.x, point.y, map_id, robot.factsheet) for point in points)
    return [(round(place[0], 2), round(place[1], 2)) for place in places if place]


def _view_grid(image: MapImage) -> GridView:
    width, height = image.size
    return {
        # Without the pixels: a browser fetches the image once for each digest.
        "digest": image.digest,
        "mapId": image.map_id,
        "x": round(image.x, 4),
        "y": round(image.y, 4),
        "theta": round(image.theta, 6),
        "resolution": image.resolution,
        "width": width,
        "height": height,
    }


def _view_loads(state: State) -> list[LoadView] | None:
    if state.loads is None:
        return None
    return [
        {
            "loadId": load.load_id,
            "loadType": load.load_type,
            "loadPosition": load.load_position,
            "weight": load.weight,
        }
        for load in state.loads[:LIST_LIMIT]
    ]


def _view_error(entry: ErrorEntry) -> ErrorView:
    return {
        "errorType": short(entry.error_type) or "",
        "errorLevel": entry.error_level.value,
        "description": short(entry.error_description),
        "hint": short(entry.error_hint),
        "references": _view_references(entry.error_references),
    }


def _view_information(entry: Information) -> InformationView:
    return {
        "infoType": short(entry.info_type) or "",
        "infoLevel": entry.info_level.value,
        "description": short(entry.info_descriptor),
        "references": _view_references(entry.info_references),
    }


def _view_references(references: tuple[ErrorReference, ...]) -> dict[str, str]:
    return {
        reference.reference_key: short(reference.reference_value) or ""
        for reference in references[:LIST_LIMIT]
    }


def _view_action(action: ActionState) -> ActionView:
    return {
        "actionId": action.action_id,
        "actionType": action.action_type,
        "status": action.action_status.value,
        "result": short(action.action_result),
    }


def _view_robot_order(robot: Robot, state: State) -> RobotOrderView:
    ahead: list[AheadView] = []
    for node in state.node_states[:LIST_LIMIT]:
        at = node.node_position
        place = robot.frame.to_plant_point(at.x, at.y, at.map_id, robot.factsheet) if at else None
        x, y = place or (None, None)
        ahead.append({"nodeId": node.node_id, "released": node.released, "x": x, "y": y})
    return {
        "orderId": state.order_id,
        "orderUpdateId": state.order_update_id,
        "active": is_active(state),
        "lastNodeId": state.last_node_id,
        "nodes": robot.progress.nodes,
        "nodesLeft": robot.progress.nodes_left,
        "progress": robot.progress.percent,
        "ahead": ahead,
    }


def is_active(state: State) -> bool:
    """Return whether the robot's order is active (not idle, VDA 5050 3.0, 6.6.8)."""
    return bool(state.node_states or state.edge_states) or not all(
        action.action_status.ended for action in state.action_states
    )


def _view_body(sheet: Factsheet) -> BodyView:
    # The outline is the first footprint; a factsheet may have several, for example one with a load.
    envelopes = sheet.mobile_robot_geometry.envelopes2d
    outline = envelopes[0].vertices[:LIST_LIMIT] if envelopes else None
    return {
        "seriesName": sheet.type_specification.series_name,
        "robotClass": sheet.type_specification.mobile_robot_class,
        "kinematics": sheet.type_specification.mobile_robot_kinematics,
        "length": sheet.physical_parameters.length,
        "width": sheet.physical_parameters.width,
        "maximumSpeed": sheet.physical_parameters.maximum_speed,
        "outline": None if outline is None else [(vertex.x, vertex.y) for vertex in outline],
    }


def view_known_actions(sheet: Factsheet) -> list[KnownActionView]:
    """Return the actions of a factsheet, with the same names for each VDA 5050 version."""
    return [
        {
            "actionType": action.action_type,
            "description": short(action.action_description),
            "actionScopes": [scope.value for scope in action.action_scopes],
            "actionParameters": [
                {
                    "key": parameter.key,
                    "valueDataType": parameter.value_data_type.value,
                    "description": short(parameter.description),
                    "isOptional": bool(parameter.is_optional),
                }
                for parameter in (action.action_parameters or ())[:LIST_LIMIT]
            ],
        }
        for action in sheet.protocol_features.mobile_robot_actions[:LIST_LIMIT]
    ]


def _view_vehicle(status: VehicleStatus, chain: WaitChain | None) -> VehicleView:
    wait = status.wait
    return {
        "name": status.name,
        "state": status.state.value,
        "processingState": status.processing_state.value,
        "integrationLevel": status.integration_level.value,
        "levelSet": {"by": setter.by, "since": iso(setter.since)} if (setter := status.level_set) else None,
        "reason": short(status.reason) or "",
        "codedReason": view_reason(status.coded_reason),
        "transportOrder": status.transport_order,
        "currentPosition": status.current_position,
        "wait": {
            "vehicles": list(wait.vehicles[:LIST_LIMIT]),
            "at": wait.at,
            "cause": wait.cause.value if wait.cause else None,
            "reason": short(wait.reason) or "",
            "codedReason": view_reason(wait.coded_reason),
            "next": chain.next if chain else None,
            "head": chain.head if chain else None,
            "circle": list(chain.circle[:LIST_LIMIT]) if chain else [],
        }
        if wait
        else None,
    }


def view_jam(jam: Jam) -> JamView:
    """Build the view of a jam."""
    return {
        "head": None if jam.circle else jam.end[0],
        "circle": list(jam.end[:LIST_LIMIT]) if jam.circle else [],
        "robots": jam.robots,
        "since": iso(jam.since),
    }


def view_order(order: TrackedOrder, last_node: str | None) -> OrderView:
    """Build the view of an order; ``last_node``: last node of its vehicle."""
    status = order.status
    return {
        "id": status.name,
        "name": status.name,
        "version": status.version,
        "state": status.state.value,
        "final": status.state.final,
        "outcome": status.ended_as,
        "automatic": status.automatic,
        "createdBy": status.created_by,
        "dependencies": list(status.dependencies),
        "confirmed": order.confirmed,
        "reason": short(status.reason) or "",
        "codedReason": view_reason(status.coded_reason),
        "held": view_hold(status.held) if status.held else None,
        "type": status.type,
        "priority": status.priority,
        "intendedVehicle": status.intended_vehicle,
        "processingVehicle": status.processing_vehicle,
        "destinations": [
            {
                "place": destination_text(drive_order.destination),
                "operation": drive_order.destination.operation,
                "state": drive_order.state.value,
            }
            for drive_order in status.drive_orders
        ],
        "currentDestination": status.current_drive_order_index,
        "progress": order_progress(status, last_node),
        "deadline": iso(status.deadline) if status.deadline else None,
        "created": iso(status.created),
        "finished": iso(status.finished) if status.finished else None,
    }


def view_hold(hold: Hold) -> HoldView:
    """Build the view of a hold."""
    return {
        "by": hold.by,
        "reason": short(hold.reason) or "",
        "codedReason": view_reason(hold.coded_reason),
        "since": iso(hold.since),
    }


def view_reason(reason: CodedReason | None, depth: int = DEPTH_LIMIT) -> CodedReasonView | None:
    """Build the view of a reason; None if it has no code, or is nested too deeply."""
    if reason is None or not depth:
        return None
    causes = [view_reason(cause, depth - 1) for cause in reason.causes[:LIST_LIMIT]]
    # A sentence without one of its causes would say something else; clients show the English text instead.
    if None in causes:
        return None
    return {
        "code": short(reason.code) or "",
        "values": {
            name: short(value) or "" if isinstance(value, str) else value
            for name, value in islice(reason.values.items(), LIST_LIMIT)
        },
        "causes": [cause for cause in causes if cause],
    }


def destination_text(destination: Destination) -> str:
    """Return the name of a destination: point, location, or coordinate in m."""
    at = destination.coordinate
    if at is None:
        return destination.location_name or ""
    return f"({at.x:.2f}, {at.y:.2f})"


def view_peripheral(device: TrackedPeripheral) -> PeripheralView:
    """Build the view of a peripheral device."""
    status = device.status
    return {
        "id": status.location,
        "state": status.state.value,
        "confirmed": device.confirmed,
        "operations": list(status.operations[:LIST_LIMIT]),
        "waiting": len(status.waiting),
        "usedBy": list(status.used_by[:LIST_LIMIT]),
        "job": _view_job(status.job) if status.job else None,
        "jobs": [_view_job(job) for job in status.jobs[:LIST_LIMIT]],
    }


def _view_job(status: PeripheralJobStatus) -> PeripheralJobView:
    return {
        "name": status.name,
        "state": status.state.value,
        "operation": status.operation,
        "reason": short(status.reason) or "",
        "codedReason": view_reason(status.coded_reason),
        "vehicle": status.related_vehicle,
        "transportOrder": status.related_transport_order,
        "path": status.path,
        "created": iso(status.created),
        "finished": iso(status.finished) if status.finished else None,
    }
