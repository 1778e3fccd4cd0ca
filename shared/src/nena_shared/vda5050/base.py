"""Base classes and common types of all VDA 5050 messages (VDA 5050 3.0 section 7.1)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from math import isfinite, pi, remainder
from typing import Annotated, Any, Final, Self, TypeVar

from pydantic import AfterValidator, ConfigDict, Field, JsonValue, PlainSerializer, WithJsonSchema
from pydantic.alias_generators import to_camel

from nena_shared import model_building
from nena_shared.clock import in_utc, iso
from nena_shared.frozen_model import FrozenModel

J = TypeVar("J", bound=JsonValue)


class WireObject(FrozenModel):
    """An immutable JSON object (section 7.1).

    Unknown fields are ignored. Values are not converted from other types.
    """

    model_config = ConfigDict(
        strict=True,
        extra="ignore",
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        from_attributes=True,
        allow_inf_nan=False,
        ser_json_inf_nan="strings",
        defer_build=model_building.deferred,
    )

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Return the fields that the form's validators would change in a record (see ``records``).

        Raises:
            ValueError: only the codec can read the message.
        """
        del record
        return {}

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert a version-neutral object to this version's form."""
        return cls.model_validate(neutral, by_name=True, by_alias=False)


Timestamp = Annotated[
    datetime,
    AfterValidator(in_utc),
    PlainSerializer(iso, return_type=str, when_used="json"),
    WithJsonSchema({"type": "string", "format": "date-time"}),
]
"""ISO 8601 in UTC with milliseconds. Accepts 0 to 9 decimals; a time without a zone is UTC."""

UInt32 = Annotated[int, Field(ge=0, le=2**32 - 1)]
ANGLE_LIMIT: Final = 3.1416 + 1e-4
"""Largest accepted angle, rad: 3.1416 as in 3.0.1, plus a tolerance for rounding."""


def _within_half_turn(angle: float) -> float:
    """Wrap an angle to [-π, π], the limits of the schemas before 3.0.1."""
    return angle if -pi <= angle <= pi else remainder(angle, 2 * pi)


Angle = Annotated[
    float,
    Field(ge=-ANGLE_LIMIT, le=ANGLE_LIMIT),
    PlainSerializer(_within_half_turn, return_type=float, when_used="json"),
]
"""Radians in [-π, π]. Accepts up to ±3.1416 (3.0.1); written within [-π, π]."""

AllowedTurn = Annotated[
    float,
    Field(ge=0, le=ANGLE_LIMIT),
    PlainSerializer(lambda turn: min(turn, pi), return_type=float, when_used="json"),
]
"""Allowed deviation from a heading, rad; π allows any heading."""

NotNegative = Annotated[float, Field(ge=0)]
Percent = Annotated[float, Field(ge=0, le=100)]
Identifier = Annotated[str, Field(max_length=1024)]

Version = Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$", max_length=32)]
"""VDA 5050 version number: major, minor and patch."""


def finite(value: J) -> J:
    """Return ``value`` if all numbers in it are valid in JSON (section 7.1).

    Raises:
        ValueError: it contains NaN or an infinity.
    """
    if not _is_finite(value):
        raise ValueError("NaN and infinity are not JSON numbers")
    return value


def _is_finite(value: JsonValue) -> bool:
    if isinstance(value, float):
        return isfinite(value)
    if isinstance(value, dict):
        return all(map(_is_finite, value.values()))
    return all(map(_is_finite, value)) if isinstance(value, list) else True


JsonObject = Annotated[dict[str, JsonValue], AfterValidator(finite)]
"""Any JSON object."""


# up to 2**53: readers in other languages may read JSON numbers as floats
Epoch = Annotated[int, Field(ge=0, le=2**53 - 1)]


class Header(WireObject):
    """The five header fields of every message (section 7.2)."""

    header_id: UInt32
    """Incremented per topic with each message sent."""
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
    """NeNa's extension: increases with each order service that takes over from another."""
