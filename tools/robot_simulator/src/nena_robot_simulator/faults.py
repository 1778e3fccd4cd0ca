"""Faults that can be injected into the simulated robot.

A fault is a JSON object with a ``kind``. It is active until it is resent with ``"active": false``, or
until it has affected the number of goals in ``goals``. A new kind needs a class here, an entry in
:data:`Fault`, and a :meth:`Faults.get` where it takes effect.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from nena_robot_simulator.goals import Snapshot
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.servers import Server
from nena_shared.findings import FINDINGS_SHOWN, in_words

Metres = Annotated[float, Field(allow_inf_nan=False)]
Radians = Annotated[float, Field(allow_inf_nan=False)]


class FaultRefusedError(Exception):
    """A message on the fault topic is not a fault; ``problems`` lists what to change."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Lasting(_Message):
    """A fault that can be switched on and off."""

    active: bool = Field(default=True, description="Switch the fault on or off.")


class PerGoal(Lasting):
    """A fault that affects goals, permanently or a number of them."""

    goals: int | None = Field(
        None, ge=1, description="Number of goals to affect. Unset: all until switched off."
    )


class Circle(_Message):
    """A round area of the map."""

    x: Metres
    y: Metres
    radius: Annotated[float, Field(gt=0, allow_inf_nan=False)]

    def holds(self, pose: Pose) -> bool:
        """Return whether a pose is in the circle."""
        return Pose(self.x, self.y, 0.0).distance(pose) <= self.radius


class Unreachable(PerGoal):
    """No path is found: the goal is ABORTED, with code 208 only after the recoveries."""

    kind: Literal["unreachable"] = "unreachable"
    circles: tuple[Circle, ...] = Field(
        (), description="Only goals inside one of these circles. Unset: every goal."
    )
    error_code: int = Field(
        208, ge=0, le=65535, description="Error code in the action's result: no valid path."
    )

    def concerns(self, goal: Pose) -> bool:
        """Return whether the goal is affected."""
        return not self.circles or any(circle.holds(goal) for circle in self.circles)


class AbortHalfway(PerGoal):
    """The goal is ABORTED after part of the path."""

    kind: Literal["abort_halfway"] = "abort_halfway"
    fraction: float = Field(
        0.5, ge=0, le=1, description="Fraction of the path after which the goal is aborted."
    )
    error_code: int = Field(
        105, ge=0, le=65535, description="Error code in the action's result: failed to make progress."
    )


class RejectGoals(PerGoal):
    """Goals on the topic are dropped without a status; goals of an action are rejected."""

    kind: Literal["reject_goals"] = "reject_goals"


class Stuck(Lasting):
    """The robot does not move; the goal stays EXECUTING."""

    kind: Literal["stuck"] = "stuck"
    recovery_after: float = Field(
        10.0,
        gt=0,
        description="Standstill between two recoveries in the feedback, seconds.",
    )


class CollisionStop(Lasting):
    """The collision monitor stops the robot; the navigator is not informed."""

    kind: Literal["collision_stop"] = "collision_stop"
    polygon: str = Field("PolygonStop", max_length=100, description="Name of the field that is violated.")


class Silence(Lasting):
    """Nothing is published; services still answer."""

    kind: Literal["silence"] = "silence"


class AmclSilent(Lasting):
    """No pose is published; everything else continues."""

    kind: Literal["amcl_silent"] = "amcl_silent"


class LocalisationLost(Lasting):
    """AMCL has lost the pose: its estimates have a large covariance."""

    kind: Literal["localisation_lost"] = "localisation_lost"
    xy_deviation: float = Field(3.0, gt=0, description="Reported standard deviation, m.")


class PoseJump(Lasting):
    """AMCL has mistaken one aisle for another: its estimates have a constant offset."""

    kind: Literal["pose_jump"] = "pose_jump"
    x: Metres = Field(3.0, description="Offset, m.")
    y: Metres = Field(0.0, description="Offset, m.")


class NanPose(Lasting):
    """The estimates contain NaN."""

    kind: Literal["nan_pose"] = "nan_pose"


class BatteryScale(Lasting):
    """The battery percentage has the other scale than configured."""

    kind: Literal["battery_scale"] = "battery_scale"


class Unconfigured(Lasting):
    """bt_navigator is not in the ROS graph; it returns as a new server without goals."""

    kind: Literal["unconfigured"] = "unconfigured"


class ServerDied(Lasting):
    """One process of Nav2 has died: it leaves the ROS graph.

    Without bt_navigator the controller drives its path to the end. A process restarts without its goals, AMCL
    without its pose. It is unconfigured, and works after its lifecycle manager's bring-up.
    """

    kind: Literal["server_died"] = "server_died"
    server: Server = Field(description="Name of its node.")
    lease: float = Field(
        0.0,
        ge=0,
        le=60,
        description="Time for which its endpoints stay in the ROS graph without answering, seconds: 20 for a "
        "process that is killed (DDS lease), 0 for one that ends in order.",
    )


