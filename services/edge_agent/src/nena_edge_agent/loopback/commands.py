"""Commands of the control door: what people and the world do to a loopback robot.

A command is a JSON object that names its ``command``. An ``id`` comes back in the answer. A new one is a
class here, a name in :data:`AnyCommand`, and a case in the bench.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic.alias_generators import to_camel

from nena_edge_agent.driver.port import Circle
from nena_shared.misfits import TOLD, in_words
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference
from nena_shared.vda5050.state import EmergencyStop, OperatingMode

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Text = Annotated[str, Field(max_length=1000)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class CommandRefusedError(Exception):
    """A message to the control door is no command, or cannot be obeyed; ``problems`` says what to change."""

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class _Command(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, alias_generator=to_camel, validate_by_name=False
    )

    id: Text | None = Field(None, description="Comes back in the answer.")


class SwitchOperatingMode(_Command):
    """A person switches the operating mode."""

    command: Literal["operatingMode"]
    mode: OperatingMode


class SwitchLocalization(_Command):
    """The robot loses its position, or finds it again."""

    command: Literal["localization"]
    localized: bool


class SwitchNavigation(_Command):
    """What drives the robot goes away, or is there again."""

    command: Literal["navigation"]
    available: bool
    reason: Text = "switched off at the control door"


class _Area(_Command):
    """A circle (m); without a centre everywhere."""

    x: Finite | None = None
    y: Finite | None = None
    radius: Positive = 0.5
    active: bool = True

    @model_validator(mode="after")
    def _whole_place(self) -> Self:
        if (self.x is None) is not (self.y is None):
            message = "give both x and y, or neither"
            raise ValueError(message)
        return self

    @property
    def circle(self) -> Circle:
        """The area."""
        if self.x is None or self.y is None:
            return Circle(0.0, 0.0, inf)
        return Circle(self.x, self.y, self.radius)


class MakeUnreachable(_Area):
    """Nodes there cannot be reached, which the robot finds out on the way."""

    command: Literal["unreachable"]


class TakeRoute(_Area):
    """No way leads there, which the robot knows: it refuses orders that do."""

    command: Literal["noRoute"]


class SwitchError(_Command):
    """An error comes, or goes; type and references say which."""

    command: Literal["error"]
    error_type: Name
    error_level: ErrorLevel = ErrorLevel.WARNING
    error_description: Text | None = None
    error_hint: Text | None = None
    error_references: Annotated[dict[Name, Text], Field(max_length=20)] = Field(default_factory=dict)
    active: bool = True

    @property
    def entry(self) -> ErrorEntry:
        """The error as the state shows it."""
        references = tuple(
            ErrorReference(reference_key=key, reference_value=value)
            for key, value in self.error_references.items()
        )
        return ErrorEntry(
            error_type=self.error_type,
            error_level=self.error_level,
            error_description=self.error_description,
            error_hint=self.error_hint,
            error_references=references,
        )


class SwitchFieldViolation(_Command):
    """Something is in the protective field, or has left it."""

    command: Literal["fieldViolation"]
    active: bool


class PressEmergencyStop(_Command):
    """An emergency stop is pressed that is acknowledged at the robot (MANUAL) or from afar (REMOTE)."""

    command: Literal["emergencyStop"]
    stop: Literal[EmergencyStop.MANUAL, EmergencyStop.REMOTE] = EmergencyStop.MANUAL


class AcknowledgeEmergencyStop(_Command):
    """The emergency stop is released and acknowledged."""

    command: Literal["acknowledgeEmergencyStop"]


class SwitchPauseButton(_Command):
    """The pause button is pressed, or released."""

    command: Literal["pauseButton"]
    pressed: bool


class SwitchCharging(_Command):
    """The charger is put to the robot, or taken away."""

    command: Literal["charging"]
    charging: bool


class SetBattery(_Command):
    """The battery holds so many percent from now on."""

    command: Literal["battery"]
    state_of_charge: Annotated[float, Field(ge=0, le=100)]


class CarryAway(_Command):
    """The robot is carried somewhere (m, rad), by default on its own map, and knows where it is."""

    command: Literal["pose"]
    x: Finite
    y: Finite
    theta: Finite = 0.0
    map_id: Name | None = None


class SetSpeed(_Command):
    """The robot drives at so many m/s from now on, where the order does not want less."""

    command: Literal["speed"]
    speed: Positive


class PullTrigger(_Command):
    """Somebody at the robot releases the actions that wait for a trigger of this type."""

    command: Literal["trigger"]
    trigger_type: Name = "LOCAL"


class LoseLink(_Command):
    """The link to the broker breaks without a farewell, for so many seconds."""

    command: Literal["linkSilence"]
    seconds: Annotated[float, Field(gt=0, le=3600)]


AnyCommand = (
    SwitchOperatingMode
    | SwitchLocalization
    | SwitchNavigation
    | MakeUnreachable
    | TakeRoute
    | SwitchError
    | SwitchFieldViolation
    | PressEmergencyStop
    | AcknowledgeEmergencyStop
    | SwitchPauseButton
    | SwitchCharging
    | SetBattery
    | CarryAway
    | SetSpeed
    | PullTrigger
    | LoseLink
)

_parser: TypeAdapter[AnyCommand] = TypeAdapter(Annotated[AnyCommand, Field(discriminator="command")])


def parse(payload: bytes) -> AnyCommand:
    """Read a command from JSON.

    Raises:
        CommandRefusedError: it is no JSON, or no command.

    """
    try:
        return _parser.validate_json(payload)
    except ValidationError as error:
        raise CommandRefusedError(*in_words(error.errors(), whole="command", most=TOLD)) from error
