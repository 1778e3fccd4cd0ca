"""The loopback driver: simulates the motion and the battery of one robot."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from math import atan2, copysign, cos, dist, inf, sin

from nena_edge_agent.driver import port
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.protocol.geometry import turn
from nena_shared.clock import Clock

FULL = 100.0
METRES_OF_DRAIN = 100.0


class SimulatedBattery:
    """A simulated battery; charge in percent, times monotonic, s."""

    def __init__(self, settings: LoopbackSettings) -> None:
        self._drain = settings.drain / METRES_OF_DRAIN
        self._rate = settings.charge_rate
        self._charge_level = settings.charge
        self._charged_at: float | None = None

    @property
    def is_charging(self) -> bool:
        """Return whether the battery is charging."""
        return self._charged_at is not None

    def level_at(self, now: float) -> float:
        """Return the state of charge at the time ``now``."""
        if self._charged_at is not None:
            self._charge_level = min(FULL, self._charge_level + (now - self._charged_at) * self._rate)
            self._charged_at = now
        return self._charge_level

    def drain_by(self, metres: float) -> None:
        """Drain the battery by driving ``metres``."""
        self._charge_level = max(0.0, self._charge_level - self._drain * metres)

    def switch_charging(self, now: float, *, charging: bool) -> None:
        """Start or stop charging."""
        self.level_at(now)
        self._charged_at = now if charging else None

    def set_level(self, now: float, charge: float) -> None:
        """Set the state of charge to ``charge`` percent at the time ``now``."""
        self.level_at(now)
        self._charge_level = charge


@dataclass(frozen=True, slots=True)
class Motion:
    """A drive from ``start`` to ``goal``: turn, straight line, turn.

    It began at the monotonic time ``begin``, s, at ``speed``, m/s, and ``rate``, rad/s.
    """

    start: port.Pose
    goal: port.Pose
    begin: float
    speed: float
    rate: float
    turn_at_end: bool

    @property
    def length(self) -> float:
        """Return the length of the straight line, m."""
        return dist((self.start.x, self.start.y), (self.goal.x, self.goal.y))

    @property
    def end(self) -> float:
        """Return the time of arrival, monotonic, s."""
        return self.begin + self._first_turn_time + self._line_time + abs(self._last_turn) / self.rate

    def motion_at(self, now: float) -> tuple[port.Pose, float, float]:
        """Return pose, speed (m/s) and turning rate (rad/s) at the monotonic time ``now``, s."""
        elapsed = max(0.0, now - self.begin)
        if elapsed < self._first_turn_time:
            rate = copysign(self.rate, self._first_turn)
            return self._pose_along(0.0, self.start.theta + elapsed * rate), 0.0, rate
        elapsed -= self._first_turn_time
        if elapsed < self._line_time:
            return self._pose_along(elapsed * self.speed, self._line_direction), self.speed, 0.0
        elapsed -= self._line_time
        if elapsed * self.rate < abs(self._last_turn):
            rate = copysign(self.rate, self._last_turn)
            return self._pose_along(self.length, self._line_direction + elapsed * rate), 0.0, rate
        return self._pose_along(self.length, self._line_direction + self._last_turn), 0.0, 0.0

    @property
    def _line_direction(self) -> float:
        if self.length == 0:
            return self.start.theta
        return atan2(self.goal.y - self.start.y, self.goal.x - self.start.x)

    @property
    def _first_turn(self) -> float:
        return turn(self.start.theta, self._line_direction)

    @property
    def _first_turn_time(self) -> float:
        return abs(self._first_turn) / self.rate

    @property
    def _line_time(self) -> float:
        return self.length / self.speed

    @property
    def _last_turn(self) -> float:
        return turn(self._line_direction, self.goal.theta) if self.turn_at_end else 0.0

    def _pose_along(self, along: float, theta: float) -> port.Pose:
        """Return the pose ``along`` metres from the start, exactly on the goal at the end of the line."""
        done = along >= self.length
        x = self.goal.x if done else self.start.x + along * cos(self._line_direction)
        y = self.goal.y if done else self.start.y + along * sin(self._line_direction)
        return port.Pose(x, y, turn(0.0, theta), self.goal.map_id)


@dataclass(frozen=True, slots=True)
class Braking:
    """A straight stop from ``start`` and ``speed``, m/s, within ``distance``, m, by constant deceleration."""

    start: port.Pose
    begin: float
    speed: float
    distance: float

    @property
    def end(self) -> float:
        """Return the time of standstill, monotonic, s."""
        return self.begin + 2 * self.distance / self.speed

    def motion_at(self, now: float) -> tuple[port.Pose, float, float]:
        """Return pose, speed (m/s) and turning rate (rad/s) at the monotonic time ``now``, s."""
        left = max(0.0, (self.end - now) / (self.end - self.begin)) if now > self.begin else 1.0
        along = self.distance * (1 - left**2)
        heading = self.start.theta
        x, y = self.start.x + along * cos(heading), self.start.y + along * sin(heading)
        return port.Pose(x, y, heading, self.start.map_id), self.speed * left, 0.0


def plan_braking(motion: Motion, now: float, deceleration: float) -> Braking | None:
    """Return how a robot in ``motion`` stops at ``deceleration``, m/s²; None: at once.

    The robot never drives beyond its goal: close to it, it brakes harder.
    """
    pose, speed, _ = motion.motion_at(now)
    if not speed or not deceleration:
        return None
    left = dist((pose.x, pose.y), (motion.goal.x, motion.goal.y))
    return Braking(pose, now, speed, min(speed**2 / (2 * deceleration), left)) if left else None


MINIMUM_SPEED_LIMIT = 0.01
"""Lowest speed limit, m/s: at 0, a robot would never leave its zone."""
BATTERY_STEP = 1.0
"""Change of charge between two reports, percent."""


class LoopbackDriver:
    """One simulated robot, in the plant's frame; at standstill it uses no CPU time.

    Besides the methods of the driver port, it has one for each command of simulation control.
    """

    def __init__(
        self,
        settings: LoopbackSettings,
        start: port.Pose,
        *,
        emit: port.Emit,
        clock: Clock,
        speed: float | None = None,
    ) -> None:
        self._settings = settings
        self._emit = emit
        self._clock = clock
        self._pose = start
        self._speed = speed or settings.speed
        self._speed_limit = inf
        self._localized = True
        self._navigation = port.NavigationReport(available=True, reason="")
        self._unreachable: dict[port.Circle, None] = {}
        self._no_route: dict[port.Circle, None] = {}
        self._battery = SimulatedBattery(settings)
        self._reported_charge = settings.charge
        self._goal: port.DriveGoal | None = None
        self._motion: Motion | Braking | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._charge_timer: asyncio.TimerHandle | None = None
        self.ended = False

    async def start(self) -> None:
        """Report the robot's pose and that navigation is available."""
        self._report_pose(0.0, 0.0)
        self._report_battery()
        self._emit(self._navigation)

    async def stop(self) -> None:
        """Stop the robot and send no more events."""
        self.ended = True
        self._stop_here()
        self._stop_charge_timer()

    @property
    def is_moving(self) -> bool:
        """Return whether the robot drives, turns or brakes."""
        return self._motion is not None

    def go_to(self, goal: port.DriveGoal) -> None:
        """Drive straight to ``goal`` from where the robot is."""
        # Also a goal that is sent again: its speed may have changed.
        self._stop_here()
        problem = ""
        if goal.pose.map_id != self._pose.map_id:
            problem = f"the robot is on map '{self._pose.map_id}', the goal on '{goal.pose.map_id}'"
        elif any(circle.holds(goal.pose.x, goal.pose.y) for circle in self._unreachable):
            problem = "the goal is unreachable"
        if problem:
            failure = port.DriveFailed(goal.generation, port.DriveFailure.ABORTED, problem)
            # As from Nav2: no answer arrives before go_to has returned.
            asyncio.get_running_loop().call_soon(self._emit, failure)
            return
        # Who drives away from a charger no longer charges; no stopCharging is needed.
        if self._battery.is_charging:
            self.set_charging(charging=False)
        self._goal = goal
        self._motion = Motion(
            start=self._pose,
            goal=goal.pose,
            begin=self._clock.monotonic(),
            speed=min(self._speed, goal.maximum_speed or inf, self._speed_limit),
            rate=self._settings.turn_rate,
            turn_at_end=goal.deviation_theta is not None,
        )
        self._await_step()

    def halt(self) -> None:
        """Brake and drop the goal."""
        if isinstance(self._motion, Braking):
            return  # it confirms the halt at standstill
        motion, now = self._motion, self._clock.monotonic()
        braking_motion = plan_braking(motion, now, self._settings.deceleration) if motion else None
        self._stop_here()
        if braking_motion is None:
            asyncio.get_running_loop().call_soon(self._confirm_halt)
        else:
            self._motion = braking_motion
            self._await_step()

    def reclaim(self, goals: port.OwnGoals) -> None:
        """Do nothing: goals end with the program."""

    def keep_out(self, areas: tuple[port.Area, ...]) -> None:
        """Do nothing: the robot drives in straight lines, so this is never called."""

    def limit_speed(self, speed: float | None) -> None:
        """Change the speed at once."""
        self._speed_limit = inf if speed is None else max(speed, MINIMUM_SPEED_LIMIT)
        if self._goal:
            self.go_to(self._goal)

    def initialize_position(self, pose: port.Pose) -> None:
        """Move to ``pose`` at once."""
        self._stop_here()
        self._pose, self._localized = pose, True
        asyncio.get_running_loop().call_soon(self._confirm_position)

    def stop_at_once(self) -> None:
        """Stop at once, as after an emergency stop or a field violation."""
        # A braking that ends here still owes the core the end of its halt.
        braking_motion = isinstance(self._motion, Braking)
        self._stop_here()
        self._report_pose(0.0, 0.0)
        if braking_motion:
            self._emit(port.Halted())

    def carry_to(self, x: float, y: float, theta: float, map_id: str | None = None) -> None:
        """Place the robot at another pose (m, rad); a current goal continues from there."""
        # Like a robot that is carried while Nav2 drives: it has not given up its goal.
        goal = self._goal
        self.stop_at_once()
        self._pose = port.Pose(x, y, theta, map_id or self._pose.map_id)
        self._report_pose(0.0, 0.0)
        if goal:
            self.go_to(goal)

    def set_speed(self, speed: float) -> None:
        """Set the speed, m/s."""
        self._speed = speed
        if self._goal:
            self.go_to(self._goal)

    def set_localized(self, *, localized: bool) -> None:
        """Lose the position, or find it again."""
        self._localized = localized
        self._report_pose(0.0, 0.0)

    def set_navigation(self, *, available: bool, reason: str) -> None:
        """Make navigation available, or unavailable, which stops the robot."""
        if not available:
            self.stop_at_once()
        self._navigation = port.NavigationReport(available=available, reason=reason)
        self._emit(self._navigation)

    def set_unreachable(self, circle: port.Circle, *, active: bool) -> None:
        """Make goals in ``circle`` unreachable, or reachable again."""
        if not active:
            self._unreachable.pop(circle, None)
            return
        self._unreachable[circle] = None
        # A goal that becomes unreachable ends now, as Nav2 notices it while it drives.
        goal = self._goal
        if goal and circle.holds(goal.pose.x, goal.pose.y):
            self.stop_at_once()
            self.go_to(goal)

    def set_no_route(self, circle: port.Circle, *, active: bool) -> None:
        """Report that no route leads into ``circle``, or that one does again."""
        if active:
            self._no_route[circle] = None
        else:
            self._no_route.pop(circle, None)
        self._emit(port.NoRouteReport(tuple(self._no_route)))

    def set_charging(self, *, charging: bool) -> None:
        """Start or stop charging."""
        self._stop_charge_timer()
        self._battery.switch_charging(self._clock.monotonic(), charging=charging)
        self._report_battery()
        self._wait_for_charge()

    def set_charge(self, charge: float) -> None:
        """Set the battery to ``charge`` percent."""
        self._battery.set_level(self._clock.monotonic(), charge)
        self._report_battery()

    def _stop_here(self) -> None:
        """Drop the goal and stop at the current pose."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._motion is not None:
            self._move_along(self._motion)
        self._goal, self._motion = None, None

    def _move_along(self, motion: Motion | Braking) -> tuple[float, float]:
        """Move the robot along ``motion``; return speed and turning rate."""
        start = self._pose
        self._pose, vx, omega = motion.motion_at(self._clock.monotonic())
        self._battery.drain_by(dist((start.x, start.y), (self._pose.x, self._pose.y)))
        return vx, omega

    def _await_step(self) -> None:
        if self._motion is not None:
            left = max(0.0, self._motion.end - self._clock.monotonic())
            delay = min(left, self._settings.pose_interval)
            self._timer = asyncio.get_running_loop().call_later(delay, self._take_step)

    def _take_step(self) -> None:
        self._timer = None
        motion, goal = self._motion, self._goal
        if motion is None:
            return
        over = self._clock.monotonic() >= motion.end
        vx, omega = self._move_along(motion)
        if over:
            self._goal, self._motion = None, None
            vx = omega = 0.0
        self._report_pose(vx, omega)
        if over:
            # After the pose, by which the core judges whether the node is reached.
            self._emit(port.Arrived(goal.generation) if goal else port.Halted())
        if self._reported_charge - self._charge_level >= BATTERY_STEP:
            self._report_battery()
        self._await_step()

    def _wait_for_charge(self) -> None:
        if self._battery.is_charging and self._charge_level < FULL:
            delay = BATTERY_STEP / self._settings.charge_rate
            self._charge_timer = asyncio.get_running_loop().call_later(delay, self._report_charge)

    def _report_charge(self) -> None:
        self._charge_timer = None
        self._report_battery()
        self._wait_for_charge()

    def _stop_charge_timer(self) -> None:
        if self._charge_timer is not None:
            self._charge_timer.cancel()
            self._charge_timer = None

    @property
    def _charge_level(self) -> float:
        return self._battery.level_at(self._clock.monotonic())

    def _confirm_halt(self) -> None:
        self._report_pose(0.0, 0.0)
        self._emit(port.Halted())

    def _confirm_position(self) -> None:
        self._report_pose(0.0, 0.0)
        self._emit(port.PositionInitialized(succeeded=True, description=""))

    def _report_pose(self, vx: float, omega: float) -> None:
        self._emit(port.PoseReport(self._pose, localized=self._localized, vx=vx, omega=omega))

    def _report_battery(self) -> None:
        self._reported_charge = self._charge_level
        self._emit(
            port.BatteryReport(state_of_charge=self._reported_charge, charging=self._battery.is_charging)
        )
