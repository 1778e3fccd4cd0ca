"""Zones: zone sets from fleet control, and their effect on driving (sections 6.4 and 6.9)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime
from functools import partial
from itertools import islice

from nena_edge_agent.driver.port import Area, Pose
from nena_edge_agent.protocol import edge_paths
from nena_edge_agent.protocol.declaration import ENABLE_ZONE_SET
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import ActionReport, KeepOut
from nena_edge_agent.protocol.geometry import distance
from nena_edge_agent.protocol.robot_state import RobotState, ZoneSetRequest
from nena_edge_agent.protocol.zone_sets import (
    LOST,
    DuplicateZoneSetError,
    EnabledZone,
    ZoneKey,
    ZoneSetLimitError,
    ZoneSetRefusedError,
    first_closed,
    zones_in,
)
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType, error
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.zone_set import ZoneReleaseLossBehavior, ZoneSet, ZoneType

EDGES_AHEAD = 2
"""Number of edges of the base whose zones the robot requests: the current one and the next one."""
ZONE_SET_ID = "zoneSetId"
KEEP_OUT_TIMEOUT = 10.0
"""Time for navigation to plan around BLOCKED zones before their set can be enabled, seconds."""
NO_ANSWER = "navigation has not confirmed that it plans around BLOCKED zones: is its session active?"
NOT_AVOIDED = "BLOCKED_ZONES_NOT_AVOIDED"
"""Type of the error while navigation does not plan around BLOCKED zones of enabled sets."""
_ERROR_TYPES: dict[type[ZoneSetRefusedError], ErrorType] = {
    DuplicateZoneSetError: ErrorType.DUPLICATE_ZONE_SET,
    ZoneSetLimitError: ErrorType.INSUFFICIENT_MEMORY,
}


# Zone sets (sections 6.4.1 and 6.4.2)


def accept(robot: RobotState, zone_set: ZoneSet) -> str | None:
    """Add a zone set from a message or a download (section 6.4); return why it is refused, if so."""
    try:
        robot.zone_sets.add(zone_set)
    except ZoneSetRefusedError as problem:
        entry = error(
            _ERROR_TYPES.get(type(problem), ErrorType.VALIDATION_FAILURE),
            str(problem),
            hint="check the factsheet for the supported zones; send a changed zone set under another "
            "zoneSetId",
            topic="zoneSet",
            zone_set_id=zone_set.zone_set_id,
        )
        robot.errors.report(entry, Until.ZONE_SET_ACCEPTED)
        return str(problem)
    robot.errors.end(Until.ZONE_SET_ACCEPTED)
    return None


def enable(robot: RobotState, action: Action) -> tuple[ActionStatus, str | None]:
    """Enable the zone set that ``action`` names (section 6.2.3); return the action's status and result.

    A set with BLOCKED zones is enabled only once navigation, which plans its own paths, plans around them.
    """
    request = ZoneSetRequest(action.action_id, str(action.parameter(ZONE_SET_ID)), robot.now)
    if _may_enable(robot, request):
        return _result_of(partial(robot.zone_sets.enable, request.zone_set_id))
    robot.zone_set_requests += (request,)
    return ActionStatus.RUNNING, None


def _may_enable(robot: RobotState, request: ZoneSetRequest) -> bool:
    """Return whether navigation plans around the BLOCKED zones of a set, or need not."""
    answer = robot.reports.keep_out
    needed = robot.capabilities.keeps_out and _blocked_zones(robot.zone_sets.zones_of(request.zone_set_id))
    return not needed or (answer is not None and not answer.problem)


def end_requests(robot: RobotState) -> list[ActionReport]:
    """Enable requested zone sets if navigation plans around BLOCKED zones; return the ends of the actions."""
    answer, ended = robot.reports.keep_out, []
    for request in robot.zone_set_requests:
        if _may_enable(robot, request):
            end = _result_of(partial(robot.zone_sets.enable, request.zone_set_id))
        elif robot.now - request.requested_at >= KEEP_OUT_TIMEOUT:
            end = ActionStatus.FAILED, answer.problem if answer else NO_ANSWER
        else:
            continue
        robot.zone_set_requests = tuple(
            running for running in robot.zone_set_requests if running is not request
        )
        ended.append(ActionReport(request.action_id, *end))
    return ended


def continue_after_restart(robot: RobotState) -> None:
    """Wait again for navigation, for each enableZoneSet that the restart has interrupted."""
    for record in (*robot.actions, *robot.instant_actions):
        action = record.action
        if action.action_type == ENABLE_ZONE_SET and record.status is ActionStatus.RUNNING:
            request = ZoneSetRequest(action.action_id, str(action.parameter(ZONE_SET_ID)), robot.now)
            robot.zone_set_requests += (request,)


def delete(robot: RobotState, action: Action) -> tuple[ActionStatus, str | None]:
    """Delete the zone set that ``action`` names (section 6.2.3); return the action's status and result."""
    return _result_of(partial(robot.zone_sets.delete, str(action.parameter(ZONE_SET_ID))))


