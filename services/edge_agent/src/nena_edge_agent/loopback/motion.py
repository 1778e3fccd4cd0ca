"""How a loopback robot moves: turn on the spot, straight on, turn to the heading wanted. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, copysign, cos, dist, pi, sin

from nena_edge_agent.driver.port import Pose


@dataclass(frozen=True, slots=True)
class Motion:
    """A drive from ``start`` to ``goal`` that began at ``begin`` (s), at ``speed`` m/s and ``rate`` rad/s."""

    start: Pose
    goal: Pose
    begin: float
    speed: float
    rate: float
    turn_at_end: bool

    @property
    def length(self) -> float:
        """Metres of the straight line."""
        return dist((self.start.x, self.start.y), (self.goal.x, self.goal.y))

    @property
    def end(self) -> float:
        """The time in s at which the robot is there."""
        return self.begin + self._first_turn_time + self._line_time + abs(self._last_turn) / self.rate

    def at(self, now: float) -> tuple[Pose, float, float]:
        """Give the pose at the time ``now`` in s, with the speed in m/s and the turning rate in rad/s."""
        elapsed = max(0.0, now - self.begin)
        if elapsed < self._first_turn_time:
            rate = copysign(self.rate, self._first_turn)
            return self._pose(0.0, self.start.theta + elapsed * rate), 0.0, rate
        elapsed -= self._first_turn_time
        if elapsed < self._line_time:
            return self._pose(elapsed * self.speed, self._direction), self.speed, 0.0
        elapsed -= self._line_time
        if elapsed * self.rate < abs(self._last_turn):
            rate = copysign(self.rate, self._last_turn)
            return self._pose(self.length, self._direction + elapsed * rate), 0.0, rate
        return self._pose(self.length, self._direction + self._last_turn), 0.0, 0.0

    @property
    def _direction(self) -> float:
        if self.length == 0:
            return self.start.theta
        return atan2(self.goal.y - self.start.y, self.goal.x - self.start.x)

    @property
    def _first_turn(self) -> float:
        return _turn(self.start.theta, self._direction)

    @property
    def _first_turn_time(self) -> float:
        return abs(self._first_turn) / self.rate

    @property
    def _line_time(self) -> float:
        return self.length / self.speed

    @property
    def _last_turn(self) -> float:
        return _turn(self._direction, self.goal.theta) if self.turn_at_end else 0.0

    def _pose(self, along: float, theta: float) -> Pose:
        """Give the pose ``along`` metres from the start, exactly on the goal at the end of the line."""
        done = along >= self.length
        x = self.goal.x if done else self.start.x + along * cos(self._direction)
        y = self.goal.y if done else self.start.y + along * sin(self._direction)
        return Pose(x, y, _turn(0.0, theta), self.goal.map_id)


@dataclass(frozen=True, slots=True)
class Braking:
    """Straight on from ``start`` at ``speed`` m/s, coming to a stand evenly within ``distance`` m."""

    start: Pose
    begin: float
    speed: float
    distance: float

    @property
    def end(self) -> float:
        """The time in s at which the robot stands."""
        return self.begin + 2 * self.distance / self.speed

    def at(self, now: float) -> tuple[Pose, float, float]:
        """Give the pose at the time ``now`` in s, with the speed in m/s and the turning rate in rad/s."""
        left = max(0.0, (self.end - now) / (self.end - self.begin)) if now > self.begin else 1.0
        along = self.distance * (1 - left**2)
        heading = self.start.theta
        x, y = self.start.x + along * cos(heading), self.start.y + along * sin(heading)
        return Pose(x, y, heading, self.start.map_id), self.speed * left, 0.0


def braking(motion: Motion, now: float, deceleration: float) -> Braking | None:
    """Give how a robot in ``motion`` comes to a stand, at ``deceleration`` m/s²; None: it does at once.

    It never goes beyond the goal: near to it the robot brakes harder.
    """
    pose, speed, _ = motion.at(now)
    if not speed or not deceleration:
        return None
    left = dist((pose.x, pose.y), (motion.goal.x, motion.goal.y))
    return Braking(pose, now, speed, min(speed**2 / (2 * deceleration), left)) if left else None


def _turn(start: float, end: float) -> float:
    return (end - start + pi) % (2 * pi) - pi
