"""Base classes and common types of request and response bodies."""

from __future__ import annotations

import re
from datetime import datetime
from enum import IntEnum
from typing import Annotated, Final

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, PlainSerializer
from pydantic.alias_generators import to_camel

from nena_shared import model_building
from nena_shared.clock import in_utc, iso
from nena_shared.frozen_model import FrozenModel


class Role(IntEnum):
    """Permissions of a user; each role includes the ones before it."""

    VIEWER = 1
    """Read everything."""
    OPERATOR = 2
    """Create orders and send commands."""
    ADMIN = 3
    """Change the plant model and zone sets; read the audit trail."""


class CamelCase(FrozenModel):
    """An immutable JSON object with camelCase names on the wire."""

    model_config = ConfigDict(
        alias_generator=to_camel,
        validate_by_name=True,
        validate_by_alias=True,
        allow_inf_nan=False,
        defer_build=model_building.deferred,
    )


class Resource(CamelCase):
    """A JSON object that NeNa sends; readers ignore unknown fields."""

    model_config = ConfigDict(extra="ignore")


class Request(CamelCase):
    """A JSON object that NeNa receives; unknown fields are errors."""

    model_config = ConfigDict(extra="forbid")


_DIGITS: Final = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_UNIX_TIME: Final = re.compile(r"\d{10}(\d{3})?(\.\d*)?", re.ASCII)


def _refuse_digits(value: object) -> object:
    """Return a time; raise ValueError for digits that pydantic reads as a time of 1970, such as 20260101."""
    digits = str(value).strip() if isinstance(value, str | int | float) else ""
    if digits and _DIGITS.fullmatch(digits) and not _UNIX_TIME.fullmatch(digits):
        raise ValueError(
            "write ISO 8601, such as 2026-01-31T10:00:00Z, or a Unix time of 10 (s) or 13 (ms) digits"
        )
    return value


Moment = Annotated[
    datetime,
    BeforeValidator(_refuse_digits),
    AfterValidator(in_utc),
    PlainSerializer(iso, return_type=str, when_used="json"),
]
"""ISO 8601 in UTC with milliseconds; a Unix time of 10 (s) or 13 (ms) digits is read as well."""

ObjectName = Annotated[str, Field(min_length=1, max_length=200)]
DraftName = Annotated[str, Field(pattern=r"^[^/\x00-\x1f]{1,80}$")]
"""Name of a draft of a plant model; part of a URL."""
VersionNumber = Annotated[int, Field(ge=1)]
"""Name of an object in the plant model, never changed."""

PageSize = Annotated[int, Field(ge=1, le=1000)]
"""Maximum number of objects in a page of a list."""

IdempotencyKey = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00]*$")]
"""Request ID, unique among all hosts; without NUL, which PostgreSQL cannot store."""

TRACEPARENT: Final = r"^00-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}$"
Traceparent = Annotated[str, Field(pattern=TRACEPARENT)]
"""The caller's trace and span, in version 00 of W3C Trace Context."""

OrderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_:\-][A-Za-z0-9_.:\-]{0,99}$")]
"""Name of a transport order. Used in MQTT topics and URLs, so ``..`` is not allowed."""
