"""The simulated robot as a whole, without ROS: goals, poses, requests and the time go in, state comes out."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from uuid import UUID

from nena_robot_simulator import cancel, faults
from nena_robot_simulator.battery import Battery
from nena_robot_simulator.drive import PLANNER_TOLERANCE, Drive
from nena_robot_simulator.faults import AnyFault, Faults
from nena_robot_simulator.grid_map import GridMap
from nena_robot_simulator.kinematics import Limits, Motion, step
from nena_robot_simulator.localisation import Estimate, Localisation
from nena_robot_simulator.navigator import Goal, Navigator, Progress, Target
from nena_robot_simulator.pose import Pose
from nena_robot_simulator.settings import RobotSettings
from nena_robot_simulator.status_array import Snapshot, StatusArray

HALTING = (0.020, 0.050)
"""Least and most seconds that halting the behaviour tree takes."""
LONGEST_STEP = 0.02
"""Seconds of the robot's time that one step of the kinematics covers at most."""
LONGEST_PAUSE = 0.2
"""Seconds of standstill of this program that the robot makes up for; it does not jump after a longer one."""


class Robot:
    """One robot; all times are monotonic seconds, stamps UTC nanoseconds, poses in the map frame."""

    def __init__(
        self,
        settings: RobotSettings,
        *,
        hall: GridMap,
        time_factor: float,
        retention: float,
        now: float,
        noise: random.Random,
    ) -> None:
        self.faults = Faults()
        self.goals = StatusArray(retention)
        self.battery = Battery(
            charge=settings.battery.charge,
            per_metre=settings.battery.drain_per_km / 1000.0,
            per_second=settings.battery.drain_per_hour / 3600.0,
        )
        self._settings = settings
        self._hall = hall
        self._time_factor = time_factor
        self._noise = noise
        self._limits = Limits(**settings.drive.model_dump())
        self._navigator = Navigator(
            goals=self.goals, resolve=self._resolve, halting=lambda: noise.uniform(*HALTING)
        )
        self._localisation = Localisation(
            known=settings.localisation.known_at_start,
            xy_deviation=settings.localisation.xy_deviation,
            yaw_deviation=settings.localisation.yaw_deviation,
            noise=noise,
        )
        start = Pose(**settings.start.model_dump())
        self._motion = Motion(start)
        self._odom_origin = start
        self._drive: Drive | None = None
        self._advanced_at = now

    @property
    def pose(self) -> Pose:
        """Where the robot really is."""
        return self._motion.pose

    @property
    def odometry(self) -> Pose:
        """Where the odometry sees the robot: in its own frame, without jumps."""
        return self._odom_origin.inverse().then(self._motion.pose)

    @property
    def velocity(self) -> tuple[float, float]:
        """Forward m/s and counter-clockwise rad/s, as an observer with a wall clock sees them."""
        return self._motion.speed * self._time_factor, self._motion.yaw_rate * self._time_factor

    @property
    def active(self) -> bool:
        """Whether Nav2's lifecycle nodes are active."""
        return self._navigator.active

    @property
    def resting(self) -> bool:
        """Whether the robot stands and has no goal: only a request can change that."""
        return self._motion.standing and not self._navigator.busy

    @property
    def drive(self) -> Drive | None:
        """The drive under way."""
        return self._drive

    def take_goal(self, goal_id: UUID, pose: Pose, frame_id: str, accepted_ns: int, now: float) -> bool:
        """Take a goal as from the topic; False when it vanishes without a trace."""
        if self.faults.on(faults.RejectGoals):
            self.faults.spend(faults.RejectGoals)
            return False
        return self._navigator.take(Goal(goal_id, pose, frame_id), accepted_ns, now)

    def cancel(self, goal_id: UUID, stamp_ns: int, now: float) -> cancel.CancelAnswer:
        """Answer a CancelGoal request and act on it."""
        answer = cancel.answer(self.goals.entries(now), goal_id, stamp_ns)
        if answer.goals:
            self.goals.cancel([goal.goal_id for goal in answer.goals], now)
        return answer

    def take_initial_pose(self, pose: Pose) -> None:
        """Put the robot to ``pose``: it stands, and believes to stand, where it was told to be."""
        odometry = self.odometry
        self._motion = Motion(pose, self._motion.speed, self._motion.yaw_rate)
        self._odom_origin = pose.then(odometry.inverse())
        self._localisation.initialise()

    def force_estimate(self) -> None:
        """Let the next scan give an estimate although the robot stands."""
        self._localisation.force()

    def scan(self) -> Estimate | None:
        """Give the estimate of a laser scan made now; none when AMCL has nothing to say."""
        if self.faults.on(faults.AmclSilent):
            return None
        estimate, lost = self._localisation.scan(self.pose), self.faults.get(faults.LocalisationLost)
        if estimate is not None and lost is not None:
            estimate = replace(estimate, xy_variance=lost.xy_deviation**2)
        return self._misplaced(estimate)

    def _misplaced(self, estimate: Estimate | None) -> Estimate | None:
        """Put the estimate where a fault wants it."""
        jump = self.faults.get(faults.PoseJump)
        dx, dy = (jump.x, jump.y) if jump else (0.0, 0.0)
        if self.faults.on(faults.NanPose):
            dx = math.nan
        if estimate is None or not (dx or dy):
            return estimate
        pose = estimate.pose
        return replace(estimate, pose=Pose(pose.x + dx, pose.y + dy, pose.yaw))

    def apply(self, fault: AnyFault, *, goal_id: UUID, accepted_ns: int, now: float) -> None:
        """Let a fault begin or end; ``goal_id`` is for a goal that the fault may bring."""
        if isinstance(fault, faults.ForeignGoal):
            pose = Pose(fault.x, fault.y, fault.yaw)
            self._navigator.take(Goal(goal_id, pose, self._settings.map_frame), accepted_ns, now)
            return
        if isinstance(fault, faults.Freeze):
            return  # the node has hung already
        self.faults.apply(fault)
        if self.faults.on(faults.Unconfigured):
            self._navigator.restart()
        idle = self.faults.on(faults.Inactive) or self.faults.on(faults.Unconfigured)
        self._navigator.set_active(active=not idle)

    def advance(self, now: float) -> None:
        """Move on to ``now`` and go once round the navigator's loop."""
        seconds = min(now - self._advanced_at, LONGEST_PAUSE)
        self._advanced_at = now
        self._follow(self._navigator.target)
        self._move(seconds * self._time_factor)
        self._navigator.tick(now, self._drive.progress(self.pose) if self._drive else Progress.UNDERWAY)
        self._follow(self._navigator.target)

    def take_unpublished(self) -> list[Snapshot]:
        """Give the status arrays that came about since the last call."""
        return self.goals.take_unpublished()

    def _resolve(self, goal: Goal) -> Pose | None:
        if not self._localisation.known:
            return None
        if goal.frame_id == self._settings.odom_frame:
            return self._odom_origin.then(goal.pose)
        return goal.pose if goal.frame_id == self._settings.map_frame else None

    def _follow(self, target: Target | None) -> None:
        """Plan a new drive where the target has changed."""
        if target is None:
            self._drive = None
        elif self._drive is None or self._drive.target != target:
            self._drive = self._planned(target)

    def _planned(self, target: Target) -> Drive:
        end = self._hall.free_near(target.pose, PLANNER_TOLERANCE)
        unreachable = self.faults.get(faults.Unreachable)
        if unreachable is not None and unreachable.concerns(target.pose):
            self.faults.spend(faults.Unreachable)
            end = None
        abort = self.faults.get(faults.AbortHalfway)
        self.faults.spend(faults.AbortHalfway)
        return Drive(target, self.pose, end, abort_after=None if abort is None else abort.fraction)

    def _move(self, seconds: float) -> None:
        """Let the robot move for ``seconds`` of its own time."""
        stuck = self.faults.on(faults.Stuck)
        before = self.pose
        steps = max(1, math.ceil(seconds / LONGEST_STEP))
        for _ in range(steps):
            towards = self._drive.end if self._drive is not None and not stuck else None
            self._motion = step(self._motion, towards, self._limits, seconds / steps)
            if self._drive is not None:
                self._drive.move_to(self.pose)
        self.battery.drain(before.distance(self.pose), seconds)