class Nav2Stopped(Lasting):
    """Nav2 is stopped in order: its goals are ABORTED, then all processes leave the ROS graph.

    When the fault ends, they start, and their lifecycle managers bring them up; AMCL has no pose.
    """

    kind: Literal["nav2_stopped"] = "nav2_stopped"


class ServerHung(Lasting):
    """One process of Nav2 hangs: it stays in the ROS graph but answers nothing."""

    kind: Literal["server_hung"] = "server_hung"
    server: Server = Field(description="Name of its node.")


class ControllerDeaf(Lasting):
    """The controller reports its goal as cancelled but keeps driving."""

    kind: Literal["controller_deaf"] = "controller_deaf"


class BringUp(Lasting):
    """Nav2 starts: its nodes are inactive, and the lifecycle manager does not answer."""

    kind: Literal["bring_up"] = "bring_up"


class DuplicateStatus(Lasting):
    """Each status array is published twice."""

    kind: Literal["duplicate_status"] = "duplicate_status"


class ReorderedStatus(Lasting):
    """After each status array the previous one is repeated, then the newest."""

    kind: Literal["reordered_status"] = "reordered_status"


class TerminalFirst(Lasting):
    """A goal is not visible before its end: arrays with a running goal are dropped."""

    kind: Literal["terminal_first"] = "terminal_first"


class Freeze(_Message):
    """The robot's ROS node hangs once: nothing is published, received or answered."""

    kind: Literal["freeze"] = "freeze"
    seconds: float = Field(3.0, gt=0, le=60, description="Duration, seconds.")


class Inactive(Lasting):
    """The lifecycle nodes are inactive: a running goal is ABORTED, new goals are dropped."""

    kind: Literal["inactive"] = "inactive"


class ForeignGoal(_Message):
    """Another client sends the robot a goal once, e.g. RViz or a docking server."""

    kind: Literal["foreign_goal"] = "foreign_goal"
    x: Metres
    y: Metres
    yaw: Radians = 0.0


AnyFault = (
    Unreachable
    | AbortHalfway
    | RejectGoals
    | Stuck
    | CollisionStop
    | Silence
    | AmclSilent
    | LocalisationLost
    | PoseJump
    | NanPose
    | BatteryScale
    | Unconfigured
    | ServerDied
    | Nav2Stopped
    | ServerHung
    | ControllerDeaf
    | BringUp
    | DuplicateStatus
    | ReorderedStatus
    | TerminalFirst
    | Freeze
    | Inactive
    | ForeignGoal
)
Fault = Annotated[AnyFault, Field(discriminator="kind")]

F = TypeVar("F", bound=Lasting)

_parser: TypeAdapter[AnyFault] = TypeAdapter(Fault)


def parse(text: str) -> AnyFault:
    """Parse a fault from JSON; raises FaultRefusedError if the text is not JSON or not a fault."""
    try:
        return _parser.validate_json(text)
    except ValidationError as error:
        raise FaultRefusedError(in_words(error.errors(), whole="fault", most=FINDINGS_SHOWN)) from error


class Faults:
    """The active faults, at most one of each kind."""

    def __init__(self) -> None:
        self._on: dict[type[Lasting], Lasting] = {}

    def apply(self, fault: Lasting) -> None:
        """Switch a fault on or off, replacing one of the same kind."""
        if fault.active:
            self._on[type(fault)] = fault
        else:
            self._on.pop(type(fault), None)

    def get(self, kind: type[F]) -> F | None:
        """Return the active fault of this kind, if any."""
        found = self._on.get(kind)
        return found if isinstance(found, kind) else None

    def on(self, kind: type[Lasting]) -> bool:
        """Return whether a fault of this kind is active."""
        return kind in self._on

    def spend(self, kind: type[PerGoal]) -> None:
        """Count an affected goal; after the last one the fault ends."""
        fault = self.get(kind)
        if fault is None or fault.goals is None:
            return
        if fault.goals == 1:
            self._on.pop(kind)
        else:
            self._on[kind] = fault.model_copy(update={"goals": fault.goals - 1})


def disturbed(newest: Snapshot, before: Snapshot, active: Faults) -> tuple[Snapshot, ...]:
    """Return the arrays to publish instead of ``newest``; ``before`` is the previous one."""
    # Seen under load: writer and reader keep only the last array, so earlier ones can be lost.
    if active.on(TerminalFirst) and not all(goal.ended for goal in newest):
        return ()
    if active.on(ReorderedStatus) and before:
        return (newest, before, newest)
    if active.on(DuplicateStatus):
        return (newest, newest)
    return (newest,)
