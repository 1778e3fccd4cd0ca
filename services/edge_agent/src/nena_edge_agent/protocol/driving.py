"""The goal that the driver has, and how the next one is made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2

from nena_edge_agent.driver.port import DriveGoal, OwnGoals, Pose
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.geometry import distance, radius
from nena_shared.vda5050.order import NodePosition

HALT_PATIENCE = 5.0
"""Seconds after which a halt without an answer is asked for again."""


@dataclass(slots=True)
class GoalInFlight:
    """What the driver was told last.

    ``target`` is the sequenceId of the node that it drives to, None: it has no goal. ``halting_since`` is the
    time in s when it was asked to stop and has not answered; ``halt_problem`` says why it cannot be shown to
    stand, where the driver has said so. ``failed_at`` is the sequenceId of a node that
    was not reached; it is not tried again until the order changes. ``failures`` are the drives to the next
    node that have failed and are tried again, at ``retry_at`` in s; ``problem`` says why the last one did.
    ``pose`` is where the last goal led to, ``ahead`` the places that it was told come behind, ``own`` what
    navigation has or may have of our goals, and ``listed_ids`` those that it listed last. ``unsettled``: what
    they have come to has not been told yet.
    """

    generation: int = 0
    target: int | None = None
    halting_since: float | None = None
    halt_problem: str = ""
    failed_at: int | None = None
    failures: int = 0
    retry_at: float | None = None
    problem: str = ""
    pose: Pose | None = None
    ahead: tuple[Pose, ...] = ()
    own: OwnGoals | None = None
    listed_ids: tuple[str, ...] = ()
    unsettled: bool = False

    def listed(self, goal_ids: tuple[str, ...]) -> None:
        """Note which goals of ours navigation drives to; a new one is the one that was given last."""
        own, self.listed_ids = self.own, goal_ids
        if not goal_ids:
            self.own = own if self.unsettled else None  # what they have come to is told in a moment
        elif own and set(goal_ids) <= set(own.goal_ids):
            self.own = replace(own, goal_ids=goal_ids)
        else:
            self.own = OwnGoals(goal_ids, self.pose) if self.pose else None

    def give(self, pose: Pose, behind: str) -> None:
        """Note that a goal to ``pose`` is about to be given, and which goal is listed last before it.

        An earlier run may have given it already: then it is listed behind what was listed at that time.
        """
        own = self.own or OwnGoals((), pose)
        again = self.unsettled and own.given is not None and _place(own.given) == _place(pose)
        self.own = OwnGoals(own.goal_ids, own.pose, pose, own.behind if again else behind)
        self.pose, self.unsettled = pose, True

    def settle(self) -> None:
        """Note that the drive is over; goals that navigation still drives to are ours as before."""
        self.unsettled = False
        if self.own:
            self.own = OwnGoals(self.listed_ids, self.own.pose) if self.listed_ids else None

    def forget_failures(self) -> None:
        """Begin anew: another node is driven to, or the order has changed."""
        self.failed_at, self.failures, self.retry_at, self.problem = None, 0, None, ""

    def retry(self, at: float, problem: str) -> None:
        """Note that the drive has failed and is tried again ``at`` a time in s."""
        self.target, self.failures, self.retry_at, self.problem = None, self.failures + 1, at, problem

    def restore(self, own: OwnGoals) -> None:
        """Take over what an earlier run knew; what has become of it is not told yet."""
        self.own, self.pose, self.unsettled = own, own.given or own.pose, True

    @property
    def moving(self) -> bool:
        """Whether the robot drives or has not stopped yet."""
        return self.target is not None or self.halting_since is not None

    @property
    def halting(self) -> bool:
        """Whether a halt has not been answered."""
        return self.halting_since is not None

    def is_current(self, generation: int) -> bool:
        """Tell whether an event of ``generation`` is about the goal that the driver has now."""
        return self.target is not None and generation == self.generation


def make_goal(
    position: NodePosition,
    pose: Pose,
    capabilities: Capabilities,
    *,
    generation: int,
    maximum_speed: float | None,
    ahead: tuple[Pose, ...] = (),
) -> DriveGoal:
    """Make the goal for ``position``; where no heading is demanded the robot arrives looking ahead."""
    demanded = position.theta is not None
    allowed = position.allowed_deviation_theta or capabilities.default_deviation_theta
    theta = position.theta if position.theta is not None else heading(pose, position)
    return DriveGoal(
        generation=generation,
        pose=Pose(position.x, position.y, theta, position.map_id),
        deviation_xy=radius(position, capabilities.default_deviation_xy),
        deviation_theta=allowed if demanded else None,
        maximum_speed=maximum_speed,
        ahead=ahead,
    )


def _place(pose: Pose) -> tuple[float, float, str]:
    return pose.x, pose.y, pose.map_id


def heading(pose: Pose, position: NodePosition) -> float:
    """Give the direction from ``pose`` to ``position``; on the spot that is the robot's own."""
    if distance(pose, position) == 0:
        return pose.theta
    return atan2(position.y - pose.y, position.x - pose.x)
