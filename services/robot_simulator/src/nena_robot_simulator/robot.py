"""The simulated robot without ROS: goals, poses, requests and time in, state out."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from uuid import UUID

from nena_robot_simulator import faults
from nena_robot_simulator.faults import AnyFault, Faults
from nena_robot_simulator.goals import (
    Action,
    CancelAnswer,
    ErrorCode,
    Snapshot,
    StatusArray,
    answer_cancel,
    of_several,
)
from nena_robot_simulator.motion import GridMap, Limits, Motion, Pose, step
from nena_robot_simulator.navigator import PLANNER_TOLERANCE, Drive, Goal, Navigator, Progress, Target
from nena_robot_simulator.sensors import Battery, Estimate, Localisation
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings

HALTING = (0.020, 0.050)
"""Minimum and maximum time that halting the behaviour tree takes, seconds."""
SEVERAL_SLOWER = 3.0
"""How much longer the replanning period of NavigateThroughPoses is than that of NavigateToPose."""
LONGEST_STEP = 0.02
"""Maximum step of the kinematics, seconds of the robot's time."""
LONGEST_PAUSE = 0.2
"""Maximum pause of this program that the robot catches up with, seconds; longer ones are skipped."""


@dataclass(frozen=True, slots=True)
class Feedback:
    """Progress of the drive for a goal: seconds since acceptance, remaining metres and poses."""

    goal_id: UUID
    pose: Pose
    seconds: float
    left: float
    speed: float
    recoveries: int
    places_left: int


