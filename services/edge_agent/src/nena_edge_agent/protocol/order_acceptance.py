"""Order acceptance: the checks of sections 6.1.2 and 6.1.4, one by one.

Nothing here changes the robot: the caller acts on the decision. The codec has already checked the schema and
the graph rules. The numbers of the checks are the project's own: 1 to 5 for every message, A for a new order,
B for an update.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum, auto
from itertools import chain, pairwise

from nena_edge_agent.driver.port import Circle, Pose
from nena_edge_agent.protocol import edge_paths
from nena_edge_agent.protocol.action_states import first_load_problem
from nena_edge_agent.protocol.capabilities import Capabilities, unsupported
from nena_edge_agent.protocol.declaration import ENABLE_MAP
from nena_edge_agent.protocol.geometry import distance, is_within_deviation, radius
from nena_edge_agent.protocol.order_progress import OrderFingerprints, OrderHistory, fingerprint
from nena_edge_agent.protocol.zone_sets import EnabledZone, first_closed, zones_in
from nena_shared.vda5050.action import STOP_HIBERNATION, Action
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge, Node, NodePosition, Order
from nena_shared.vda5050.own_actions import START_ROS_SESSION
from nena_shared.vda5050.state import OperatingMode


@dataclass(frozen=True, slots=True)
class Situation:
    """What the robot knows when it decides about an order (section 6.1.2).

    Attributes:
        session_problem: why the ROS session prevents orders; empty if it does not.
        fatal: a reported error prevents orders.
        cancelled: the current order was cancelled, or is being cleared.
        cleared: the current order ended early, possibly far from the end of its base.
        pose: the robot's pose, None if it is not localised.
        no_route: areas to which navigation has no route.
        maps: mapIds of the robot's maps.
        closed: zones that the robot must not enter.
        reached_node: the node that the robot has reached and not left, or empty.
        loaded: the robot will carry a load at the end of its base.
        dated: the timestamp of the order is readable.
        tolerance: navigation's goal tolerance, m; None: unknown.
        about_to_hibernate: startHibernation is running.
    """

    operating_mode: OperatingMode
    session_problem: str
    fatal: bool
    idle: bool
    cancelled: bool
    cleared: bool
    order_id: str
    order_update_id: int
    decision_point: tuple[str, int] | None
    content: OrderFingerprints | None
    pose: Pose | None
    no_route: tuple[Circle, ...]
    maps: frozenset[str]
    closed: tuple[EnabledZone, ...]
    reached_node: str
    instant_action_ids: frozenset[str]
    base_action_ids: frozenset[str]
    loaded: bool = False
    history: OrderHistory = field(default_factory=OrderHistory)
    dated: bool = True
    tolerance: float | None = None
    about_to_hibernate: bool = False


EPOCH_HINT = "stop the order service that was replaced; if none was, compare the clocks of their machines"
MAXIMUM_DISPLACEMENT = 1.0
"""Distance from its reached node above which a robot was moved by hand, metres."""


def _general_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Run checks 2 to 5, which apply to new orders and updates (section 6.1.4)."""
    return (
        _mode_fault(order, situation)
        or _size_fault(order, capabilities)
        or _parameter_fault(order, capabilities)
        or _path_fault(order, situation, capabilities)
        or _action_fault(order, capabilities)
    )


def _mode_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check 2: the robot is available."""
    if situation.about_to_hibernate:
        text = "the robot is about to hibernate and accepts no orders"
        hint = f"wake it with the instant action {STOP_HIBERNATION}"
    elif not situation.operating_mode.takes_orders:
        text = f"the robot is in mode {situation.operating_mode} and accepts no orders"
        hint = "switch the robot to AUTOMATIC"
    elif situation.session_problem:
        text = f"the robot accepts no orders: {situation.session_problem}"
        hint = f"start it with the instant action {START_ROS_SESSION}"
    elif situation.fatal:
        text = "the robot has a fatal error and accepts no orders"
        hint = "follow the hints of its FATAL errors"
    else:
        return None
    return refusal(ErrorType.MOBILE_ROBOT_NOT_AVAILABLE, order, text, hint=hint)


def _size_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 3: the numbers of nodes and actions."""
    actions = sum(1 for _ in _scoped_actions(order))
    for count, limit, what in (
        (len(order.nodes), capabilities.maximum_nodes, "nodes"),
        (actions, capabilities.maximum_actions, "actions"),
    ):
        if count > limit:
            return refusal(
                ErrorType.INSUFFICIENT_MEMORY,
                order,
                f"the order has {count} {what}, the robot accepts {limit}",
                hint="send the order in parts",
            )
    return None