def _result_of(change: Callable[[], None]) -> tuple[ActionStatus, str | None]:
    try:
        change()
    except ZoneSetRefusedError as problem:
        return ActionStatus.FAILED, str(problem)
    return ActionStatus.FINISHED, None


# Requests to enter RELEASE zones (sections 6.4.3 and 6.9)


def apply_responses(robot: RobotState, message: Responses, utc: datetime) -> None:
    """Apply fleet control's responses, received at ``utc``, without expired grants (section 6.9)."""
    inside = _possibly_inside(robot)
    for response in message.responses:
        # A grant whose lease is over is no grant: the response was late (6.9).
        if response.lease_expiry is None or response.lease_expiry > utc:
            robot.zone_requests.apply(response, inside, robot.now)


def expire(robot: RobotState) -> None:
    """End the grants whose lease has expired (section 6.9)."""
    now = robot.utc_now
    if now is not None and robot.zone_requests.waits:
        robot.zone_requests.expire(now, _possibly_inside(robot))


def advance(robot: RobotState) -> None:
    """Request the zones ahead, drop obsolete requests, and report zone errors (sections 6.4 and 6.9)."""
    relevant = bool(robot.zone_sets.enabled or robot.zone_requests.requests)
    if not relevant and not robot.zones_checked:
        return  # run once more after the last zone, to withdraw its errors and requests
    robot.zones_checked = relevant
    inside = _zones_inside(robot)
    pose = robot.reports.localized_pose
    # A person who takes over, or the end of the order, ends all requests (6.6.6, 6.6.7).
    if not robot.operating_mode.fleet_controls or robot.progress.cleared:
        robot.zone_requests.keep_only(frozenset())
    elif pose is not None:  # else the robot may be in any of them
        start: Pose | NodePosition = pose
        wanted: list[EnabledZone] = []
        for index, node in enumerate(islice(robot.progress.nodes, EDGES_AHEAD)):
            if not node.released or node.node_position is None:
                break
            wanted += _of_type(_on_path(robot, start, node.node_position, index), ZoneType.RELEASE)
            start = node.node_position
        # A zone that the robot is in stays requested, also when the path leads elsewhere (6.4.3).
        kept = _release_keys(inside)
        robot.zone_requests.keep_only(_release_keys(wanted) | kept, kept)
        if not robot.clearing:
            robot.zone_requests.request(wanted, robot.now)
    for kind, entry in _errors_inside(robot, inside).items():
        robot.errors.set_condition(kind, entry)
    robot.errors.set_condition(ErrorType.NODE_UNREACHABLE, _closed_path(robot))
    robot.errors.set_condition(NOT_AVOIDED, _not_avoided(robot))


# Effects on driving (section 6.4)


def first_barred(
    robot: RobotState, start: Pose | NodePosition, end: NodePosition, edge: int | None = None
) -> EnabledZone | None:
    """Return the first zone on the path to ``end`` that the robot must not enter now, None without one.

    The path is straight unless the robot follows one along the remaining edge with the index ``edge``.
    """
    zones = _on_path(robot, start, end, edge)
    return first_closed(zones) or next((closed for closed in zones if not _is_open(robot, closed)), None)


def must_stop(robot: RobotState) -> bool:
    """Return whether a zone prevents the robot from driving on (section 6.4)."""
    pose, node = robot.reports.localized_pose, robot.progress.next_node
    if not robot.zone_sets.enabled or pose is None:
        return False
    if _not_avoided(robot) or _blocked_zones(_zones_inside(robot)):
        return True
    return bool(node and node.node_position and first_barred(robot, pose, node.node_position, edge=0))


