"""The port between the protocol core and the robot's driver.

Commands are methods that return at once. The driver reports everything by events: it calls the given callback
in the event loop's thread. Poses are in the plant's frame: m, rad (counter-clockwise), map ID. A driver whose
robot has its own map uses the same types within, in the frame of that map, and converts at this port
(:mod:`nena_edge_agent.driver.plant_frame`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import dist
from typing import Protocol


class SessionState(StrEnum):
    """The state of a ROS session."""

    NOT_ACTIVE = "NOT_ACTIVE"
    INITIATING = "INITIATING"
    ACTIVE = "ACTIVE"
    TERMINATING = "TERMINATING"
    FAILED = "FAILED"


class SessionError(Exception):
    """The session could not start; ``reason`` is from ROS."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the ROS session has failed: {reason}")
        self.reason = reason


STANDING = 0.01
"""Velocity below which a robot is at standstill, m/s and rad/s."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A position and heading: m and rad on the map ``map_id``."""

    x: float
    y: float
    theta: float
    map_id: str


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle in the plant's frame, m; an infinite radius means everywhere."""

    x: float
    y: float
    radius: float

    def holds(self, x: float, y: float) -> bool:
        """Return whether the point is inside."""
        return dist((self.x, self.y), (x, y)) <= self.radius


@dataclass(frozen=True, slots=True)
class DriveGoal:
    """A goal of the core.

    Attributes:
        generation: increases with each goal. Events of a goal contain it, so that a late result never ends a
            newer goal.
        pose: target pose.
        deviation_xy: allowed deviation from the target position, m.
        deviation_theta: allowed deviation from its heading, rad; None: any heading.
        maximum_speed: m/s; None: the robot's own.
        ahead: poses after the target up to the next stop. A driver that supports them passes them, and
            continues without a stop when the next of them becomes its goal.
        behavior_tree: behaviour tree for navigation; empty: the default.
        path: path to follow up to ``pose``; empty: navigation plans one.
    """

    generation: int
    pose: Pose
    deviation_xy: float
    deviation_theta: float | None = None
    maximum_speed: float | None = None
    ahead: tuple[Pose, ...] = ()
    behavior_tree: str = ""
    path: tuple[Pose, ...] = ()


class DriveFailure(StrEnum):
    """Why a drive failed."""

    ABORTED = "ABORTED"
    """Navigation gave up: the goal is unreachable, blocked or outside the map."""
    CANCELED_FROM_OUTSIDE = "CANCELED_FROM_OUTSIDE"
    """Another client cancelled the goal."""
    NOT_TAKEN_UP = "NOT_TAKEN_UP"
    """Navigation never accepted the goal, although it was sent several times."""
    OUTSIDE_TOLERANCE = "OUTSIDE_TOLERANCE"
    """Navigation reported success, but the pose is not within the allowed deviation."""
    NAVIGATION_GONE = "NAVIGATION_GONE"
    """Navigation ended or was restarted during the drive."""
    TAKEN_OVER = "TAKEN_OVER"
    """Another client's goal replaced this one."""


@dataclass(frozen=True, slots=True)
class Arrived:
    """The robot has reached the goal of ``generation``, as its pose confirms."""

    generation: int


@dataclass(frozen=True, slots=True)
class DriveFailed:
    """The drive to the goal of ``generation`` has failed and ended.

    ``hint`` is what to do about it, if known; ``code`` is navigation's error code, 0: none.
    ``transient``: the cause is likely to pass, so the drive is worth another attempt.
    """

    generation: int
    failure: DriveFailure
    description: str
    hint: str = ""
    code: int = 0
    transient: bool = False


@dataclass(frozen=True, slots=True)
class Halted:
    """The robot is at standstill without a goal, as requested by :meth:`Driver.halt`."""