def _parameter_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 4: the optional fields."""
    found = unsupported(order, capabilities)
    if found is None:
        return None
    name, edge = found
    return refusal(
        ErrorType.UNSUPPORTED_PARAMETER,
        order,
        f"the robot does not support {name}" + (f" of edge '{edge.edge_id}'" if edge else ""),
        hint="omit it, or list it in the agent's setting tolerated_parameters",
        parameter=name,
        edge_id=edge.edge_id if edge else None,
    )


def _path_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check that each trajectory and corridor is valid and connects its nodes."""
    for edge, (before, node) in zip(order.edges, pairwise(order.nodes), strict=False):
        if not edge_paths.follows(edge, capabilities):
            continue
        ends = before.node_position, node.node_position
        fault = edge_paths.fault(edge, *ends, capabilities.footprint, situation.tolerance)
        if fault is not None:
            text = f"edge '{edge.edge_id}': {fault.text}"
            return refusal(fault.kind, order, text, hint=fault.hint, edge_id=edge.edge_id)
    return None


def _action_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 5: the actions, including those of the horizon."""
    for scope, action in _scoped_actions(order):
        declaration = capabilities.actions.get(action.action_type)
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


def load_fault(
    order: Order, situation: Situation, capabilities: Capabilities, *, skip: int = 0
) -> ErrorEntry | None:
    """Check that the load at that time allows each pick and drop, in driving order.

    Actions of the first ``skip`` nodes are ignored.
    """
    placed = [(node.sequence_id, node.actions) for node in order.nodes[skip:]]
    placed += [(edge.sequence_id, edge.actions) for edge in order.edges]
    in_order = chain.from_iterable(actions for _, actions in sorted(placed, key=lambda each: each[0]))
    found = first_load_problem(in_order, capabilities.actions, loaded=situation.loaded)
    if found is None:
        return None
    action, problem = found
    hint = "the state's loads show what the robot carries; send matching actions"
    return refusal(ErrorType.INVALID_ORDER_ACTION, order, problem, hint=hint, action_id=action.action_id)


def map_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check A3: the robot has the maps (section 6.1.4.10)."""
    for node in order.nodes:
        position = node.node_position
        if position and position.map_id not in situation.maps:
            return refusal(
                ErrorType.UNKNOWN_MAP_ID,
                order,
                f"node '{node.node_id}' is on '{position.map_id}', the robot has {map_list(situation.maps)}",
                hint="download the map to the robot, or compare the plant model with the setting map_id",
                node_id=node.node_id,
            )
    return None


def route_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A5: a route leads to each node; the robot is at the first one (section 6.1.4.8)."""
    for edge, (before, node) in zip(order.edges, pairwise(order.nodes), strict=False):
        start = _start(before, node, capabilities)
        fault = _reach_fault(start, node, situation)
        fault = fault or _closed_fault(edge, start, node, situation, capabilities)
        if fault is not None:
            problem, hint = fault
            return refusal(ErrorType.NO_ROUTE_TO_TARGET, order, problem, hint=hint, node_id=node.node_id)
    return None


def _start(before: Node, node: Node, capabilities: Capabilities) -> NodePosition | None:
    """Return the start of the edge to ``node``, on its map if an action before it changes the map."""
    start, end = before.node_position, node.node_position
    if start is None or end is None or start.map_id == end.map_id:
        return start
    return end if _changes_map(before, end.map_id, capabilities) else start


def _changes_map(node: Node, map_id: str, capabilities: Capabilities) -> bool:
    """Return whether an action of ``node`` enables a map and sets the robot's position on it."""
    declared = capabilities.actions.get(ENABLE_MAP)
    places = declared is not None and any(each.key == "theta" for each in declared.parameters)
    return places and any(
        each.action_type == ENABLE_MAP
        and each.parameter("mapId") == map_id
        and each.parameter("theta") is not None
        for each in node.actions
    )


