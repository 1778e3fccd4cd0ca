"""The simulated robot without ROS: goals, poses, requests and time in, state out."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from uuid import UUID

from nena_robot_simulator import faults
from nena_robot_simulator.faults import AnyFault, Faults
from nena_robot_simulator.goals import (
    ANY_GOAL,
    Action,
    CancelAnswer,
    ErrorCode,
    Snapshot,
    StatusArray,
    answer_cancel,
    of_several,
)
from nena_robot_simulator.motion import GridMap, Limits, Motion, Pose, command_to, obey
from nena_robot_simulator.navigator import (
    FOLLOWED_WITHIN,
    Drive,
    DriveFailure,
    Goal,
    Navigator,
    Progress,
    Recovery,
    Target,
)
from nena_robot_simulator.sensors import Battery, Estimate, Localisation
from nena_robot_simulator.servers import STOPPING, LifecycleState, Server, Servers
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings

# Each halted node of the tree waits for its server, by default up to twice 20 ms.
HALTING = (0.020, 0.050)
"""Minimum and maximum time that halting the behaviour tree takes, seconds."""
# Nav2's default trees replan at 1 Hz and 0.33 Hz.
SEVERAL_SLOWER = 3.0
"""How much longer the replanning period of NavigateThroughPoses is than that of NavigateToPose."""
TRANSFORM_TIMEOUT = 1.0
"""Time without a localisation after which the controller fails, seconds."""
TRANSFORM_BUFFER = 10.0
"""Time for which Nav2 keeps transforms, seconds."""
TRANSFORM_AHEAD = 1.0
"""Time by which AMCL dates its transform ahead (``transform_tolerance``), seconds."""
NO_PATH_YET = 0.02
"""Time during which the feedback of a new goal has no path, seconds."""
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
        self.servers = Servers()
        self.battery = Battery(
            charge=settings.battery.charge,
            per_metre=settings.battery.drain_per_km / 1000.0,
            per_second=settings.battery.drain_per_hour / 3600.0,
        )
        self._settings = settings
        self._hall = hall
        self._time_factor = simulator.time_factor
        self._noise = noise
        self._own_limits = self._limits = Limits(**settings.drive.model_dump(exclude={"command_timeout"}))
        self._navigators = {
            action: self._make_navigator(action, simulator.result_timeout) for action in Action
        }
        self._localisation = Localisation(
            known=settings.localisation.known_at_start,
            xy_deviation=settings.localisation.xy_deviation,
            yaw_deviation=settings.localisation.yaw_deviation,
            noise=noise,
        )
        start = Pose(**settings.start.model_dump())
        self._motion = Motion(start)
        self._odom_origin = start
        self._mask: GridMap | None = None
        self._drive: Drive | None = None
        self._driven_for = Action.TO_POSE
        self._alone = False
        """Whether the controller drives for a navigator that has died."""
        self._followed: UUID | None = None
        self._target_seen: UUID | None = None
        self._path_from = now
        self.behaviour: tuple[float, float] | None = None
        """Velocity commanded by a behaviour or the docking server, m/s and rad/s; None: no command."""
        self.docked = False
        self._stuck_for = self._unlocalised_for = 0.0
        self._transform_from = now
        """Start of the transforms that Nav2 has."""
        self._poses_left = 1
        self._command = (0.0, 0.0)
        """Last command to the base, m/s and rad/s."""
        self._commander: Server | None = None
        """The server that gave it and has not ended it yet."""
        self._advanced_at = self._commanded_at = now
        self._server_timeout = simulator.server_timeout
        self._recovery_time = simulator.recovery_time
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
    def map_to_odometry(self) -> Pose | None:
        """The odometry frame in the map frame, as published by the localisation; None if it is not."""
        works = self._localisation.known and self.servers.works(Server.LOCALISATION)
        return self._odom_origin if works and not self.faults.on(faults.AmclSilent) else None

    @property
    def velocity(self) -> tuple[float, float]:
        """Forward m/s and counter-clockwise rad/s, as measured with a wall clock."""
        return self._motion.speed * self._time_factor, self._motion.yaw_rate * self._time_factor

    @property
    def resting(self) -> bool:
        """Return whether the robot is at standstill without a goal; only a request can change that."""
        if self._drive is not None or self.behaviour is not None:
            return False
        return self._motion.standing and not any(navigator.busy for navigator in self._navigators.values())

    @property
    def drive(self) -> Drive | None:
        """The current drive."""
        return self._drive

    def goals(self, action: Action) -> StatusArray:
        """Return the goals of an action."""
        return self._navigators[action].goals

    def take_goal(self, goal: Goal, accepted_ns: int, now: float, action: Action = Action.TO_POSE) -> bool:
        """Accept a goal; return False if it is rejected. A sender on the topic is not notified."""
        if self.faults.on(faults.RejectGoals):
            self.faults.spend(faults.RejectGoals)
            return False
        if not self._navigators[action].take(goal, accepted_ns, now):
            return False
        for other, navigator in self._navigators.items():  # the controller has one goal
            if (other is Action.FOLLOW_PATH) is not (action is Action.FOLLOW_PATH) and navigator.busy:
                navigator.abort(now)
        return True

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
        """Cancel the controller's goal, without the navigator; return whether it had one."""
        of_path = self._driven_for is Action.FOLLOW_PATH
        if self._drive is None or self._drive.recovery is not None or of_path:
            return False
        self._drive.cancelled = not self.faults.on(faults.ControllerDeaf)
        return True

    def cancel_recovery(self) -> bool:
        """Cancel the goal of the behaviour server; return whether it had one."""
        if self._drive is None or self._drive.recovery is None:
            return False
        self._drive.recovery = None
        return True

    def feedback(self, action: Action, now: float) -> Feedback | None:
        """Return the progress of an action's drive; None without a drive."""
        navigator, drive = self._navigators[action], self._drive
        if navigator.target is None or drive is None or not self.servers.runs(_server_of(action)):
            return None
        stuck = self.faults.get(faults.Stuck)
        recoveries = int(self._stuck_for / stuck.recovery_after) if stuck else 0
        if drive.recovery is not None:
            recoveries = drive.recovery.count(now)
        seconds = now - navigator.began_at
        return Feedback(
            navigator.target.goal_id,
            self._reported_pose(self.pose),
            seconds=seconds,
            # Measured: 0.00 in the first message, and as long as there is no path.
            left=drive.left(self.pose) if now >= self._path_from else 0.0,
            speed=self.velocity[0],
            recoveries=recoveries,
            places_left=self._poses_left,
        )

    def plan(
        self, places: tuple[Pose, ...], frame_id: str, start: Pose | None, *, several: bool
    ) -> tuple[list[Pose], int]:
        """Return the planner's path over places, or an error code without one; ``start`` None: the robot."""
        poses, code = self._path_of(places, frame_id, start) if places else ([], ErrorCode.NO_VIAPOINTS_GIVEN)
        return poses, of_several(code) if several else code

    def _path_of(self, places: tuple[Pose, ...], frame_id: str, start: Pose | None) -> tuple[list[Pose], int]:
        resolved = [self._resolve_pose(place, frame_id) for place in places]
        way = [place for place in resolved if place is not None]
        begin = start or self.pose
        if len(way) < len(resolved):
            return [], ErrorCode.PLANNER_TF
        if not self._hall.covers(begin.x, begin.y):
            return [], ErrorCode.START_OUTSIDE_MAP
        target = Target(ANY_GOAL, way[-1], tuple(way[:-1]))
        end, code = self._end_of(target)
        return ([], code) if end is None else (Drive(target, begin, end).plan(begin), ErrorCode.NONE)

    def use_map(self, hall: GridMap) -> None:
        """Plan on another map."""
        self._hall = hall

    def keep_out(self, mask: GridMap) -> None:
        """Plan no path to a position that the mask of the costmaps' filter forbids."""
        self._mask = mask

    def limit_speed(self, limit: float, *, percentage: bool) -> None:
        """Limit the speed to ``limit``, m/s or percent of the robot's own speed; 0 removes the limit."""
        own = self._own_limits.speed
        # Measured with Regulated Pure Pursuit: 150 % is faster, and a negative limit drives backwards.
        speed = own * limit / 100.0 if percentage else limit
        self._limits = replace(self._own_limits, speed=speed or own)

    def take_initial_pose(self, pose: Pose) -> None:
        """Move the robot to ``pose``, both its true and its estimated pose."""
        odometry = self.odometry
        self._motion = Motion(pose, self._motion.speed, self._motion.yaw_rate)
        # REP 105: odom must not jump, so the correction is in map -> odom.
        self._odom_origin = pose.then(odometry.inverse())
        self._localisation.initialise()

    @property
    def commanded(self) -> bool:
        """Whether a server commands the base."""
        return self._drive is not None or self.behaviour is not None

    def force_estimate(self) -> None:
        """Make the next scan yield an estimate even at standstill."""
        self._localisation.force()

    def scan(self) -> Estimate | None:
        """Return AMCL's estimate after a laser scan; None if it publishes none."""
        if self.faults.on(faults.AmclSilent) or not self.servers.works(Server.LOCALISATION):
            return None
        estimate, lost = self._localisation.scan(self.pose), self.faults.get(faults.LocalisationLost)
        if estimate is not None and lost is not None:
            estimate = replace(estimate, xy_variance=lost.xy_deviation**2)
        return self._misplace_estimate(estimate)

    def _misplace_estimate(self, estimate: Estimate | None) -> Estimate | None:
        """Displace the estimate according to the active faults."""
        if estimate is None:
            return None
        pose = self._reported_pose(estimate.pose)
        if self.faults.on(faults.NanPose):
            pose = Pose(math.nan, pose.y, pose.yaw)
        return replace(estimate, pose=pose)

    def _reported_pose(self, pose: Pose) -> Pose:
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
        if isinstance(fault, faults.ServerDied):
            listed_until = now + fault.lease if fault.lease else 0.0
            self.servers.set_dead(fault.server, dead=fault.active, listed_until=listed_until)
        elif isinstance(fault, faults.Nav2Stopped):
            for server in Server:
                self.servers.set_dead(server, dead=fault.active)
        elif isinstance(fault, faults.ServerHung):
            self.servers.set_hung(fault.server, hung=fault.active)
        else:
            self.faults.apply(fault)
        if isinstance(fault, faults.Inactive | faults.BringUp):
            idle = self.faults.on(faults.Inactive) or self.faults.on(faults.BringUp)
            state = LifecycleState.INACTIVE if idle else LifecycleState.ACTIVE
            self.servers.set_group(Server.MANAGER, state)
        if isinstance(fault, faults.Unconfigured):
            state = LifecycleState.UNCONFIGURED if fault.active else LifecycleState.ACTIVE
            self.servers.set_state(Server.NAVIGATOR, state)
        self.set_navigators()

    def set_navigators(self) -> None:
        """Let the action servers accept goals according to the lifecycle of their processes.

        A localisation that is not configured has no pose.
        """
        if not self.servers.configured(Server.LOCALISATION):
            self._localisation.forget()
        for action, navigator in self._navigators.items():
            server = _server_of(action)
            gone = not self.servers.configured(server)
            if gone:
                navigator.restart()
                if server is Server.CONTROLLER:
                    # speed_limit is not latched: a new controller has no limit until the next message.
                    self._limits = self._own_limits
            active = self.servers.state(server) is LifecycleState.ACTIVE
            navigator.set_active(active=active and not gone)

    def manage(
        self,
        manager: Server,
        command: int,
        now: float,
        *,
        on_goals_ended: Callable[[], None] = lambda: None,
    ) -> bool:
        """Execute a client's command to a lifecycle manager; return whether that succeeded.

        If the servers that drive are stopped, all goals end first; ``on_goals_ended`` is called before the
        servers forget them.
        """
        if manager is Server.MANAGER and command in STOPPING:
            for navigator in self._navigators.values():
                navigator.abort(now)
            if self.servers.works(Server.CONTROLLER):  # it stops the base when it is deactivated
                self._commander, self._command = None, (0.0, 0.0)
        on_goals_ended()
        done = self.servers.manage(manager, command)
        self.set_navigators()
        return done

    def advance(self, now: float) -> bool:
        """Advance to ``now`` and run one cycle of the navigator's loop.

        Return whether the lifecycle of a server has changed.
        """
        seconds = min(now - self._advanced_at, LONGEST_PAUSE)
        self._advanced_at = now
        if changed := self.servers.advance(now):
            self.set_navigators()
        self._follow_target(now)
        self._look_for_answers(now)
        self._look_for_transform(seconds, now)
        self._move_robot(seconds * self._time_factor, now)
        own = self._driven_for is Action.FOLLOW_PATH
        if self._tree_lost:
            # Measured: the controller drives its path to the end, and no bond stops it.
            self._alone = self._drive is not None and not own
        if not own and (self._alone or not self.servers.runs(Server.NAVIGATOR)):
            self._end_alone(now)
        if self._drive is not None and self.faults.on(faults.Stuck):
            self._stuck_for += seconds
        for action, navigator in self._navigators.items():
            if not self.servers.runs(_server_of(action)):
                continue
            own = (action is Action.FOLLOW_PATH) is (self._driven_for is Action.FOLLOW_PATH)
            drive = self._drive if navigator.driving and own else None
            if drive is None:
                navigator.tick(now, Progress.UNDERWAY)
                continue
            progress = drive.progress(self.pose, now)
            failed = progress is Progress.FAILED or drive.end is None
            navigator.tick(now, progress, drive.error_code if failed else ErrorCode.NONE)
        self._follow_target(now)
        return changed

    def take_unpublished(self, action: Action = Action.TO_POSE) -> list[Snapshot]:
        """Return the new status arrays of an action since the last call."""
        return self.goals(action).take_unpublished()

    def _make_navigator(self, action: Action, retention: float) -> Navigator:
        return Navigator(
            goals=StatusArray(retention),
            resolve=self._resolve_pose,
            halting=lambda: self._noise.uniform(*HALTING),
            barred=lambda: any(
                other.driving
                for name, other in self._navigators.items()
                if name is not action and Action.FOLLOW_PATH not in (name, action)
            ),
        )

    def _resolve_pose(self, pose: Pose, frame_id: str) -> Pose | None:
        if not self._localisation.known or not self.servers.works(Server.LOCALISATION):
            return None
        if math.isnan(pose.x):
            return pose  # not a position in any frame; the planner rejects it
        if frame_id == self._settings.odom_frame:
            return self._odom_origin.then(pose)
        return pose if frame_id == self._settings.map_frame else None

    def _look_for_answers(self, now: float) -> None:
        """Make the behaviour tree fail, without a code, if a server that it called is silent for too long."""
        called_at = self._drive.unanswered_at if self._drive is not None and not self._alone else None
        if self._drive is not None and called_at is not None and now - called_at >= self._server_timeout:
            # Measured: the goal ends ABORTED with code 0, because no server has returned one.
            self._drive.fail(ErrorCode.NONE)

    def _look_for_transform(self, seconds: float, now: float) -> None:
        """Make the controller give up if the robot has had no position for a while.

        AMCL dates its transforms ahead: if Nav2 has no older one, it has none at first.
        """
        lost = not self._localisation.known or not self.servers.works(Server.LOCALISATION)
        # Measured: after such an outage, a goal in the first second ends ABORTED with 102.
        if not lost and self._unlocalised_for >= TRANSFORM_BUFFER:
            self._transform_from = now + TRANSFORM_AHEAD
        self._unlocalised_for = self._unlocalised_for + seconds if lost else 0.0
        missing = self._unlocalised_for >= TRANSFORM_TIMEOUT or now < self._transform_from
        if self._drive is not None and missing:
            self._drive.fail(ErrorCode.CONTROLLER_TF)

    @property
    def _tree_lost(self) -> bool:
        """Whether bt_navigator has died or is not configured; after a restart of Nav2 nothing drives."""
        restarted = self.faults.on(faults.Unconfigured)
        return not restarted and not self.servers.configured(Server.NAVIGATOR)

    def _end_alone(self, now: float) -> None:
        """End the drive of a controller without a navigator at the end of its path."""
        drive, driven = self._drive, self.servers.works(Server.CONTROLLER)
        if drive is not None and not (driven and drive.progress(self.pose, now) is Progress.UNDERWAY):
            self._drive, self._alone = None, False

    def _follow_target(self, now: float) -> None:
        """Plan a new drive if the target has changed, at the next tick of the tree's replanning clock."""
        path = self._navigators[Action.FOLLOW_PATH].target
        if path is not None:
            self._see_goal(path, now)
            self._follow_path(path)
            return
        if self._driven_for is Action.FOLLOW_PATH:
            self._drive, self._driven_for, self._followed = None, Action.TO_POSE, None
        if self._tree_lost or not self.servers.runs(Server.NAVIGATOR):
            return
        targets = (
            (action, navigator.target)
            for action, navigator in self._navigators.items()
            if navigator.target is not None
        )
        action, target = next(targets, (Action.TO_POSE, None))
        several = action is Action.THROUGH_POSES
        if target is None:
            self._drive = self._drive if self._alone else None
            return
        self._see_goal(target, now)
        # Measured: a new goal does not reset the clock of the tree. Until its next tick the old path is
        # driven, and if that ends first, the new goal has succeeded.
        replans = self._drive is None or self._alone or now >= self._replan_at
        if not replans:
            return
        self._replan_at = now + self._replan_period * (SEVERAL_SLOWER if several else 1.0)
        drive = self._drive
        if drive is None or drive.target != target:
            drive = self._drive = self._plan_drive(target, several=several, now=now)
            self._stuck_for, self._alone = 0.0, False
        answered = self.servers.works(Server.PLANNER) and self.servers.works(Server.CONTROLLER)
        # The tree calls its servers when it replans, so one that has died is missed only then.
        drive.unanswered_at = None if answered else drive.unanswered_at or now
        self._poses_left = drive.places_left

    def _see_goal(self, target: Target, now: float) -> None:
        """Note that the navigator's loop has a new goal, on a busy computer long after its acceptance.

        Its feedback has its number of poses at once, and the path of the goal before until it has its own.
        """
        if self._target_seen == target.goal_id:
            return
        self._target_seen, self._poses_left = target.goal_id, len(target.via) + 1
        if self._drive is None:
            self._path_from = now + NO_PATH_YET

    def _follow_path(self, target: Target) -> None:
        """Drive along a path sent to the controller, from the path's nearest position; no plan is needed."""
        if self._driven_for is Action.FOLLOW_PATH and self._followed == target.goal_id:
            return
        self._followed = target.goal_id
        nearest = min(range(len(target.via)), key=lambda i: self.pose.distance(target.via[i]), default=0)
        target = target._replace(via=target.via[nearest:])
        abort = self.faults.get(faults.AbortHalfway)
        self.faults.spend(faults.AbortHalfway)
        failure = DriveFailure(abort.error_code, abort.fraction) if abort is not None else DriveFailure()
        tolerances = (self._settings.tolerance.xy, self._settings.tolerance.yaw)
        self._drive = Drive(
            target,
            self.pose,
            target.pose,
            failure=failure,
            tolerances=tolerances,
            passed_within=FOLLOWED_WITHIN,
        )
        self._driven_for, self._stuck_for = Action.FOLLOW_PATH, 0.0

    def _plan_drive(self, target: Target, *, several: bool, now: float) -> Drive:
        end, code = self._end_of(target)
        abort = self.faults.get(faults.AbortHalfway)
        self.faults.spend(faults.AbortHalfway)
        if end is not None and abort is not None:
            code = abort.error_code
        # Measured: recoveries precede 208 only; outside the map, the goal ends after 0.1 s (204).
        recovers = end is None and code == ErrorCode.NO_VALID_PATH and self.servers.works(Server.BEHAVIOURS)
        return Drive(
            target,
            self.pose,
            end,
            failure=DriveFailure(
                error_code=of_several(code) if several else code,
                abort_after=None if abort is None else abort.fraction,
                recovery=Recovery(now, self._recovery_time, self._time_factor)
                if recovers and self._recovery_time > 0
                else None,
            ),
            tolerances=(self._settings.tolerance.xy, self._settings.tolerance.yaw),
        )

    def _end_of(self, target: Target) -> tuple[Pose | None, int]:
        """Return the end of the planner's path to a target, or the error code without one."""
        if math.isnan(target.pose.x):
            # messages.NOWHERE: a goal without poses.
            return None, ErrorCode.NO_VIAPOINTS_GIVEN
        if not self.servers.works(Server.PLANNER):
            return None, ErrorCode.NONE
        unreachable = self.faults.get(faults.Unreachable)
        if unreachable is not None and any(map(unreachable.concerns, (*target.via, target.pose))):
            self.faults.spend(faults.Unreachable)
            return None, unreachable.error_code
        tolerance = self._settings.tolerance.planner
        if not all(self._hall.free_near(place, tolerance, self._mask) for place in target.via):
            return None, ErrorCode.NO_VALID_PATH
        end = self._hall.free_near(target.pose, tolerance, self._mask)
        if end is not None:
            return end, ErrorCode.NONE
        inside = self._hall.covers(target.pose.x, target.pose.y)
        return None, ErrorCode.NO_VALID_PATH if inside else ErrorCode.GOAL_OUTSIDE_MAP

    def _move_robot(self, seconds: float, now: float) -> None:
        """Move the robot for ``seconds`` of its own time."""
        before = self.pose
        steps = max(1, math.ceil(seconds / LONGEST_STEP))
        for _ in range(steps):
            self._command_base(now)
            self._motion = obey(self._motion, self._command, self._limits, seconds / steps)
            if self._drive is not None and self._commander is Server.CONTROLLER:
                self._drive.move_to(self.pose)
        if not self.docked:
            self.battery.drain(before.distance(self.pose), seconds)

    def _command_base(self, now: float) -> None:
        """Give the base the command of the server at work.

        A server stops the base when its work ends. One that has died or hangs says nothing, so that the base
        keeps the last command, up to its command time-out.
        """
        commander, command = self._command_of_base(now)
        if commander is None and self._commander is not None and self.servers.runs(self._commander):
            command = (0.0, 0.0)
        if command is not None:
            self._commander, self._command, self._commanded_at = commander, command, now
            return
        if self._commander is not None and not self.servers.there(self._commander):
            self._commander = None
        timeout = self._settings.drive.command_timeout
        # Measured: a base without a time-out drives on after its controller has died.
        if timeout and now - self._commanded_at >= timeout:
            self._command = (0.0, 0.0)

    def _command_of_base(self, now: float) -> tuple[Server | None, tuple[float, float] | None]:
        """Return which server commands the base, and how, m/s and rad/s; None if no server does."""
        drive = self._drive
        # The collision monitor is the last one before the base; no server learns that it has stopped it.
        if self.faults.on(faults.Stuck) or self.faults.on(faults.CollisionStop):
            return None, (0.0, 0.0)
        if drive is None:
            return (None, None) if self.behaviour is None else (Server.BEHAVIOURS, self.behaviour)
        server = Server.CONTROLLER if drive.recovery is None else Server.BEHAVIOURS
        if not self.servers.works(server):
            return None, None
        if drive.recovery is not None:
            return server, drive.recovery.command(now)
        if drive.next_place is None:
            return server, (0.0, 0.0)
        return server, command_to(self.pose, drive.next_place, self._limits, behind=drive.behind)


def _server_of(action: Action) -> Server:
    """Return the process that serves an action."""
    return Server.CONTROLLER if action is Action.FOLLOW_PATH else Server.NAVIGATOR