class Robot:
    """One robot; all times are monotonic seconds, stamps UTC nanoseconds, poses in the map frame."""

    def __init__(
        self,
        settings: RobotSettings,
        simulator: SimulatorSettings,
        *,
        hall: GridMap,
        now: float,
        noise: random.Random,
    ) -> None:
        self.faults = Faults()
        self.battery = Battery(
            charge=settings.battery.charge,
            per_metre=settings.battery.drain_per_km / 1000.0,
            per_second=settings.battery.drain_per_hour / 3600.0,
        )
        self._settings = settings
        self._hall = hall
        self._time_factor = simulator.time_factor
        self._noise = noise
        self._limits = Limits(**settings.drive.model_dump())
        self._navigators = {action: self._navigator(action, simulator.result_timeout) for action in Action}
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
        self._stuck_for = 0.0
        self._advanced_at = now
        self._replan_period = simulator.replan_period / simulator.time_factor
        self._replan_at = now

    @property
    def pose(self) -> Pose:
        """The true pose."""
        return self._motion.pose

    @property
    def odometry(self) -> Pose:
        """The pose in the odometry frame, without jumps."""
        return self._odom_origin.inverse().then(self._motion.pose)

    @property
    def velocity(self) -> tuple[float, float]:
        """Forward m/s and counter-clockwise rad/s, as an observer with a wall clock sees them."""
        return self._motion.speed * self._time_factor, self._motion.yaw_rate * self._time_factor

    @property
    def active(self) -> bool:
        """Whether Nav2's lifecycle nodes are active."""
        return all(navigator.active for navigator in self._navigators.values())

    @property
    def resting(self) -> bool:
        """Whether the robot stands still without a goal; only a request can change that."""
        if self._drive is not None:
            return False
        return self._motion.standing and not any(each.busy for each in self._navigators.values())

    @property
    def drive(self) -> Drive | None:
        """The drive under way."""
        return self._drive

    def goals(self, action: Action) -> StatusArray:
        """Return the goals of an action."""
        return self._navigators[action].goals

    def take_goal(self, goal: Goal, accepted_ns: int, now: float, action: Action = Action.TO_POSE) -> bool:
        """Accept a goal; return False if it is rejected. A sender on the topic is not notified."""
        if self.faults.on(faults.RejectGoals):
            self.faults.spend(faults.RejectGoals)
            return False
        return self._navigators[action].take(goal, accepted_ns, now)

    def cancel(
        self, goal_id: UUID, stamp_ns: int, now: float, action: Action = Action.TO_POSE
    ) -> CancelAnswer:
        """Answer a CancelGoal request and act on it."""
        goals = self.goals(action)
        answer = answer_cancel(goals.entries(now), goal_id, stamp_ns)
        if answer.goals:
            goals.cancel([goal.goal_id for goal in answer.goals], now)
        return answer

    def cancel_controller(self) -> bool:
        """Cancel the goal of the controller, which the navigator did not do; return whether it had one."""
        if self._drive is None:
            return False
        self._drive.cancelled = not self.faults.on(faults.ControllerDeaf)
        return True

    def feedback(self, action: Action, now: float) -> Feedback | None:
        """Return the progress of an action's drive; None without a drive."""
        navigator, drive = self._navigators[action], self._drive
        if navigator.target is None or drive is None or self.faults.on(faults.NavigatorHung):
            return None
        stuck = self.faults.get(faults.Stuck)
        return Feedback(
            navigator.target.goal_id,
            self._shown(self.pose),
            seconds=now - navigator.began_at,
            left=drive.left(self.pose),
            speed=self.velocity[0],
            recoveries=int(self._stuck_for / stuck.recovery_after) if stuck else 0,
            places_left=drive.places_left,
        )

    def take_initial_pose(self, pose: Pose) -> None:
        """Move the robot to ``pose``, in truth and in its estimate."""
        odometry = self.odometry
        self._motion = Motion(pose, self._motion.speed, self._motion.yaw_rate)
        self._odom_origin = pose.then(odometry.inverse())
        self._localisation.initialise()

    def force_estimate(self) -> None:
        """Make the next scan yield an estimate even if the robot stands still."""
        self._localisation.force()

    def scan(self) -> Estimate | None:
        """Return AMCL's estimate after a laser scan; None if it publishes none."""
        if self.faults.on(faults.AmclSilent):
            return None
        estimate, lost = self._localisation.scan(self.pose), self.faults.get(faults.LocalisationLost)
        if estimate is not None and lost is not None:
            estimate = replace(estimate, xy_variance=lost.xy_deviation**2)
        return self._misplaced(estimate)

    def _misplaced(self, estimate: Estimate | None) -> Estimate | None:
        """Displace the estimate according to the active faults."""
        if estimate is None:
            return None
        pose = self._shown(estimate.pose)
        if self.faults.on(faults.NanPose):
            pose = Pose(math.nan, pose.y, pose.yaw)
        return replace(estimate, pose=pose)

    def _shown(self, pose: Pose) -> Pose:
        """Return the pose that AMCL reports for a robot at ``pose``."""
        jump = self.faults.get(faults.PoseJump)
        return Pose(pose.x + jump.x, pose.y + jump.y, pose.yaw) if jump else pose

    def apply(self, fault: AnyFault, *, goal_id: UUID, accepted_ns: int, now: float) -> None:
        """Start or end a fault; ``goal_id`` is the ID of the goal that a fault may send."""
        if isinstance(fault, faults.ForeignGoal):
            pose = Pose(fault.x, fault.y, fault.yaw)
            goal = Goal(goal_id, pose, self._settings.map_frame)
            self._navigators[Action.TO_POSE].take(goal, accepted_ns, now)
            return
        if isinstance(fault, faults.Freeze):
            return  # handled by the node
        self.faults.apply(fault)
        gone = self.faults.on(faults.Unconfigured) or self.faults.on(faults.NavigatorDied)
        idle = gone or self.faults.on(faults.Inactive) or self.faults.on(faults.BringUp)
        for navigator in self._navigators.values():
            if gone:
                navigator.restart()
            navigator.set_active(active=not idle)

    def advance(self, now: float) -> None:
        """Move on to ``now`` and go once round the navigator's loop."""
        seconds = min(now - self._advanced_at, LONGEST_PAUSE)
        self._advanced_at = now
        alone = self.faults.on(faults.NavigatorDied) or self.faults.on(faults.NavigatorHung)
        if not alone:
            self._follow(now)
        self._move(seconds * self._time_factor)
        if alone:
            self._end_alone()
            return
        if self._drive is not None and self.faults.on(faults.Stuck):
            self._stuck_for += seconds
        for navigator in self._navigators.values():
            drive = self._drive if navigator.driving else None
            if drive is None:
                navigator.tick(now, Progress.UNDERWAY)
            else:
                navigator.tick(now, drive.progress(self.pose), drive.error_code)
        self._follow(now)

    def take_unpublished(self, action: Action = Action.TO_POSE) -> list[Snapshot]:
        """Return the new status arrays of an action since the last call."""
        return self.goals(action).take_unpublished()

    def _navigator(self, action: Action, retention: float) -> Navigator:
        return Navigator(
            goals=StatusArray(retention),
            resolve=self._resolve,
            halting=lambda: self._noise.uniform(*HALTING),
            barred=lambda: any(
                other.driving for name, other in self._navigators.items() if name is not action
            ),
        )

    def _resolve(self, pose: Pose, frame_id: str) -> Pose | None:
        if not self._localisation.known:
            return None
        if math.isnan(pose.x):
            return pose  # not a position in any frame; the planner rejects it
        if frame_id == self._settings.odom_frame:
            return self._odom_origin.then(pose)
        return pose if frame_id == self._settings.map_frame else None

    def _end_alone(self) -> None:
        """Let a controller without a navigator end its drive where its path ends."""
        if self._drive is not None and self._drive.progress(self.pose) is not Progress.UNDERWAY:
            self._drive = None

    def _follow(self, now: float) -> None:
        """Plan a new drive where the target has changed, at the next turn of the tree's replanning clock."""
        targets = (
            (action, navigator.target)
            for action, navigator in self._navigators.items()
            if navigator.target is not None
        )
        action, target = next(targets, (Action.TO_POSE, None))
        several = action is Action.THROUGH_POSES
        if target is None:
            self._drive = None
            return
        replans = self._drive is None or now >= self._replan_at
        if replans:
            slowness = SEVERAL_SLOWER if several else 1.0
            self._replan_at = now + self._replan_period * slowness
        if replans and (self._drive is None or self._drive.target != target):
            self._drive = self._planned(target, several=several)
            self._stuck_for = 0.0

    def _planned(self, target: Target, *, several: bool) -> Drive:
        end, code = self._end_of(target)
        abort = self.faults.get(faults.AbortHalfway)
        self.faults.spend(faults.AbortHalfway)
        if end is not None and abort is not None:
            code = abort.error_code
        return Drive(
            target,
            self.pose,
            end,
            abort_after=None if abort is None else abort.fraction,
            error_code=of_several(code) if several else code,
        )

    def _end_of(self, target: Target) -> tuple[Pose | None, int]:
        """Return the end of the planner's path to a target, or the error code without one."""
        if math.isnan(target.pose.x):
            return None, ErrorCode.NO_VIAPOINTS_GIVEN
        unreachable = self.faults.get(faults.Unreachable)
        if unreachable is not None and any(map(unreachable.concerns, (*target.via, target.pose))):
            self.faults.spend(faults.Unreachable)
            return None, unreachable.error_code
        end = self._hall.free_near(target.pose, PLANNER_TOLERANCE)
        if end is not None:
            return end, ErrorCode.NONE
        inside = self._hall.covers(target.pose.x, target.pose.y)
        return None, ErrorCode.GOAL_OCCUPIED if inside else ErrorCode.GOAL_OUTSIDE_MAP

    def _move(self, seconds: float) -> None:
        """Move the robot for ``seconds`` of its own time."""
        stuck = self.faults.on(faults.Stuck)
        before = self.pose
        steps = max(1, math.ceil(seconds / LONGEST_STEP))
        for _ in range(steps):
            towards, behind = None, 0.0
            if self._drive is not None and not stuck:
                towards, behind = self._drive.next_place, self._drive.behind
            self._motion = step(self._motion, towards, self._limits, seconds / steps, behind=behind)
            if self._drive is not None:
                self._drive.move_to(self.pose)
        self.battery.drain(before.distance(self.pose), seconds)