def _reach_fault(start: NodePosition | None, node: Node, situation: Situation) -> tuple[str, str] | None:
    """Return why no route leads to ``node``, and what to do about it."""
    place = node.node_position
    if place is None:
        hint = "the robot drives to coordinates only; send nodePosition with every node"
        return f"node '{node.node_id}' has no nodePosition", hint
    if any(area.holds(place.x, place.y) for area in situation.no_route):
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
    edge: Edge, start: NodePosition | None, node: Node, situation: Situation, capabilities: Capabilities
) -> tuple[str, str] | None:
    """Return the closed zone that ``edge`` leads through, in words, and what to do about it."""
    place, footprint = node.node_position, capabilities.footprint
    if place is None or not situation.closed:
        return None
    if edge_paths.follows(edge, capabilities):
        covered = footprint.along_corners(edge_paths.corners(edge_paths.path_between(edge, start, place)))
    else:
        covered = footprint.along_path(start or place, place)
    zone = first_closed(zones_in(covered, place.map_id, situation.closed))
    if zone is None:
        return None
    text = f"the path to node '{node.node_id}' leads through zone '{zone.zone.zone_id}'"
    return text, f"the zone is {zone.zone.zone_type}: plan the order around it, or enable another zone set"


def map_list(maps: Iterable[str]) -> str:
    """Return the names of maps as text."""
    return ", ".join(f"'{each}'" for each in sorted(maps)) or "none"


def repeated_action_fault(order: Order, used: frozenset[str], *, skip: int = 0) -> ErrorEntry | None:
    """Check that no actionId is used twice; the first ``skip`` nodes are ignored (section 6.1.1)."""
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


def is_at_node(node: Node, situation: Situation, capabilities: Capabilities) -> bool:
    """Return whether the robot is at ``node`` and was not moved away by hand (section 6.1.4.7)."""
    pose, position = situation.pose, node.node_position
    displaced = pose and position and distance(pose, position) > radius(position, 0.0) + MAXIMUM_DISPLACEMENT
    if situation.reached_node and situation.reached_node == node.node_id and not displaced:
        return True
    return bool(pose and position and is_within_deviation(pose, position, capabilities.default_deviation_xy))


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


def _update_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Run the checks of an update, after the general ones (section 6.1.2)."""
    fault = _outdated_fault(order, situation)
    if fault is None and repeats(order, situation):
        return _same_id_fault(order, situation, capabilities)
    return (
        fault
        or _stitching_fault(order, situation, capabilities)
        or repeated_action_fault(order, situation.instant_action_ids | situation.base_action_ids, skip=1)
        or map_fault(order, situation)
        or route_fault(order, situation, capabilities)
    )


def repeats(order: Order, situation: Situation) -> bool:
    """Return whether the update has the current orderUpdateId (section 6.1.4.5)."""
    return order.order_update_id == situation.order_update_id


def _outdated_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Checks B1 and B2: the update is not outdated, and the order was not cancelled."""
    if order.order_update_id < situation.order_update_id:
        return refusal(
            ErrorType.OUTDATED_ORDER_UPDATE,
            order,
            f"orderUpdateId {order.order_update_id} is lower than the current {situation.order_update_id}",
            hint="continue from the orderUpdateId in the robot's state",
        )
    if situation.cancelled:
        return refusal(
            ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL,
            order,
            "the order was cancelled",
            hint="send a new order",
        )
    return None


def _same_id_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check B3: a message with the current orderUpdateId has the same content."""
    held = situation.content if capabilities.rules.equal_update_id_compared else None
    if held is None or held.whole == fingerprint(order):
        return None
    return refusal(
        ErrorType.SAME_ORDER_UPDATE_ID,
        order,
        f"orderUpdateId {order.order_update_id} was already accepted with different content",
        hint="use a higher orderUpdateId for each update",
    )


def _stitching_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Checks B4 and B5: the update begins at the decision point, which is the last node after the end."""
    first = order.nodes[0]
    if (first.node_id, first.sequence_id) == situation.decision_point:
        absence = _position_fault(first, order, situation, capabilities) if situation.cleared else None
        return absence or _changed_fault(first, order, situation, capabilities)
    ends, hint = "no longer applies: the robot's last node was reset", "send a new order"
    if situation.decision_point:
        ends = "ends at '{}' with sequenceId {}".format(*situation.decision_point)
        hint = "begin the update with the last released node of the order"
    return refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the update begins at node '{first.node_id}' with sequenceId {first.sequence_id}, the base {ends}",
        hint=hint,
        node_id=first.node_id,
    )


