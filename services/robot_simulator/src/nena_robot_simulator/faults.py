"""Faults on request: what can go wrong with the simulated robot, and for how long.

A fault is a small JSON object that names its ``kind``. It holds until it is sent again with
``"active": false``, or until it has met the number of goals in ``goals``. A new kind is a class here, a
name in :data:`Fault`, and a look at :meth:`Faults.get` where it takes effect.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from nena_robot_simulator.goals import Snapshot
from nena_robot_simulator.motion import Pose
from nena_shared.misfits import TOLD, in_words

Metres = Annotated[float, Field(allow_inf_nan=False)]
Radians = Annotated[float, Field(allow_inf_nan=False)]


class FaultRefusedError(Exception):
    """A text on the fault topic is no fault; ``problems`` says what to change."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Lasting(_Message):
    """A fault that is switched on and off."""

    active: bool = Field(default=True, description="Switch the fault on or off.")


class PerGoal(Lasting):
    """A fault that meets goals, for ever or for a number of them."""

    goals: int | None = Field(
        None, ge=1, description="How many goals it meets; none: all until switched off."
    )


class Circle(_Message):
    """A round area of the map."""

    x: Metres
    y: Metres
    radius: Annotated[float, Field(gt=0, allow_inf_nan=False)]

    def holds(self, pose: Pose) -> bool:
        """Whether the pose lies in the circle."""
        return Pose(self.x, self.y, 0.0).distance(pose) <= self.radius


class Unreachable(PerGoal):
    """No way to the goal is found: the goal ends ABORTED at once."""

    kind: Literal["unreachable"] = "unreachable"
    circles: tuple[Circle, ...] = Field((), description="Only goals inside one of these; none: every goal.")
    error_code: int = Field(208, ge=0, le=65535, description="Reason in the result of an action: no path.")

    def concerns(self, goal: Pose) -> bool:
        """Whether the goal is one that cannot be reached."""
        return not self.circles or any(circle.holds(goal) for circle in self.circles)


class AbortHalfway(PerGoal):
    """The drive ends ABORTED after a part of the way."""

    kind: Literal["abort_halfway"] = "abort_halfway"
    fraction: float = Field(0.5, ge=0, le=1, description="Part of the way after which the drive is aborted.")
    error_code: int = Field(
        105, ge=0, le=65535, description="Reason in the result of an action: no progress."
    )


class RejectGoals(PerGoal):
    """Goals by the topic vanish: no status, no movement; those by an action are refused."""

    kind: Literal["reject_goals"] = "reject_goals"


class Stuck(Lasting):
    """The robot does not move, the goal stays EXECUTING."""

    kind: Literal["stuck"] = "stuck"
    recovery_after: float = Field(
        10.0,
        gt=0,
        description="Seconds of standstill from one recovery to the next, as feedback counts them.",
    )


class Silence(Lasting):
    """Nothing is published any more; services still answer."""

    kind: Literal["silence"] = "silence"


class AmclSilent(Lasting):
    """No pose is published any more, the rest goes on."""

    kind: Literal["amcl_silent"] = "amcl_silent"


class LocalisationLost(Lasting):
    """AMCL's particles are spread all over the place: its estimates say so by their covariance."""

    kind: Literal["localisation_lost"] = "localisation_lost"
    xy_deviation: float = Field(3.0, gt=0, description="Standard deviation that it shows, m.")


class PoseJump(Lasting):
    """AMCL has taken one aisle for another: its estimates are off by a fixed way."""

    kind: Literal["pose_jump"] = "pose_jump"
    x: Metres = Field(3.0, description="How far they are off, m.")
    y: Metres = Field(0.0, description="How far they are off, m.")


class NanPose(Lasting):
    """The estimates hold no numbers."""

    kind: Literal["nan_pose"] = "nan_pose"


class BatteryScale(Lasting):
    """The battery's percentage comes in the other scale than the settings say."""

    kind: Literal["battery_scale"] = "battery_scale"


class Unconfigured(Lasting):
    """bt_navigator is not in the ROS graph; it comes back as a new server that knows no goals."""

    kind: Literal["unconfigured"] = "unconfigured"


