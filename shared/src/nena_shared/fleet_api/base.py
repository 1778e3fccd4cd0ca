"""What the bodies have in common."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer
from pydantic.alias_generators import to_camel


class Resource(BaseModel):
    """A JSON object that NeNa sends; immutable; readers pass over fields that they do not know."""

    model_config = ConfigDict(
        frozen=True,
        extra="ignore",
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        allow_inf_nan=False,
    )


class Request(BaseModel):
    """A JSON object that NeNa is sent; a field that nobody knows is an error, not a wish ignored."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        allow_inf_nan=False,
    )


def iso(moment: datetime) -> str:
    """Write a UTC time as ISO 8601 with milliseconds; the year has four digits, else nobody can read it."""
    return f"{moment.isoformat(timespec='milliseconds')[:23]}Z"


def _in_utc(value: datetime) -> datetime:
    try:
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    except OverflowError as error:
        message = "lies before the year 1 or after the year 9999 in UTC"
        raise ValueError(message) from error


Moment = Annotated[datetime, AfterValidator(_in_utc), PlainSerializer(iso, return_type=str, when_used="json")]
"""ISO 8601 in UTC with milliseconds."""

ObjectName = Annotated[str, Field(min_length=1, max_length=200)]
"""Name of an object of the plant model, kept to the letter."""

OrderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_:\-][A-Za-z0-9_.:\-]{0,99}$")]
"""Name of a transport order; it also stands in MQTT topics and URLs, where ``..`` means something else."""