def _position_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check that a robot whose order was cleared is at the end of its base."""
    if is_at_node(first, situation, capabilities):
        return None
    return refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the order was cleared, and the robot is not at '{first.node_id}', where its base ended",
        hint="send a new order",
        node_id=first.node_id,
    )


def _changed_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check that the stitching node is repeated unchanged, if the version requires it."""
    held = situation.content if capabilities.rules.stitching_node_repeated else None
    if held is None or held.decision_node == fingerprint(first):
        return None
    return refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the update repeats node '{first.node_id}' with different content",
        hint="repeat the last released node of the order unchanged; add new actions to a later node",
        node_id=first.node_id,
    )


class Acceptance(Enum):
    """What follows from an order that is not rejected (section 6.1.2, figure 8)."""

    BEGIN = auto()
    """It takes the place of the old one."""
    EXTEND = auto()
    """It is appended to the base of the current one."""
    IGNORE = auto()
    """It was accepted before (section 6.1.4.5)."""


def decide(order: Order, situation: Situation, capabilities: Capabilities) -> Acceptance | ErrorEntry:
    """Accept ``order``, or reject it with an error (section 6.1.2, figure 8)."""
    fault = (
        _identity_fault(order)
        or _epoch_fault(order, situation)
        or _general_fault(order, situation, capabilities)
    )
    if fault is not None:
        return fault
    if order.order_id != situation.order_id:
        return _new_order_fault(order, situation, capabilities) or Acceptance.BEGIN
    fault = _update_fault(order, situation, capabilities)
    if fault is None and repeats(order, situation):
        return Acceptance.IGNORE
    return fault or load_fault(order, situation, capabilities, skip=1) or Acceptance.EXTEND


def _identity_fault(order: Order) -> ErrorEntry | None:
    """Check 1: the orderId is not empty, which the schema allows but means "no order" in the state."""
    if order.order_id:
        return None
    return refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        "the orderId is empty",
        hint="use a new orderId for each order",
    )


def _new_order_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    if not situation.idle:  # A1
        return refusal(
            ErrorType.OTHER_ORDER_ACTIVE,
            order,
            f"order '{situation.order_id}' has not ended",
            hint="wait for its end or cancel it",
        )
    return (
        _replay_fault(order, situation)
        or _update_id_fault(order, capabilities)
        or _numbering_fault(order)
        or repeated_action_fault(order, situation.instant_action_ids)
        or map_fault(order, situation)
        or _start_fault(order.nodes[0], order, situation, capabilities)
        or route_fault(order, situation, capabilities)
        or load_fault(order, situation, capabilities)
    )


def _replay_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check that the order has not been executed before."""
    problem = situation.history.replay(order, dated=situation.dated)
    if problem is None:
        return None
    return refusal(
        ErrorType.OUTDATED_ORDER_UPDATE,
        order,
        f"{problem}; it is not executed again",
        hint="send each order under a new orderId, with a higher headerId or the current time as timestamp",
    )


def _epoch_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check that no other order service has replaced the sender."""
    problem = situation.history.outdated(order.nena_epoch)
    return refusal(ErrorType.OUTDATED_ORDER_UPDATE, order, problem, hint=EPOCH_HINT) if problem else None


def _update_id_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A2: a new order begins with orderUpdateId 0, if the version requires it."""
    if order.order_update_id == 0 or not capabilities.rules.first_update_id_is_zero:
        return None
    return refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        f"a new order begins with orderUpdateId 0, not {order.order_update_id}",
        hint="send the order from its beginning",
    )


def _numbering_fault(order: Order) -> ErrorEntry | None:
    """Check that the order is complete: its first message may have been lost."""
    first = order.nodes[0].sequence_id
    if first == 0:
        return None
    return refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        f"a new order begins with sequenceId 0, not {first}, and the robot has no order '{order.order_id}'",
        hint="send the order from its beginning",
        node_id=order.nodes[0].node_id,
    )


def _start_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check A4: the robot is at the first node."""
    if is_at_node(first, situation, capabilities):
        return None
    pose = situation.pose
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
