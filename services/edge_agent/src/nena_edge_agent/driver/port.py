"""The port between the protocol core and the driver of the robot.

Commands are method calls that return at once; everything that happens is reported by events, through the
callback given to the driver, in the event loop's thread. Poses are in the plant's frame: m, rad,
counter-clockwise, with the map ID. A driver that uses the robot's own map implements
:mod:`nena_edge_agent.driver.map_port` instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import dist
from typing import Generic, Protocol, TypeVar


class SessionState(StrEnum):
    """The state of a ROS session."""

    NOT_ACTIVE = "NOT_ACTIVE"
    INITIATING = "INITIATING"
    ACTIVE = "ACTIVE"
    TERMINATING = "TERMINATING"
    FAILED = "FAILED"


STANDING = 0.01
"""Velocity below which a robot counts as at standstill, m/s or rad/s."""

P = TypeVar("P")
"""The type of a pose, which determines the frame."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A position and heading: m and rad in the plant's frame of the map ``map_id``."""

    x: float
    y: float
    theta: float
    map_id: str


@dataclass(frozen=True, slots=True)
class Circle:
    """A round area of the robot's map, m; an infinite radius means everywhere."""

    x: float
    y: float
    radius: float

    def holds(self, x: float, y: float) -> bool:
        """Return whether the point is inside."""
        return dist((self.x, self.y), (x, y)) <= self.radius


@dataclass(frozen=True, slots=True)
class GoalAt(Generic[P]):
    """The next goal.

    ``generation`` increases with each goal that the core sends; events of a goal contain it, so that a late
    result never finishes a newer goal. ``deviation_xy`` (m) and ``deviation_theta`` (rad, None: any heading)
    define when the robot has arrived. ``maximum_speed`` is in m/s, None: the robot's own. ``ahead`` are the
    poses after it up to the next stop: a driver that supports them drives through them, and continues without
    a stop when it gets the next of them as its goal. ``behavior_tree`` names the behaviour tree for
    navigation; "": the default. ``path`` is the path to follow, up to ``pose``; empty: navigation plans one.
    """

    generation: int
    pose: P
    deviation_xy: float
    deviation_theta: float | None = None
    maximum_speed: float | None = None
    ahead: tuple[P, ...] = ()
    behavior_tree: str = ""
    path: tuple[P, ...] = ()


class DriveGoal(GoalAt[Pose]):
    """One in the plant's frame."""

    __slots__ = ()


class DriveFailure(StrEnum):
    """Why a drive failed."""

    ABORTED = "ABORTED"
    """Navigation gave up: unreachable, blocked, outside the map."""
    CANCELED_FROM_OUTSIDE = "CANCELED_FROM_OUTSIDE"
    """Another client cancelled the goal."""
    NOT_TAKEN_UP = "NOT_TAKEN_UP"
    """Navigation never accepted the goal, although it was sent several times."""
    OUTSIDE_TOLERANCE = "OUTSIDE_TOLERANCE"
    """Navigation reports success, but the pose is not within the allowed deviation."""
    NAVIGATION_GONE = "NAVIGATION_GONE"
    """Navigation vanished or was restarted while it was driving."""
    TAKEN_OVER = "TAKEN_OVER"
    """Another client sent navigation a goal that replaced this robot's own."""


@dataclass(frozen=True, slots=True)
class Arrived:
    """The goal of ``generation`` is reached, confirmed by the pose."""

    generation: int


@dataclass(frozen=True, slots=True)
class DriveFailed:
    """The goal of ``generation`` will not be reached; the robot no longer drives to it.

    ``hint`` is what to do about it, if known; ``code`` is navigation's error code, 0: none.
    """

    generation: int
    failure: DriveFailure
    description: str
    hint: str = ""
    code: int = 0


@dataclass(frozen=True, slots=True)
class Halted:
    """The robot is at standstill without a goal, as requested by :meth:`Driver.halt`."""


@dataclass(frozen=True, slots=True)
class HaltFailed:
    """The robot was stopped but still moves, or its standstill is not confirmed; ``description``: which.

    The driver keeps trying; :class:`Halted` follows at standstill.
    """

    description: str


@dataclass(frozen=True, slots=True)
class VelocityReport:
    """Velocity in the robot's own frame (m/s, rad/s); None: unknown."""

    vx: float | None
    omega: float | None

    @property
    def moves(self) -> bool:
        """Return whether the robot is known to move."""
        return any(part is not None and abs(part) >= STANDING for part in (self.vx, self.omega))


@dataclass(frozen=True, slots=True)
class PoseReportAt(Generic[P]):
    """Pose of the robot; velocity in its own frame (m/s, rad/s), None if unknown.

    ``problem`` explains why the pose is unreliable; empty if it is reliable.
    """

    pose: P
    localized: bool
    vx: float | None = None
    omega: float | None = None
    problem: str = ""


