"""Order acceptance: the checks of sections 6.1.2 and 6.1.4, one by one.

Nothing here changes the robot: the caller acts on the decision. The codec has already checked the schema and
the graph rules. The numbers of the checks are the project's own: 1 to 5 for every message, A for a new order,
B for an update.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum, auto
from itertools import chain, pairwise

from nena_edge_agent.protocol import edge_paths
from nena_edge_agent.protocol.action_states import first_load_problem, loaded_after
from nena_edge_agent.protocol.capabilities import unsupported
from nena_edge_agent.protocol.conditions import session_problem
from nena_edge_agent.protocol.declaration import ENABLE_MAP
from nena_edge_agent.protocol.geometry import distance, is_within_deviation, radius
from nena_edge_agent.protocol.order_progress import fingerprint
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_edge_agent.protocol.zone_sets import CLOSED, EnabledZone, first_closed, zones_in
from nena_shared.vda5050.action import STOP_HIBERNATION, Action
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge, Node, NodePosition, Order
from nena_shared.vda5050.own_actions import START_ROS_SESSION

EPOCH_HINT = "stop the order service that was replaced; if none was, compare the clocks of their machines"
MAXIMUM_DISPLACEMENT = 1.0
"""Distance from its reached node above which a robot was moved by hand, metres."""


def _mode_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check 2: the robot is available."""
    if robot.power is PowerPhase.FALLING_ASLEEP:
        text = "the robot is about to hibernate and accepts no orders"
        hint = f"wake it with the instant action {STOP_HIBERNATION}"
    elif not robot.next_mode.takes_orders:
        text = f"the robot is in mode {robot.next_mode} and accepts no orders"
        hint = "switch the robot to AUTOMATIC"
    elif problem := session_problem(robot):
        text = f"the robot accepts no orders: {problem}"
        hint = f"start it with the instant action {START_ROS_SESSION}"
    elif robot.fatal:
        text = "the robot has a fatal error and accepts no orders"
        hint = "follow the hints of its FATAL errors"
    else:
        return None
    return refusal(ErrorType.MOBILE_ROBOT_NOT_AVAILABLE, order, text, hint=hint)


def _size_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check 3: the numbers of nodes and actions."""
    actions = sum(1 for _ in _scoped_actions(order))
    for count, limit, what in (
        (len(order.nodes), robot.capabilities.maximum_nodes, "nodes"),
        (actions, robot.capabilities.maximum_actions, "actions"),
    ):
        if count > limit:
            return refusal(
                ErrorType.INSUFFICIENT_MEMORY,
                order,
                f"the order has {count} {what}, the robot accepts {limit}",
                hint="send the order in parts",
            )
    return None


def _parameter_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check 4: the optional fields."""
    parameter = unsupported(order, robot.capabilities)
    if parameter is None:
        return None
    name, edge = parameter
    return refusal(
        ErrorType.UNSUPPORTED_PARAMETER,
        order,
        f"the robot does not support {name}" + (f" of edge '{edge.edge_id}'" if edge else ""),
        hint="omit it, or list it in the agent's setting tolerated_parameters",
        parameter=name,
        edge_id=edge.edge_id if edge else None,
    )


def _speed_fault(order: Order) -> ErrorEntry | None:
    """Check that each edge can be driven: nothing reaches its end at 0 m/s."""
    edge = next((edge for edge in order.edges if edge.maximum_speed == 0), None)
    if edge is None:
        return None
    text = f"edge '{edge.edge_id}' has the maximum speed 0, at which no robot reaches its end"
    hint = (
        "send a speed above 0 m/s, or no maximum speed; to stop the robot, send startPause or a shorter base"
    )
    kind, name = ErrorType.VALIDATION_FAILURE, "edges.maximumSpeed"
    return refusal(kind, order, text, hint=hint, parameter=name, edge_id=edge.edge_id)


def _path_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check that each trajectory and corridor is valid and connects its nodes."""
    limits = robot.reports.limits
    tolerance = limits.tolerance if limits else None
    for edge, (start, node) in zip(order.edges, pairwise(order.nodes), strict=False):
        if not edge_paths.follows(edge, robot.capabilities):
            continue
        ends = start.node_position, node.node_position
        fault = edge_paths.edge_fault(edge, *ends, robot.capabilities.footprint, tolerance)
        if fault is not None:
            text = f"edge '{edge.edge_id}': {fault.text}"
            return refusal(fault.kind, order, text, hint=fault.hint, edge_id=edge.edge_id)
    return None


def _action_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check 5: the actions, including those of the horizon."""
    for scope, action in _scoped_actions(order):
        declaration = robot.capabilities.actions.get(action.action_type)
        problem = (
            declaration.problem(action, scope)
            if declaration
            else f"the robot does not support action '{action.action_type}'"
        )
        if problem:
            return refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                problem,
                hint="the factsheet lists the robot's actions",
                action_id=action.action_id,
            )
    return None


