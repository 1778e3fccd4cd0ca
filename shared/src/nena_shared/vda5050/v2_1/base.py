"""Types with a different format in 2.x."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, ValidationInfo, WithJsonSchema

from nena_shared.clock import in_utc


def _write_hundredths(value: datetime) -> str:
    # cut, not rounded: a time of sending must not lie in the future
    return value.replace(tzinfo=None).isoformat(timespec="milliseconds")[:-1] + "Z"


TimestampV2 = Annotated[
    datetime,
    AfterValidator(in_utc),
    PlainSerializer(_write_hundredths, return_type=str, when_used="json"),
    WithJsonSchema({"type": "string", "format": "date-time"}),
]
"""ISO 8601 in UTC with hundredths of a second (2.1 section 6.4)."""

TimestampOrNow = Annotated[TimestampV2, Field(default_factory=lambda: datetime.now(UTC))]
"""For messages without a mandatory header in 2.x: defaults to the time of reading."""


def _negated_in_json(value: object, info: ValidationInfo) -> object:
    # neutral objects that are converted to this version already have the neutral meaning
    return not value if info.mode == "json" and isinstance(value, bool) else value


def _negate_value(value: bool | None) -> bool | None:  # noqa: FBT001 - the serializer's form
    return None if value is None else not value


Negated = Annotated[
    bool | None, BeforeValidator(_negated_in_json), PlainSerializer(_negate_value, when_used="json")
]
"""A boolean with the opposite meaning in 2.x."""