@dataclass(frozen=True, slots=True)
class HaltFailed:
    """The robot still moves after a halt, or its standstill is not confirmed; ``description`` explains it.

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
class PoseReport:
    """The robot's pose, and its velocity in its own frame (m/s, rad/s; None: unknown).

    ``problem`` is why the pose is unreliable; empty if it is reliable.
    """

    pose: Pose
    localized: bool
    vx: float | None = None
    omega: float | None = None
    problem: str = ""


@dataclass(frozen=True, slots=True)
class BatteryReport:
    """The state of the battery: percent, V, A (negative: discharging)."""

    state_of_charge: float
    charging: bool
    voltage: float | None = None
    current: float | None = None


@dataclass(frozen=True, slots=True)
class NavigationReport:
    """Whether navigation accepts goals now; ``reason`` is what is missing.

    ``starting``: the driver is still looking for navigation.
    """

    available: bool
    reason: str
    starting: bool = False


@dataclass(frozen=True, slots=True)
class OwnGoals:
    """Own goals that have not ended, possibly of an earlier run; the last one leads to ``pose``.

    ``given`` is the pose of a goal that is about to be sent, or was sent and is not listed yet. It will be
    listed after the goal ``behind`` ("": unknown).
    """

    goal_ids: tuple[str, ...]
    pose: Pose
    given: Pose | None = None
    behind: str = ""


@dataclass(frozen=True, slots=True)
class BlockedReport:
    """Whether the robot has been at standstill for ``seconds`` although it has a goal."""

    blocked: bool
    seconds: float


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Navigation's goal tolerance and footprint, in m on the map ``map_id``.

    A goal counts as reached within ``tolerance``, and within ``theta_tolerance`` rad of its heading (None:
    unknown). To pass a goal at full speed, the next one must arrive ``hand_over`` m plus one replanning
    period before it. ``contour`` is the footprint around the robot's origin; empty: unknown.
    """

    tolerance: float
    hand_over: float
    map_id: str
    contour: tuple[tuple[float, float], ...] = ()
    theta_tolerance: float | None = None


@dataclass(frozen=True, slots=True)
class PlanReport:
    """Navigation's plan from the robot's position at that time to the goal: at least two points, m."""

    points: tuple[tuple[float, float], ...]
    map_id: str = ""


@dataclass(frozen=True, slots=True)
class NoRouteReport:
    """All areas to which navigation has no route; orders that lead there are refused."""

    areas: tuple[Circle, ...]


@dataclass(frozen=True, slots=True)
class DriveProgress:
    """Progress of the current drive: remaining distance in m on the map ``map_id``, and recoveries so far.

    ``left`` is None while navigation has no path.
    """

    left: float | None
    recoveries: int
    map_id: str


@dataclass(frozen=True, slots=True)
class CollisionReport:
    """Whether a collision monitor stops the robot (None: unknown), and which of its polygons is violated."""

    stops: bool | None
    polygon: str


@dataclass(frozen=True, slots=True)
class KeepOutReport:
    """Whether navigation plans around the areas of :meth:`Driver.keep_out`; ``problem``: why not."""

    problem: str


@dataclass(frozen=True, slots=True)
class PositionInitialized:
    """Whether the localisation accepted the pose of :meth:`Driver.initialize_position`, or why not."""

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
    """Navigation's goals, oldest first: all running ones, and the last ones that have ended."""

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
    """The state of the robot's ROS session, its namespace and domain; ``reason`` is why it failed."""

    state: SessionState
    namespace: str
    domain_id: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon on the map ``map_id`` that the robot must not enter: corners in m."""

    map_id: str
    points: tuple[tuple[float, float], ...]


DriverEvent = (
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
    | KeepOutReport
    | DriveLimits
    | PositionInitialized
    | GoalTable
    | SessionReport
    | PoseReport
    | PlanReport
    | NoRouteReport
)
Emit = Callable[[DriverEvent], None]


class Driver(Protocol):
    """A robot's driver."""

    async def start(self) -> None:
        """Start the driver; from now on it may emit events.

        Raises:
            nena_shared.program.StartError: the driver cannot work here; the message says what to do.
        """
        ...

    async def stop(self) -> None:
        """Cancel own goals and release all resources, within a limited time."""
        ...

    def halt(self) -> None:
        """Stop the robot and drop its goal; answered by :class:`Halted` or :class:`HaltFailed`."""
        ...

    def limit_speed(self, speed: float | None) -> None:
        """Limit the speed to ``speed`` m/s for all goals; None: no limit.

        Called only for drivers that support it.
        """
        ...

    def reclaim(self, goals: OwnGoals) -> None:
        """Treat ``goals`` as own goals if navigation still drives to them; called before the start.

        A goal to the pose of the next :meth:`go_to` continues; others are replaced or cancelled.
        """
        ...

    def go_to(self, goal: DriveGoal) -> None:
        """Drive to ``goal``; a current goal is replaced without a stop and without an event."""
        ...

    def keep_out(self, areas: tuple[Area, ...]) -> None:
        """Make navigation plan around ``areas``, and around no others.

        Called only for drivers that support it. Answered by :class:`KeepOutReport` while there are areas, and
        again at each change.
        """
        ...

    def initialize_position(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation; answered by :class:`PositionInitialized`."""
        ...
