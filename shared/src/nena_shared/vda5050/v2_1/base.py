"""Types that 2.x writes in its own way."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, ValidationInfo, WithJsonSchema

from nena_shared.clock import in_utc


def _hundredths(value: datetime) -> str:
    milliseconds = value.replace(tzinfo=None).isoformat(timespec="milliseconds")
    return milliseconds[:-1] + "Z"


TimestampV2 = Annotated[
    datetime,
    AfterValidator(in_utc),
    PlainSerializer(_hundredths, return_type=str, when_used="json"),
    WithJsonSchema({"type": "string", "format": "date-time"}),
]
"""ISO 8601 in UTC with hundredths of a second (2.1 section 6.4)."""

TimestampOrNow = Annotated[TimestampV2, Field(default_factory=lambda: datetime.now(UTC))]
"""For messages whose header 2.x does not demand: one without a time is as new as its reading."""


def _turned_when_read(value: object, info: ValidationInfo) -> object:
    return not value if info.mode == "json" and isinstance(value, bool) else value


def _turned(value: bool | None) -> bool | None:  # noqa: FBT001 - the serializer's form
    return None if value is None else not value


Negated = Annotated[
    bool | None, BeforeValidator(_turned_when_read), PlainSerializer(_turned, when_used="json")
]
"""For a boolean that 2.x states the other way round."""
