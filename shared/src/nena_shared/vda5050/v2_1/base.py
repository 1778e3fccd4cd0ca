"""Types that 2.x writes in its own way."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, ValidationInfo

from nena_shared.vda5050.base import in_utc


def _hundredths(value: datetime) -> str:
    milliseconds = value.replace(tzinfo=None).isoformat(timespec="milliseconds")
    return milliseconds[:-1] + "Z"


TimestampV2 = Annotated[
    datetime, AfterValidator(in_utc), PlainSerializer(_hundredths, return_type=str, when_used="json")
]
"""ISO 8601 in UTC with hundredths of a second (2.1 section 6.4)."""


def reads(names: Mapping[str, str]) -> BeforeValidator:
    """Read the given 2.x names as the neutral ones that stand beside them; other values pass."""

    def read(value: object) -> object:
        return names.get(value, value) if type(value) is str else value

    return BeforeValidator(read)


def writes(names: Mapping[str, str]) -> PlainSerializer:
    """Write the neutral values by the given 2.x names; other values as they are."""

    def write(value: str) -> str:
        return names.get(value, str(value))

    return PlainSerializer(write, return_type=str, when_used="json")


def always(value: object) -> BeforeValidator:
    """Take ``value`` whatever is given: for a field that 2.x does not have."""
    return BeforeValidator(lambda _: value)


Absent = Annotated[None, always(None), Field(exclude=True)]
"""An optional field that 2.x does not have: neither read nor written."""


def _turned_when_read(value: object, info: ValidationInfo) -> object:
    return not value if info.mode == "json" and isinstance(value, bool) else value


def _turned(value: bool | None) -> bool | None:  # noqa: FBT001 - the serializer's form
    return None if value is None else not value


Negated = Annotated[
    bool | None, BeforeValidator(_turned_when_read), PlainSerializer(_turned, when_used="json")
]
"""For a truth value that 2.x states the other way round."""
