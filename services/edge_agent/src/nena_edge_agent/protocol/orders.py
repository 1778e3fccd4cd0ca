"""Accept, extend, cancel and clear orders (sections 6.1.2, 6.1.3, 6.6.6 and 6.6.7)."""

from __future__ import annotations

from collections.abc import Iterable

from nena_edge_agent.protocol import actions, driving
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.declaration import CANCEL_ORDER
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import OperatingModeSwitched
from nena_edge_agent.protocol.geometry import is_within_deviation
from nena_edge_agent.protocol.order_acceptance import Acceptance, decide_acceptance
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge, Node, Order

_REPORTED_UNTIL: dict[str, Until] = {ErrorType.MOBILE_ROBOT_NOT_AVAILABLE: Until.AVAILABLE}
"""What ends the report of a rejection; by default, the next accepted order."""


# Acceptance (section 6.1.2)


def receive(robot: RobotState, order: Order) -> None:
    """Accept or reject ``order``; a rejected one changes only the errors (section 6.1.2)."""
    held = (robot.progress.order_id, robot.progress.order_update_id)
    # It was accepted but is not on disk yet, so that no state reports it: fleet control sends it again.
    if robot.journal_problem and held == (order.order_id, order.order_update_id):
        return
    decision = decide_acceptance(order, robot)
    # Also a refused message shows that a newer order service commands the robot.
    robot.history.begin_epoch(order.nena_epoch, robot.utc_now)
    if isinstance(decision, ErrorEntry):
        robot.errors.report(decision, _REPORTED_UNTIL.get(decision.error_type, Until.ORDER_ACCEPTED))
    if decision not in (Acceptance.BEGIN, Acceptance.EXTEND):
        return
    robot.errors.end(Until.ORDER_ACCEPTED, Until.ORDER_OVER)
    robot.goal.forget_failures()
    if decision is Acceptance.BEGIN:
        _begin_order(robot, order)
        return
    # The horizon's actions go with the horizon (6.6.9.1).
    robot.actions.remove(robot.is_in_horizon)
    robot.history.accept(order, robot.utc_now)
    robot.progress.extend(order)
    # The update repeats the stitching node, whose actions were accepted with the base (6.1.2).
    robot.actions.add(_action_records(order.nodes[1:], order.edges))


def _begin_order(robot: RobotState, order: Order) -> None:
    # 2.x drops them with the next order; 3.0 keeps them until clearInstantActions (6.2.3).
    if not robot.capabilities.rules.instant_states_until_cleared:
        robot.instant_actions.remove(lambda record: record.status.ended)
    robot.actions.remove(lambda _: True)
    robot.queue.clear()
    robot.history.end(robot.progress.order_id)
    robot.history.accept(order, robot.utc_now)
    robot.progress.begin(order)
    robot.actions.add(_action_records(order.nodes, order.edges))
    actions.enqueue(robot, order.nodes[0].actions)


def _action_records(nodes: Iterable[Node], edges: Iterable[Edge]) -> list[ActionRecord]:
    """Return the actions' records in driving order."""
    parts = (
        *((ActionScope.NODE, node.sequence_id, node.actions) for node in nodes),
        *((ActionScope.EDGE, edge.sequence_id, edge.actions) for edge in edges),
    )
    return [
        ActionRecord(action, scope, number, ActionStatus.WAITING, None)
        for scope, number, acts in sorted(parts, key=lambda part: part[1])
        for action in acts
    ]


# cancelOrder (section 6.1.3)


def cancel(robot: RobotState, action: Action) -> None:
    """Start to cancel the order (section 6.1.3).

    A second cancelOrder ends together with the first. Without an order to cancel, the action fails.
    """
    # 3.0 may name the order to cancel; without a name, and in 2.x, it is the active one.
    order_id = action.parameter("orderId") if robot.capabilities.rules.cancel_names_order else None
    if not robot.idle and order_id in (None, robot.progress.order_id):
        robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
        begin_clearing(robot)
        return
    text = "no order to cancel"
    if not robot.idle:
        text = f"the active order is '{robot.progress.order_id}', not '{order_id}'"
    robot.instant_actions.change(action.action_id, ActionStatus.FAILED, text)
    entry = error(
        ErrorType.NO_ORDER_TO_CANCEL,
        text,
        hint="the robot's state shows its orderId and what is left of it",
        action_id=action.action_id,
    )
    robot.errors.report(entry, Until.ORDER_ACCEPTED)


# Clearing, by a cancel, an operating mode or hibernation (section 6.6.7)


def begin_clearing(robot: RobotState) -> None:
    """Stop the robot and cancel its actions; an action that cannot be cancelled runs to its end."""
    if not robot.clearing:
        robot.clearing = True
        actions.cancel_all(robot)
        driving.stop(robot)
    if robot.goal.halt_problem:
        robot.request_halt()  # the driver answers again


def advance_clearing(robot: RobotState) -> None:
    """Clear the order once the robot has stopped and all actions have ended (section 6.1.3).

    One state reports all of it.
    """
    if not robot.clearing or not robot.actions.all_ended:
        return
    cancelled = bool(robot.running_instant_actions(CANCEL_ORDER))
    # A freely navigating robot stops where it is; only line-guided ones drive on to the next node (6.1.3).
    # If a person takes over, the order is cleared before the standstill: the robot may be moved by hand.
    by_hand = robot.next_mode.clears_order
    if not by_hand and (robot.goal.moving or (cancelled and not driving.confirm_standstill(robot))):
        return
    robot.clearing = False
    robot.progress.clear(cancelled=cancelled)
    robot.queue.clear()
    robot.goal.forget_failures()
    robot.errors.end(Until.ORDER_OVER)
    robot.end_instant_actions(CANCEL_ORDER, ActionStatus.FINISHED)


# Operating modes (section 6.6.6)


def switch_mode(robot: RobotState, event: OperatingModeSwitched) -> None:
    """Start to change the operating mode; what fleet control may do changes at once (section 6.6.6)."""
    if event.mode is robot.next_mode:
        return
    robot.wanted_mode = event.mode
    if event.mode.clears_order:
        begin_clearing(robot)
    if not event.mode.fleet_controls:
        robot.progress.leave_node()  # a person may move the robot, and no driver reports it
    advance_mode(robot)
    if not event.mode.fleet_controls:  # instant actions; those of the order are cancelled or paused
        actions.fail_waiting(robot, f"the robot is in mode {event.mode}")


def advance_mode(robot: RobotState) -> None:
    """Report the new mode once the order is cleared; clear a last node that the robot has left (6.6.7)."""
    if robot.wanted_mode and not robot.clearing:
        robot.operating_mode, robot.wanted_mode = robot.wanted_mode, None
        if robot.operating_mode in robot.capabilities.rules.node_forgotten_in:
            robot.progress.place_at("")
    if robot.operating_mode not in robot.capabilities.rules.node_left_in or not robot.progress.last_node_id:
        return
    # Too far from its last node to start an order there, the robot is at none (6.6.7).
    position = robot.progress.last_node.node_position if robot.progress.last_node else None
    pose, default = robot.reports.localized_pose, robot.capabilities.default_deviation_xy
    if position is None or (pose is not None and not is_within_deviation(pose, position, default)):
        robot.progress.place_at("")
