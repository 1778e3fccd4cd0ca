"""What all VDA 5050 objects have in common (VDA 5050 3.0 section 7.1)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from math import isfinite, pi, remainder
from typing import Annotated, Any, Final, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, PlainSerializer, WithJsonSchema
from pydantic.alias_generators import to_camel

from nena_shared.clock import in_utc, iso

J = TypeVar("J", bound=JsonValue)


class WireObject(BaseModel):
    """An immutable JSON object (section 7.1).

    Unknown fields are passed over, no value is guessed from another type.
    """

    model_config = ConfigDict(
        frozen=True,
        strict=True,
        extra="ignore",
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        from_attributes=True,
        allow_inf_nan=False,
        ser_json_inf_nan="strings",
    )

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Return what the form's validators would change in a record of it (see ``records``).

        Raises:
            ValueError: the codec has to read the message.

        """
        del record
        return {}

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Make this version's form of a version-neutral object."""
        return cls.model_validate(neutral, by_name=True, by_alias=False)


Timestamp = Annotated[
    datetime,
    AfterValidator(in_utc),
    PlainSerializer(iso, return_type=str, when_used="json"),
    WithJsonSchema({"type": "string", "format": "date-time"}),
]
"""ISO 8601 in UTC with milliseconds; read with 0 to 9 decimals, and as UTC where no zone is given."""

UInt32 = Annotated[int, Field(ge=0, le=2**32 - 1)]
ANGLE_LIMIT: Final = 3.1416 + 1e-4
"""Greatest angle that is read, rad: 3.0.1 allows 3.1416, and robots round."""


def _within_half_turn(angle: float) -> float:
    """Return the same angle in [-π, π]: the schemas before 3.0.1 allow no more."""
    return angle if -pi <= angle <= pi else remainder(angle, 2 * pi)


Angle = Annotated[
    float,
    Field(ge=-ANGLE_LIMIT, le=ANGLE_LIMIT),
    PlainSerializer(_within_half_turn, return_type=float, when_used="json"),
]
"""Radians in [-π, π]; read up to 3.1416, as 3.0.1 has it, and written within [-π, π]."""

AllowedTurn = Annotated[
    float,
    Field(ge=0, le=ANGLE_LIMIT),
    PlainSerializer(lambda turn: min(turn, pi), return_type=float, when_used="json"),
]
"""Deviation from a heading, rad; one of π allows every heading."""

NotNegative = Annotated[float, Field(ge=0)]
Percent = Annotated[float, Field(ge=0, le=100)]
Identifier = Annotated[str, Field(max_length=1024)]

Version = Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$", max_length=32)]
"""Major, minor and patch number of a version of VDA 5050."""


def finite(value: J) -> J:
    """Return ``value`` if all numbers in it are valid in JSON (section 7.1).

    Raises:
        ValueError: it contains NaN or an infinity.
    """
    if not _is_finite(value):
        message = "NaN and infinity are not JSON numbers"
        raise ValueError(message)
    return value


def _is_finite(value: JsonValue) -> bool:
    if isinstance(value, float):
        return isfinite(value)
    if isinstance(value, dict):
        return all(map(_is_finite, value.values()))
    return all(map(_is_finite, value)) if isinstance(value, list) else True


JsonObject = Annotated[dict[str, JsonValue], AfterValidator(finite)]
"""Any JSON object."""


Epoch = Annotated[int, Field(ge=0, le=2**53 - 1)]


class Header(WireObject):
    """The five fields at the top of each message (section 7.2)."""

    header_id: UInt32
    """Counted per topic, one more for each message sent."""
    timestamp: Timestamp
    version: Version
    manufacturer: Identifier
    serial_number: Identifier

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Convert the time to UTC."""
        return {} if record.timestamp.tzinfo is UTC else {"timestamp": in_utc(record.timestamp)}


class CommandHeader(Header):
    """The header of a command from fleet control to a robot (section 7.2)."""

    nena_epoch: Epoch | None = None
    """NeNa's addition to the standard: an order service that replaces another one sends a greater number."""