class NavigatorDied(Lasting):
    """bt_navigator alone has died: it leaves the ROS graph, and the controller drives its path to the end.

    It comes back as a new server that knows no goals.
    """

    kind: Literal["navigator_died"] = "navigator_died"


class NavigatorHung(Lasting):
    """bt_navigator alone hangs: it is in the ROS graph and answers nothing; the controller drives on."""

    kind: Literal["navigator_hung"] = "navigator_hung"


class ControllerDeaf(Lasting):
    """The controller answers that its goal is cancelled, and drives on."""

    kind: Literal["controller_deaf"] = "controller_deaf"


class BringUp(Lasting):
    """Nav2 starts: its nodes are inactive, and the lifecycle manager does not answer."""

    kind: Literal["bring_up"] = "bring_up"


class DuplicateStatus(Lasting):
    """Each status array comes twice."""

    kind: Literal["duplicate_status"] = "duplicate_status"


class ReorderedStatus(Lasting):
    """After each status array the one before it comes once more, and then the newest again."""

    kind: Literal["reordered_status"] = "reordered_status"


class TerminalFirst(Lasting):
    """A goal is not seen before its end: arrays with a goal that runs are lost."""

    kind: Literal["terminal_first"] = "terminal_first"


class Freeze(_Message):
    """The robot's whole ROS side hangs once, for a while: nothing is published, heard or answered."""

    kind: Literal["freeze"] = "freeze"
    seconds: float = Field(3.0, gt=0, le=60, description="How long.")


class Inactive(Lasting):
    """The lifecycle nodes are inactive: a running goal ends ABORTED, new goals vanish."""

    kind: Literal["inactive"] = "inactive"


class ForeignGoal(_Message):
    """Somebody else gives the robot a goal, once: RViz, a docking server."""

    kind: Literal["foreign_goal"] = "foreign_goal"
    x: Metres
    y: Metres
    yaw: Radians = 0.0


AnyFault = (
    Unreachable
    | AbortHalfway
    | RejectGoals
    | Stuck
    | Silence
    | AmclSilent
    | LocalisationLost
    | PoseJump
    | NanPose
    | BatteryScale
    | Unconfigured
    | NavigatorDied
    | NavigatorHung
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
    """Read a fault from JSON.

    Raises:
        FaultRefusedError: the text is no JSON or no fault.

    """
    try:
        return _parser.validate_json(text)
    except ValidationError as error:
        raise FaultRefusedError(in_words(error.errors(), whole="fault", most=TOLD)) from error


class Faults:
    """The faults that are switched on, one of each kind."""

    def __init__(self) -> None:
        self._on: dict[type[Lasting], Lasting] = {}

    def apply(self, fault: Lasting) -> None:
        """Switch a fault on or off; the newest word of a kind counts."""
        if fault.active:
            self._on[type(fault)] = fault
        else:
            self._on.pop(type(fault), None)

    def get(self, kind: type[F]) -> F | None:
        """Give the fault of this kind, where it is switched on."""
        found = self._on.get(kind)
        return found if isinstance(found, kind) else None

    def on(self, kind: type[Lasting]) -> bool:
        """Whether a fault of this kind is switched on."""
        return kind in self._on

    def spend(self, kind: type[PerGoal]) -> None:
        """Count a goal that the fault has met; after the last one the fault is over."""
        fault = self.get(kind)
        if fault is None or fault.goals is None:
            return
        if fault.goals == 1:
            self._on.pop(kind)
        else:
            self._on[kind] = fault.model_copy(update={"goals": fault.goals - 1})


def disturbed(newest: Snapshot, before: Snapshot, active: Faults) -> tuple[Snapshot, ...]:
    """Give the arrays that come in place of ``newest``; ``before`` is the one that came about before it."""
    if active.on(TerminalFirst) and not all(goal.ended for goal in newest):
        return ()
    if active.on(ReorderedStatus) and before:
        return (newest, before, newest)
    if active.on(DuplicateStatus):
        return (newest, newest)
    return (newest,)
