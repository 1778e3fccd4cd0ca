"""Driving along the order: edges entered, nodes traversed, goals given (sections 6.6.1 and 6.6.2)."""

from __future__ import annotations

from itertools import islice, pairwise
from math import dist

from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure, NavigationReport, Pose
from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.action_states import lets_drive
from nena_edge_agent.protocol.capabilities import DriveStrategy, ExternalGoals
from nena_edge_agent.protocol.driving import HALT_PATIENCE, make_goal
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import Drive, Halt
from nena_edge_agent.protocol.geometry import distance, heading_fits, in_place, same_place
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.way_ahead import way_ahead
from nena_edge_agent.protocol.zone_guard import ZoneGuard
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.order import Node, NodePosition

CHANCE = frozenset(
    {
        DriveFailure.ABORTED,
        DriveFailure.NOT_TAKEN_UP,
        DriveFailure.OUTSIDE_TOLERANCE,
        DriveFailure.NAVIGATION_GONE,
    }
)
"""Failures that may be over at the next try; who cancels a drive or gives another goal wants it to end."""


class Travel:
    """Decides where the robot drives, and when a node is traversed."""

    def __init__(self, parts: RobotParts, flow: ActionFlow, zones: ZoneGuard) -> None:
        self._parts = parts
        self._flow = flow
        self._zones = zones

    def arrived(self, event: Arrived) -> None:
        """Count the goal's node as traversed."""
        if self._parts.goal.is_current(event.generation):
            self._traverse()

    def failed(self, event: DriveFailed) -> None:
        """Stand, and show why; the order stays, and fleet control decides."""
        parts = self._parts
        if not parts.goal.is_current(event.generation):
            return
        parts.goal.settle()
        if event.failure is DriveFailure.NAVIGATION_GONE:
            self.resume_halt()  # the controller may drive on without the navigator
        pauses = parts.capabilities.external_goals is ExternalGoals.PAUSE
        if event.failure is DriveFailure.TAKEN_OVER and pauses:
            parts.goal.target = None  # it is given again when the other drive has ended
        elif self._tries_again(event.failure):
            problem = f"{event.description} ({event.failure})"
            parts.goal.retry(parts.now + parts.capabilities.retry_wait, problem)
        else:
            self._fail(event.failure, event.description)

    def _tries_again(self, failure: DriveFailure) -> bool:
        goal = self._parts.goal
        return failure in CHANCE and goal.failures < self._parts.capabilities.drive_retries

    def _fail(self, failure: DriveFailure, description: str) -> None:
        parts = self._parts
        node = parts.progress.nodes[0]
        parts.goal.failed_at, parts.goal.target = node.sequence_id, None
        parts.errors.show(
            error(
                ErrorType.NODE_UNREACHABLE,
                f"node '{node.node_id}' was not reached: {description} ({failure})",
                hint="remove the cause, then update the order or cancel it",
                node_id=node.node_id,
                order_id=parts.progress.order_id,
                order_update_id=parts.progress.order_update_id,
                failure=failure,
            ),
            Until.ORDER_OVER,
        )

    def halted(self) -> None:
        """Note that the robot stands without a goal."""
        goal = self._parts.goal
        goal.halting_since, goal.halt_problem = None, ""
        goal.target = None
        goal.settle()

    def halt_failed(self, description: str) -> None:
        """Note that the robot cannot be shown to stand; it is asked to stop again and again."""
        goal = self._parts.goal
        goal.halt_problem = description
        if goal.halting_since is None:
            goal.halting_since = self._parts.now

    def navigation_changed(self, report: NavigationReport) -> None:
        """Give the goal again once navigation is back: what it had before may be lost."""
        senses, goal = self._parts.senses, self._parts.goal
        if report.available and not senses.navigation.available:
            goal.target = None
        senses.navigation = report

    def pose_changed(self) -> None:
        """Pass the next node if the robot is in its range and has no reason to stop there."""
        parts = self._parts
        node = parts.progress.next_node
        passing = parts.capabilities.strategy is DriveStrategy.PASS_THROUGH
        if passing and node and parts.goal.target is not None and self._may_pass(node):
            self._traverse()

    def halt(self) -> None:
        """Have the robot stop, unless it stands."""
        goal = self._parts.goal
        if goal.target is not None:
            goal.target = None
            goal.halting_since = self._parts.now
            self._parts.effects.append(Halt())

    def resume_halt(self) -> None:
        """Have the robot stop whatever it does: after a restart nobody knows."""
        self._parts.goal.halting_since = self._parts.now
        self._parts.effects.append(Halt())

    def advance(self) -> None:
        """Do what the state of things allows: ask again for a halt, stop, or go on."""
        self._repeat_halt()
        if self._must_stand():
            self.halt()
            return
        self._look_ahead()
        while self._may_move():
            if goals := self._parts.senses.goals.external:
                text = f"navigation drives to a goal that somebody else gave ({goals[0].goal_id})"
                self._fail(DriveFailure.TAKEN_OVER, text)
                return
            self._enter_edge()
            if not self._parts.queue.driving_allowed or not self._go():
                return

    @property
    def leftover(self) -> bool:
        """Whether navigation may drive to a goal of ours that the order has no use for: an action's, say."""
        parts = self._parts
        wanted = parts.progress.next_node is not None and parts.queue.driving_allowed
        return parts.goal.own is not None and not wanted

    @property
    def new_base_request(self) -> bool:
        """Whether the end of the base comes near while a horizon is left (section 6.6.3)."""
        parts = self._parts
        if not parts.progress.horizon_left or parts.clearing:
            return False
        return self._base_length_left() <= parts.capabilities.base_request_distance

    def _repeat_halt(self) -> None:
        since = self._parts.goal.halting_since
        if since is not None and self._parts.now - since >= HALT_PATIENCE:
            self.resume_halt()

    def _must_stand(self) -> bool:
        parts = self._parts
        return (
            parts.holding
            or parts.clearing
            or parts.link.must_stand(parts.now)
            or parts.senses.trusted_pose is None
            or (parts.goal.target is not None and self._zones.must_stand)
        )

    def _may_move(self) -> bool:
        parts = self._parts
        node = parts.progress.next_node
        return (
            node is not None
            and parts.senses.navigation.available
            and not parts.goal.halting
            and not parts.gives_way
            and not parts.link.out_of_reach(parts.now)
            and (parts.goal.retry_at is None or parts.now >= parts.goal.retry_at)
            and parts.goal.failed_at != node.sequence_id
            and parts.goal.target is None
            and parts.queue.driving_allowed
            and not self._zones.must_stand
        )

    def _enter_edge(self) -> None:
        if not self._parts.progress.edge_entered:
            edge = self._parts.progress.enter_edge()
            self._flow.enqueue(edge.actions)

    def _go(self) -> bool:
        """Drive to the next node; tell whether it is traversed already, as it is where the robot stands."""
        node, pose = self._parts.progress.next_node, self._parts.senses.trusted_pose
        if node is None or node.node_position is None or pose is None:
            return False  # cannot be: acceptance and the callers have looked
        if self._stands_at(node.node_position, pose):
            self._traverse()
            return True
        self._give_goal(node, node.node_position, pose)
        return False

    def _stands_at(self, position: NodePosition, pose: Pose) -> bool:
        """Tell whether an edge of no length leads to ``position``, and the robot is really there."""
        last = self._parts.progress.last_node if self._parts.progress.on_last_node else None
        same = last and last.node_position and same_place(last.node_position, position)
        return bool(same) and in_place(pose, position, self._parts.capabilities.default_deviation_xy)

    def _give_goal(self, node: Node, position: NodePosition, pose: Pose) -> None:
        parts, goal = self._parts, self._parts.goal
        goal.generation += 1
        goal.ahead = self._way_ahead()
        goal.target, goal.retry_at = node.sequence_id, None
        parts.progress.leave_node()
        parts.charging = False
        drive = make_goal(
            position,
            pose,
            parts.capabilities,
            generation=goal.generation,
            maximum_speed=parts.progress.edges[0].maximum_speed,
            ahead=goal.ahead,
        )
        parts.senses.progress = None  # it was that of the goal before
        listed = parts.senses.goals.goals
        goal.give(drive.pose, listed[-1].goal_id if listed else "")
        parts.effects.append(Drive(drive))

    def _look_ahead(self) -> None:
        """Tell a driver that drives ahead when other places come behind its goal than it was told."""
        node, pose = self._parts.progress.next_node, self._parts.senses.trusted_pose
        if self._parts.goal.target is None or node is None or node.node_position is None or pose is None:
            return
        if self._way_ahead() != self._parts.goal.ahead:
            self._give_goal(node, node.node_position, pose)

    def _way_ahead(self) -> tuple[Pose, ...]:
        """Give the places behind the next node that can be driven over now; none to a driver that cannot."""
        parts = self._parts
        capabilities, pose = parts.capabilities, parts.senses.trusted_pose
        passes = capabilities.strategy is DriveStrategy.PASS_THROUGH and capabilities.drives_ahead
        if not passes or pose is None or parts.link.out_of_reach(parts.now):
            return ()
        last = parts.progress.last_node.node_position if parts.progress.last_node else None
        return way_ahead(
            parts.progress,
            last or pose,
            capabilities,
            lambda here, there: self._zones.barred(here, there) is not None,
        )

    def _traverse(self) -> None:
        self._parts.goal.target = None
        self._parts.goal.settle()
        self._parts.goal.forget_failures()
        node, edge = self._parts.progress.traverse()
        self._flow.end_with_edge(edge)
        self._flow.enqueue(node.actions)

    def _may_pass(self, node: Node) -> bool:
        """Tell whether the robot is in range of ``node`` and can go on without a stop."""
        parts = self._parts
        pose, position = parts.senses.trusted_pose, node.node_position
        following = next(islice(parts.progress.edges, 1, None), None)
        if pose is None or position is None or following is None or not following.released:
            return False
        capabilities = parts.capabilities
        return (
            parts.queue.driving_allowed
            and not parts.link.out_of_reach(parts.now)
            and lets_drive(node.actions)
            and lets_drive(following.actions)
            and (capabilities.drives_ahead or distance(pose, position) <= self._pass_radius)
            and in_place(pose, position, capabilities.default_deviation_xy)
            and heading_fits(pose, position, capabilities.default_deviation_theta)
            and not self._barred_behind(position)
        )

    @property
    def _pass_radius(self) -> float:
        """The distance in m from a passed node at which the next goal is given, at the present speed."""
        capabilities, speed = self._parts.capabilities, self._parts.senses.velocity.vx or 0.0
        early = capabilities.hand_over_distance + abs(speed) * capabilities.hand_over_time
        return max(capabilities.pass_radius, early)

    def _barred_behind(self, position: NodePosition) -> bool:
        """Tell whether a zone keeps the robot from going on behind the next node, at ``position``."""
        following = next(islice(self._parts.progress.nodes, 1, None), None)
        place = following.node_position if following else None
        return place is not None and self._zones.barred(position, place) is not None

    def _base_length_left(self) -> float:
        """Give the straight length in m from the robot over the base's nodes to its end."""
        pose = self._parts.senses.trusted_pose
        if pose is None:
            return 0.0
        base = (node.node_position for node in self._parts.progress.nodes if node.released)
        way = [(pose.x, pose.y), *((position.x, position.y) for position in base if position)]
        return sum(dist(start, end) for start, end in pairwise(way))
