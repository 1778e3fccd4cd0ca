"""How far the robot has come along its order, and how far it has to go (section 6.6.2)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import dist

from nena_edge_agent.driver.port import PlanReport, Pose
from nena_edge_agent.protocol.parts import RobotParts

JITTER = 0.03
"""Metres by which poses of a robot that stands may differ."""
JUMP = 3.0
"""Metres between two poses that nobody drives: the localisation has changed its mind."""
PLAN_TOLERANCE = 0.75
"""Metres from a goal at which navigation may end its plan."""


@dataclass(frozen=True, slots=True)
class Way:
    """Metres driven and left."""

    driven: float
    left: float

    @property
    def percent(self) -> int:
        """Share of the way that is driven."""
        whole = self.driven + self.left
        return round(100 * self.driven / whole) if whole > 0 else 100


class Journey:
    """Measures the way by the poses. After a restart of the agent it begins at the node reached last."""

    def __init__(self, parts: RobotParts) -> None:
        self._parts = parts
        self._place: Pose | None = None
        self._node: tuple[str, int] | None = None
        self._order = ""
        self._since_node = 0.0
        self._in_order = 0.0

    def pose_changed(self) -> None:
        """Add the way from the last pose to the newest one."""
        pose = self._parts.senses.trusted_pose
        if pose is None:
            return
        step = _apart(self._place, pose) if self._place else 0.0
        if self._place is None or step >= JITTER:
            self._place = pose
        if JITTER <= step <= JUMP:
            self._since_node += step
            self._in_order += step

    def advance(self) -> None:
        """Begin anew at a node that is reached, and with another order."""
        progress = self._parts.progress
        node = (progress.last_node_id, progress.last_node_sequence_id)
        if progress.order_id != self._order:
            self._order, self._in_order, self._node = progress.order_id, 0.0, None
        if node != self._node:
            first, self._node = self._node is None, node
            self._since_node = self._from_node() if first else 0.0
            self._in_order += self._since_node

    @property
    def since_node(self) -> float | None:
        """Metres driven since the node reached last, None before the first one."""
        return self._since_node if self._parts.progress.last_node_id else None

    @property
    def to_goal(self) -> Way | None:
        """The way of the goal that is driven to, None: there is none."""
        parts, pose = self._parts, self._parts.senses.trusted_pose
        goal = parts.goal.pose
        if parts.goal.target is None or goal is None or pose is None:
            return None
        return Way(self._since_node, self._left_to(goal, pose))

    @property
    def recoveries(self) -> int:
        """How often navigation has had to recover on the drive under way, as far as it tells."""
        progress = self._parts.senses.progress
        return progress.recoveries if progress and self._parts.goal.target is not None else 0

    @property
    def to_end(self) -> Way | None:
        """The way of the order over its base, None: nothing is left of it."""
        progress, pose = self._parts.progress, self._parts.senses.trusted_pose
        node = progress.next_node
        place = node.node_position if node else None
        if node is None or place is None or pose is None:
            return None
        goal = self.to_goal
        first = goal.left if goal else dist((pose.x, pose.y), (place.x, place.y))
        return Way(self._in_order, first + progress.base_way.length_from(node.sequence_id))

    @property
    def plan(self) -> PlanReport | None:
        """The plan of navigation, where it leads to the goal that is driven to."""
        plan, goal = self._parts.senses.plan, self._parts.goal.pose
        if self._parts.goal.target is None or plan is None or goal is None:
            return None
        return plan if dist(plan.points[-1], (goal.x, goal.y)) <= PLAN_TOLERANCE else None

    def _left_to(self, goal: Pose, pose: Pose) -> float:
        """Give the way that is left to a goal: by the plan, else as navigation says it, else straight."""
        plan, progress = self.plan, self._parts.senses.progress
        if plan:
            return _along(plan, pose)
        return progress.left if progress else _apart(pose, goal)

    def _from_node(self) -> float:
        """Give the straight way from the last node to a robot that has left it."""
        progress, pose = self._parts.progress, self._parts.senses.trusted_pose
        place = progress.last_node.node_position if progress.last_node else None
        if place is None or pose is None or progress.on_last_node:
            return 0.0
        return dist((place.x, place.y), (pose.x, pose.y))


def _along(plan: PlanReport, pose: Pose) -> float:
    """Give the way that is left of ``plan``, from its point next to the robot on."""
    here = (pose.x, pose.y)
    nearest = min(range(len(plan.points)), key=lambda index: dist(plan.points[index], here))
    rest = plan.points[nearest:]
    return sum(dist(start, end) for start, end in pairwise(rest)) + dist(here, rest[0])


def _apart(one: Pose, other: Pose) -> float:
    return dist((one.x, one.y), (other.x, other.y))