def load_fault(order: Order, robot: RobotState, *, skip: int = 0) -> ErrorEntry | None:
    """Check that the load at that time allows each pick and drop, in driving order.

    Actions of the first ``skip`` nodes are ignored.
    """
    placed = [(node.sequence_id, node.actions) for node in order.nodes[skip:]]
    placed += [(edge.sequence_id, edge.actions) for edge in order.edges]
    in_order = chain.from_iterable(actions for _, actions in sorted(placed, key=lambda place: place[0]))
    declared = robot.capabilities.actions
    # An update is executed after the base: what counts is the load at its end, not the one now.
    to_do = (record.action for record in robot.base_actions if not record.status.ended)
    loaded = loaded_after(to_do, declared, loaded=bool(robot.loads))
    refused = first_load_problem(in_order, declared, loaded=loaded)
    if refused is None:
        return None
    action, problem = refused
    hint = "the state's loads show what the robot carries; send matching actions"
    return refusal(ErrorType.INVALID_ORDER_ACTION, order, problem, hint=hint, action_id=action.action_id)


def map_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check A3: the robot has the maps (section 6.1.4.10)."""
    for node in order.nodes:
        position = node.node_position
        if position and position.map_id not in robot.map_ids:
            return refusal(
                ErrorType.UNKNOWN_MAP_ID,
                order,
                f"node '{node.node_id}' is on '{position.map_id}', the robot has {map_list(robot.map_ids)}",
                hint="download the map to the robot, or compare the plant model with the setting map_id",
                node_id=node.node_id,
            )
    return None


def route_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check A5: a route leads to each node; the robot is at the first one (section 6.1.4.8)."""
    closed = tuple(zone for zone in robot.zone_sets.enabled if zone.zone.zone_type in CLOSED)
    for edge, (previous, node) in zip(order.edges, pairwise(order.nodes), strict=False):
        start = _edge_start(previous, node, robot)
        fault = _reach_fault(start, node, robot)
        fault = fault or _closed_fault(edge, start, node, robot, closed)
        if fault is not None:
            problem, hint = fault
            return refusal(ErrorType.NO_ROUTE_TO_TARGET, order, problem, hint=hint, node_id=node.node_id)
    return None


def _edge_start(before: Node, node: Node, robot: RobotState) -> NodePosition | None:
    """Return the start of the edge to ``node``, on its map if an action before it changes the map."""
    start, end = before.node_position, node.node_position
    if start is None or end is None or start.map_id == end.map_id:
        return start
    # The robot cannot change maps while it drives: an enableMap with a pose moves its position to the other
    # map while it stands at the node (an extension of 3.0's enableMap, which has no pose).
    declared = robot.capabilities.actions.get(ENABLE_MAP)
    places = declared is not None and any(parameter.key == "theta" for parameter in declared.parameters)
    changes_map = places and any(
        action.action_type == ENABLE_MAP
        and action.parameter("mapId") == end.map_id
        and action.parameter("theta") is not None
        for action in before.actions
    )
    return end if changes_map else start


def _reach_fault(start: NodePosition | None, node: Node, robot: RobotState) -> tuple[str, str] | None:
    """Return why no route leads to ``node``, and what to do about it."""
    # nodePosition is optional in the schema (7.3), but a freely navigating robot knows no nodes by name.
    place = node.node_position
    if place is None:
        hint = "the robot drives to coordinates only; send nodePosition with every node"
        return f"node '{node.node_id}' has no nodePosition", hint
    if any(area.holds(place.x, place.y) for area in robot.reports.no_route):
        return (
            f"no route leads to node '{node.node_id}'",
            "check what blocks the route, or send the robot to another destination",
        )
    begin = start or place
    if begin.map_id != place.map_id:
        text = f"node '{node.node_id}' is on map '{place.map_id}', the one before it on '{begin.map_id}'"
        hint = (
            "the robot cannot change maps while it drives; with maps.store = nav2, add the action enableMap "
        )
        return text, hint + "with x, y and theta to the previous node; otherwise set its position on that map"
    return None


def _closed_fault(
    edge: Edge, start: NodePosition | None, node: Node, robot: RobotState, closed: tuple[EnabledZone, ...]
) -> tuple[str, str] | None:
    """Return the closed zone that ``edge`` leads through, in words, and what to do about it."""
    place, footprint = node.node_position, robot.capabilities.footprint
    if place is None or not closed:
        return None
    if edge_paths.follows(edge, robot.capabilities):
        covered = footprint.along_corners(edge_paths.corners(edge_paths.path_between(edge, start, place)))
    else:
        covered = footprint.along_path(start or place, place)
    zone = first_closed(zones_in(covered, place.map_id, closed))
    if zone is None:
        return None
    text = f"the path to node '{node.node_id}' leads through zone '{zone.zone.zone_id}'"
    return text, f"the zone is {zone.zone.zone_type}: plan the order around it, or enable another zone set"