def awaits_keep_out(robot: RobotState) -> bool:
    """Return whether it is not known yet, as after a restart, if navigation plans around enabled zones."""
    unknown = robot.capabilities.keeps_out and robot.reports.keep_out is None
    return unknown and bool(_blocked_zones(robot.zone_sets.enabled))


def keep_out(robot: RobotState) -> None:
    """Make navigation plan around the BLOCKED zones of the sets that are or will be enabled (section 6.4)."""
    revision = (robot.zone_sets.revision, robot.zone_set_requests)
    if not robot.capabilities.keeps_out or revision == robot.areas_revision:
        return
    robot.areas_revision = revision
    blocked = _blocked_zones(robot.zone_sets.enabled)
    for request in robot.zone_set_requests:
        blocked += _blocked_zones(robot.zone_sets.zones_of(request.zone_set_id))
    areas = tuple(dict.fromkeys(Area(zone.map_id, zone.contour) for zone in blocked))
    if areas != robot.areas:
        robot.areas = areas
        robot.effects.append(KeepOut(areas))
    if not areas:
        robot.reports.keep_out = None


def speed_limits(robot: RobotState) -> list[float]:
    """Return the limits, m/s, of SPEED_LIMIT zones around the robot and within its braking distance (6.4)."""
    pose, node = robot.reports.localized_pose, robot.progress.next_node
    if pose is None or not robot.zone_sets.enabled:
        return []
    end = node.node_position if node else None
    zones = _on_path_while_braking(robot, pose, end) if end else _zones_inside(robot)
    return [zone.zone.maximum_speed or 0.0 for zone in _of_type(zones, ZoneType.SPEED_LIMIT)]


def _on_path_while_braking(robot: RobotState, pose: Pose, end: NodePosition) -> list[EnabledZone]:
    """Return the zones on the path within the braking distance."""
    path = edge_paths.path_of_edge(robot)
    if not path:
        length = distance(pose, end)
        share = min(1.0, robot.capabilities.braking_distance / length) if length else 1.0
        x, y = pose.x + share * (end.x - pose.x), pose.y + share * (end.y - pose.y)
        return _on_path(robot, pose, NodePosition(x=x, y=y, map_id=end.map_id))
    path = edge_paths.first_part(
        edge_paths.remaining(path, (pose.x, pose.y)), robot.capabilities.braking_distance
    )
    area = robot.capabilities.footprint.along_corners(edge_paths.corners(path))
    return zones_in(area, end.map_id, robot.zone_sets.enabled)


def _on_path(
    robot: RobotState, start: Pose | NodePosition, end: NodePosition, edge: int | None = None
) -> list[EnabledZone]:
    if not robot.zone_sets.enabled:
        return []
    path = edge_paths.path_of_edge(robot, edge) if edge is not None else ()
    if path:
        path = edge_paths.corners(edge_paths.remaining(path, (start.x, start.y)))
        area = robot.capabilities.footprint.along_corners(path)
    else:
        area = robot.capabilities.footprint.along_path(start, end)
    return zones_in(area, end.map_id, robot.zone_sets.enabled)


def _zones_inside(robot: RobotState) -> list[EnabledZone]:
    pose = robot.reports.localized_pose
    if not robot.zone_sets.enabled or pose is None:
        return []
    return zones_in(robot.capabilities.footprint.at(pose), pose.map_id, robot.zone_sets.enabled)


def _possibly_inside(robot: RobotState) -> frozenset[ZoneKey]:
    """Return the RELEASE zones that the robot is in; if it is not localised, all requested ones."""
    if robot.reports.localized_pose is None:
        return frozenset(zone_request.key for zone_request in robot.zone_requests.requests)
    return _release_keys(_zones_inside(robot))


def _is_open(robot: RobotState, zone: EnabledZone) -> bool:
    """Return whether the robot may enter ``zone`` and drive in it."""
    if zone.zone.zone_type is not ZoneType.RELEASE:
        return True
    status = robot.zone_requests.status(zone.key)
    if status in LOST:
        return _may_continue(robot, zone) and zone.key in _release_keys(_zones_inside(robot))
    return status is RequestStatus.GRANTED


