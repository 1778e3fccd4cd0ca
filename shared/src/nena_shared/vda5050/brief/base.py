"""What all briefs have in common."""

from __future__ import annotations

from datetime import UTC, datetime
from math import pi
from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import force_setattr

from nena_shared.clock import in_utc

UInt32 = Annotated[int, Meta(ge=0, le=2**32 - 1)]
Angle = Annotated[float, Meta(ge=-pi - 1e-6, le=pi + 1e-6)]
NotNegative = Annotated[float, Meta(ge=0)]
Percent = Annotated[float, Meta(ge=0, le=100)]
Share = Annotated[float, Meta(ge=0, le=1)]
Identifier = Annotated[str, Meta(max_length=1024)]
Moment = Annotated[datetime, Meta(tz=True)]
Version = Annotated[str, Meta(pattern=r"^[0-9]+\.[0-9]+\.[0-9]+\Z", max_length=32)]


class Brief(Struct, frozen=True, kw_only=True, rename="camel", gc=False):
    """An immutable JSON object with the names of 3.0; trees of them need no collector of garbage."""


class HeaderBrief(Brief, frozen=True, kw_only=True, gc=False):
    """The five fields at the top of each message."""

    header_id: UInt32
    timestamp: Moment
    version: Version
    manufacturer: Identifier
    serial_number: Identifier

    def __post_init__(self) -> None:
        """Have the time in UTC."""
        if self.timestamp.tzinfo is not UTC:
            force_setattr(self, "timestamp", in_utc(self.timestamp))