def map_list(maps: Iterable[str]) -> str:
    """Return the names of maps as text."""
    return ", ".join(f"'{name}'" for name in sorted(maps)) or "none"


def repeated_action_fault(order: Order, robot: RobotState, *, skip: int = 0) -> ErrorEntry | None:
    """Check that no actionId is used twice; the first ``skip`` nodes are ignored (section 6.1.1)."""
    used = {record.action.action_id for record in robot.instant_actions}
    if order.order_id == robot.progress.order_id:  # an update: the base keeps its actions
        used.update(record.action.action_id for record in robot.base_actions)
    for _, action in _scoped_actions(order, skip=skip):
        if action.action_id in used:
            return refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                f"the actionId '{action.action_id}' is used by another action",
                hint="use a unique actionId for each action",
                action_id=action.action_id,
            )
    return None


def is_at_node(node: Node, robot: RobotState) -> bool:
    """Return whether the robot is at ``node`` and was not moved away by hand (section 6.1.4.7)."""
    pose, position = robot.reports.localized_pose, node.node_position
    default = robot.capabilities.default_deviation_xy
    # A robot that stopped within the node's deviation may report a pose just outside it later.
    displaced = pose and position and distance(pose, position) > radius(position, 0.0) + MAXIMUM_DISPLACEMENT
    reached = robot.progress.on_last_node and robot.progress.last_node_id == node.node_id
    if reached and not displaced:
        return True
    return bool(pose and position and is_within_deviation(pose, position, default))


def _scoped_actions(order: Order, *, skip: int = 0) -> Iterator[tuple[ActionScope, Action]]:
    on_nodes = ((ActionScope.NODE, action) for node in order.nodes[skip:] for action in node.actions)
    on_edges = ((ActionScope.EDGE, action) for edge in order.edges for action in edge.actions)
    return chain(on_nodes, on_edges)


def refusal(
    kind: ErrorType, order: Order, description: str, *, hint: str, **references: str | None
) -> ErrorEntry:
    """Return the error of a rejected order; references that are None are omitted (section 6.6.5.4)."""
    return error(
        kind,
        description,
        hint=hint,
        topic="order",
        header_id=order.header_id,
        order_id=order.order_id,
        order_update_id=order.order_update_id,
        **references,
    )


def _outdated_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Checks B1 and B2: the update is not outdated, and the order was not cancelled."""
    current = robot.progress.order_update_id
    if order.order_update_id < current:
        return refusal(
            ErrorType.OUTDATED_ORDER_UPDATE,
            order,
            f"orderUpdateId {order.order_update_id} is lower than the current {current}",
            hint="continue from the orderUpdateId in the robot's state",
        )
    if robot.progress.cancelled or robot.clearing:
        return refusal(
            ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL,
            order,
            "the order was cancelled",
            hint="send a new order",
        )
    return None


def _stitching_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Checks B4 and B5: the update begins at the decision point, which is the last node after the end."""
    first, progress, rules = order.nodes[0], robot.progress, robot.capabilities.rules
    if (first.node_id, first.sequence_id) != progress.decision_point:
        ends, hint = "no longer applies: the robot's last node was reset", "send a new order"
        if progress.decision_point:
            ends = "ends at '{}' with sequenceId {}".format(*progress.decision_point)
            hint = "begin the update with the last released node of the order"
        begins = f"begins at node '{first.node_id}' with sequenceId {first.sequence_id}"
        text = f"the update {begins}, the base {ends}"
    elif progress.cleared and not is_at_node(first, robot):
        # The order ended early (6.6.7), perhaps far from the end of its base.
        text = f"the order was cleared, and the robot is not at '{first.node_id}', where its base ended"
        hint = "send a new order"
    elif (
        # 3.0 requires the stitching node to be repeated unchanged (6.1.2); 2.x ignores the copy's content.
        rules.stitching_node_repeated
        and progress.content is not None
        and progress.content.decision_node != fingerprint(first)
    ):
        text = f"the update repeats node '{first.node_id}' with different content"
        hint = "repeat the last released node of the order unchanged; add new actions to a later node"
    else:
        return None
    return refusal(rules.wrong_stitching_node, order, text, hint=hint, node_id=first.node_id)