def _may_continue(robot: RobotState, zone: EnabledZone) -> bool:
    """Return whether the robot may drive on in a zone whose release was lost (releaseLossBehavior)."""
    match zone.zone.release_loss_behavior:
        case ZoneReleaseLossBehavior.CONTINUE:
            return True
        case ZoneReleaseLossBehavior.EVACUATE:
            # Driving on evacuates the zone only if the base ends outside it.
            base = [node.node_position for node in robot.progress.nodes if node.released]
            end = base[-1] if base else None
            if end is None:
                return False
            pose = Pose(end.x, end.y, end.theta or 0.0, end.map_id)
            return not zones_in(robot.capabilities.footprint.at(pose), end.map_id, (zone,))
        case _:  # STOP, which is also the default (6.4.3)
            return False


def _errors_inside(robot: RobotState, inside: list[EnabledZone]) -> dict[ErrorType, ErrorEntry | None]:
    """Report zones that the robot is in and should not be in (sections 6.4 and 6.4.3)."""
    violation: ErrorEntry | None = None
    lost: ErrorEntry | None = None
    handled: ErrorEntry | None = None
    if blocked := _blocked_zones(inside):
        violation = error(
            ErrorType.BLOCKED_ZONE_VIOLATION,
            f"the robot is in zone '{blocked[0].zone.zone_id}', which is BLOCKED, and does not drive",
            hint="move the robot out by hand, or enable another zone set",
            zone_id=blocked[0].zone.zone_id,
        )
    for zone in inside:
        zone_id = zone.zone.zone_id
        if robot.zone_requests.status(zone.key) not in LOST:
            continue
        if not _may_continue(robot, zone):
            lost = lost or error(
                ErrorType.RELEASE_LOST,
                f"the robot stopped in zone '{zone_id}': its release was lost",
                hint="grant the request again, or cancel the order and move the robot out by hand",
                zone_id=zone_id,
            )
        elif robot.progress.nodes:  # else it does not drive
            evacuates = zone.zone.release_loss_behavior is ZoneReleaseLossBehavior.EVACUATE
            how = "leaves" if evacuates else "drives on in"
            handled = handled or error(
                ErrorType.RELEASE_LOSS_HANDLING,
                f"the robot {how} zone '{zone_id}': its release was lost",
                hint="keep the zone free until the robot has left it, or grant the request again",
                zone_id=zone_id,
            )
    return {
        ErrorType.BLOCKED_ZONE_VIOLATION: violation,
        ErrorType.RELEASE_LOST: lost,
        ErrorType.RELEASE_LOSS_HANDLING: handled,
    }


def _closed_path(robot: RobotState) -> ErrorEntry | None:
    """Report a zone on the path that was closed after order acceptance."""
    pose, node = robot.reports.localized_pose, robot.progress.next_node
    end = node.node_position if node else None
    zone = first_closed(_on_path(robot, pose, end, edge=0)) if pose and end else None
    if zone is None or node is None:
        return None
    return error(
        ErrorType.NODE_UNREACHABLE,
        f"the path to node '{node.node_id}' leads through zone '{zone.zone.zone_id}', "
        f"which is {zone.zone.zone_type}",
        hint="enable another zone set, or cancel the order",
        node_id=node.node_id,
        order_id=robot.progress.order_id,
        zone_id=zone.zone.zone_id,
    )


def _not_avoided(robot: RobotState) -> ErrorEntry | None:
    """Report that navigation does not plan around the BLOCKED zones of the enabled sets."""
    answer = robot.reports.keep_out
    if answer is None or not answer.problem or not _blocked_zones(robot.zone_sets.enabled):
        return None
    return error(
        NOT_AVOIDED,
        f"the robot does not drive, because navigation would enter BLOCKED zones: {answer.problem}",
        hint="correct Nav2's parameters and restart it, or enable a zone set without BLOCKED zones",
    ).with_level(ErrorLevel.CRITICAL)


def _release_keys(zones: list[EnabledZone]) -> frozenset[ZoneKey]:
    return frozenset(zone.key for zone in zones if zone.zone.zone_type is ZoneType.RELEASE)


def _blocked_zones(zones: Iterable[EnabledZone]) -> list[EnabledZone]:
    return _of_type(zones, ZoneType.BLOCKED)


def _of_type(zones: Iterable[EnabledZone], wanted: ZoneType) -> list[EnabledZone]:
    return [zone for zone in zones if zone.zone.zone_type is wanted]