class PoseReport(PoseReportAt[Pose]):
    """One in the plant's frame."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class BatteryReport:
    """The state of the battery: percent, V, A (negative: discharging)."""

    state_of_charge: float
    charging: bool
    voltage: float | None = None
    current: float | None = None


@dataclass(frozen=True, slots=True)
class NavigationReport:
    """Whether goals can be sent now; ``reason`` explains what is missing.

    ``starting``: the search for navigation is still running.
    """

    available: bool
    reason: str
    starting: bool = False


@dataclass(frozen=True, slots=True)
class OwnGoalsAt(Generic[P]):
    """Goals of an earlier run of the program that had not ended; the last one leads to ``pose``.

    ``given`` is the pose of a goal that was about to be sent, or was sent and not listed yet; it would be
    listed after the goal ``behind`` ("": unknown).
    """

    goal_ids: tuple[str, ...]
    pose: P
    given: P | None = None
    behind: str = ""


class OwnGoals(OwnGoalsAt[Pose]):
    """Those in the plant's frame."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class BlockedReport:
    """Whether the robot has been at standstill for ``seconds`` although navigation is driving."""

    blocked: bool
    seconds: float


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """The accuracy of navigation at a goal, and the robot's outline: m on the map ``map_id``.

    A goal counts as reached within ``tolerance``. A goal that is passed at full speed must be replaced
    ``hand_over`` m plus one replanning period before it. ``contour`` is the outline around the robot's origin
    as navigation has it; empty: unknown.
    """

    tolerance: float
    hand_over: float
    map_id: str
    contour: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class PlanReport:
    """The path planned by navigation to its goal, from the robot's position then: m, two points or more."""

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class NoRouteReport:
    """All areas that navigation cannot enter; orders that lead there are refused."""

    areas: tuple[Circle, ...]


@dataclass(frozen=True, slots=True)
class DriveProgress:
    """Navigation's progress of the current drive: metres of ``map_id`` left, recoveries so far.

    ``left`` is None while navigation has no path.
    """

    left: float | None
    recoveries: int
    map_id: str


@dataclass(frozen=True, slots=True)
class CollisionReport:
    """Whether a collision monitor stops the robot, and by which of its polygons."""

    stops: bool
    polygon: str


@dataclass(frozen=True, slots=True)
class PositionInitialized:
    """The pose of :meth:`Driver.initialize_position` was accepted, or why it was not."""

    succeeded: bool
    description: str


@dataclass(frozen=True, slots=True)
class GoalReport:
    """A goal of navigation; ``external``: sent by another client, ``ended``: no longer running."""

    goal_id: str
    external: bool
    status: str
    ended: bool = False


@dataclass(frozen=True, slots=True)
class GoalTable:
    """Navigation's goals, oldest first: all running ones, and the newest that have ended."""

    goals: tuple[GoalReport, ...] = ()

    @property
    def own(self) -> tuple[str, ...]:
        """Return the IDs of running goals sent by this robot's agent."""
        return tuple(goal.goal_id for goal in self.goals if not goal.external and not goal.ended)

    @property
    def external(self) -> tuple[GoalReport, ...]:
        """Return the running goals sent by other clients."""
        return tuple(goal for goal in self.goals if goal.external and not goal.ended)


@dataclass(frozen=True, slots=True)
class SessionReport:
    """The state of the robot's ROS session, and its address in the ROS graph; ``reason``: why it failed."""

    state: SessionState
    namespace: str
    domain_id: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class AreaAt:
    """A polygon on the map ``map_id`` that the robot must not enter: corners in m."""

    map_id: str
    points: tuple[tuple[float, float], ...]


class Area(AreaAt):
    """One in the plant's frame."""

    __slots__ = ()


FramelessEvent = (
    Arrived
    | DriveFailed
    | Halted
    | HaltFailed
    | VelocityReport
    | BatteryReport
    | NavigationReport
    | BlockedReport
    | DriveProgress
    | CollisionReport
    | DriveLimits
    | PositionInitialized
    | GoalTable
    | SessionReport
)
"""Events that are the same in each frame."""

DriverEvent = FramelessEvent | PoseReport | PlanReport | NoRouteReport
Emit = Callable[[DriverEvent], None]


class Mover(Protocol):
    """The part of a driver that is the same in each frame."""

    async def start(self) -> None:
        """Start; events may be emitted from now on.

        Raises:
            nena_shared.program.StartError: the driver cannot work here; the text says what to do.
        """
        ...

    async def stop(self) -> None:
        """Cancel current goals and release all resources, within a limited time."""
        ...

    def halt(self) -> None:
        """Stop as soon as possible and drop the goal; answered by :class:`Halted` or :class:`HaltFailed`."""
        ...

    def limit_speed(self, speed: float | None) -> None:
        """Limit the speed to ``speed`` m/s for all goals; None: no limit.

        Called only for drivers that support it.
        """
        ...


class Driver(Mover, Protocol):
    """A robot's driver in the plant's frame."""

    def reclaim(self, goals: OwnGoals) -> None:
        """Treat ``goals`` as this robot's own if navigation still drives to them; called before the start.

        A goal to the same pose stays; others are replaced, or cancelled if none is wanted.
        """
        ...

    def go_to(self, goal: DriveGoal) -> None:
        """Drive to ``goal``; a current goal is replaced without a stop and without an event."""
        ...

    def keep_out(self, areas: tuple[Area, ...]) -> None:
        """Make navigation plan around ``areas``, and around no others.

        Called only for drivers that support it.
        """
        ...

    def initialize_position(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation; answered by :class:`PositionInitialized`."""
        ...
