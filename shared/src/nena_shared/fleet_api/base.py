"""What the bodies have in common."""

from __future__ import annotations

from datetime import datetime
from enum import IntEnum
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer
from pydantic.alias_generators import to_camel

from nena_shared.clock import in_utc, iso


class Role(IntEnum):
    """Permissions of a user; each role includes those before it."""

    VIEWER = 1
    """Read everything."""
    OPERATOR = 2
    """Create orders and send commands."""
    ADMIN = 3
    """Change how the fleet works: plant model and zone sets."""


class CamelCase(BaseModel):
    """A JSON object with camelCase names on the wire; immutable."""

    model_config = ConfigDict(
        frozen=True,
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        allow_inf_nan=False,
    )


class Resource(CamelCase):
    """A JSON object that NeNa sends; readers ignore unknown fields."""

    model_config = ConfigDict(extra="ignore")


class Request(CamelCase):
    """A JSON object that NeNa receives; an unknown field is an error."""

    model_config = ConfigDict(extra="forbid")


Moment = Annotated[datetime, AfterValidator(in_utc), PlainSerializer(iso, return_type=str, when_used="json")]
"""ISO 8601 in UTC with milliseconds."""

ObjectName = Annotated[str, Field(min_length=1, max_length=200)]
"""Name of an object of the plant model, kept to the letter."""

IdempotencyKey = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00]*$")]
"""Unique ID of a request among all hosts; no NUL, which PostgreSQL cannot store."""

OrderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_:\-][A-Za-z0-9_.:\-]{0,99}$")]
"""Name of a transport order; also used in MQTT topics and URLs, where ``..`` has another meaning."""