class Acceptance(Enum):
    """What follows from an order that is not rejected (section 6.1.2, figure 8)."""

    BEGIN = auto()
    """It takes the place of the old one."""
    EXTEND = auto()
    """It is appended to the base of the current one."""
    IGNORE = auto()
    """It was accepted before (section 6.1.4.5)."""


def decide_acceptance(order: Order, robot: RobotState) -> Acceptance | ErrorEntry:
    """Accept ``order``, or reject it with an error (section 6.1.2, figure 8)."""
    # The schema allows an empty orderId, but the state uses it for "no order" (7.8).
    if not order.order_id:
        hint = "use a new orderId for each order"
        return refusal(ErrorType.VALIDATION_FAILURE, order, "the orderId is empty", hint=hint)
    # No check of the standard: a replaced order service must not command the robot any more.
    if problem := robot.history.outdated(order.nena_epoch):
        return refusal(ErrorType.OUTDATED_ORDER_UPDATE, order, problem, hint=EPOCH_HINT)
    # The order of these checks decides which error fleet control gets (figure 8).
    fault = (
        _mode_fault(order, robot)
        or _size_fault(order, robot)
        or _speed_fault(order)
        or _parameter_fault(order, robot)
        or _path_fault(order, robot)
        or _action_fault(order, robot)
    )
    if fault is not None:
        return fault
    if order.order_id != robot.progress.order_id:
        return _new_order_fault(order, robot) or Acceptance.BEGIN
    return _decide_update(order, robot)


def _decide_update(order: Order, robot: RobotState) -> Acceptance | ErrorEntry:
    if fault := _outdated_fault(order, robot):
        return fault
    if order.order_update_id == robot.progress.order_update_id:
        # B3: 2.x ignores every message with the current orderUpdateId, 3.0 only one with the same content.
        held = robot.progress.content if robot.capabilities.rules.equal_update_id_compared else None
        if held is None or held.whole == fingerprint(order):
            return Acceptance.IGNORE
        text = f"orderUpdateId {order.order_update_id} was already accepted with different content"
        hint = "use a higher orderUpdateId for each update"
        return refusal(ErrorType.SAME_ORDER_UPDATE_ID, order, text, hint=hint)
    # The first node of an update is the stitching node, whose actions were accepted with the base (6.1.2).
    return (
        _stitching_fault(order, robot)
        or repeated_action_fault(order, robot, skip=1)
        or map_fault(order, robot)
        or route_fault(order, robot)
        or load_fault(order, robot, skip=1)
        or Acceptance.EXTEND
    )


def _new_order_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    # A1. An order that is being cancelled still holds its actions (6.1.3).
    if not robot.idle or robot.clearing:
        return refusal(
            ErrorType.OTHER_ORDER_ACTIVE,
            order,
            f"order '{robot.progress.order_id}' has not ended",
            hint="wait for its end or cancel it",
        )
    # MQTT may deliver an old order again, after a reconnect or from a queue: it must not be executed twice.
    if problem := robot.history.replay(order):
        return refusal(
            ErrorType.OUTDATED_ORDER_UPDATE,
            order,
            f"{problem}; it is not executed again",
            hint="send each order under a new orderId",
        )
    return (
        _beginning_fault(order, robot)
        or repeated_action_fault(order, robot)
        or map_fault(order, robot)
        or _start_fault(order.nodes[0], order, robot)
        or route_fault(order, robot)
        or load_fault(order, robot)
    )


def _beginning_fault(order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check A2: the message is the order's first one, not an update whose order was lost."""
    update_id, first = order.order_update_id, order.nodes[0].sequence_id
    node_id: str | None = None
    if update_id != 0 and robot.capabilities.rules.first_update_id_is_zero:
        text = f"a new order begins with orderUpdateId 0, not {update_id}"
    elif first != 0:
        node_id = order.nodes[0].node_id
        text = f"a new order begins with sequenceId 0, not {first}, "
        text += f"and the robot has no order '{order.order_id}'"
    else:
        return None
    hint = "send the order from its beginning"
    return refusal(ErrorType.VALIDATION_FAILURE, order, text, hint=hint, node_id=node_id)


def _start_fault(first: Node, order: Order, robot: RobotState) -> ErrorEntry | None:
    """Check A4: the robot is at the first node."""
    if is_at_node(first, robot):
        return None
    pose = robot.reports.localized_pose
    place = f"it is at x {pose.x:.2f} m, y {pose.y:.2f} m" if pose else "its position is not known"
    return refusal(
        ErrorType.START_NODE_OUT_OF_RANGE,
        order,
        f"the robot is not at the first node '{first.node_id}'; {place}",
        hint="start the order where the robot is, or set a larger allowedDeviationXY at the first node"
        if pose
        else "set the robot's initial position",
        node_id=first.node_id,
    )
