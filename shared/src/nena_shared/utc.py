"""Times as they are read and written: in UTC, with milliseconds."""

from __future__ import annotations

from datetime import UTC, datetime


def in_utc(value: datetime) -> datetime:
    """Give the same moment in UTC; a time without a zone is taken as UTC.

    Raises:
        ValueError: in UTC the moment would be before the year 1 or after the year 9999.

    """
    try:
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    except OverflowError as error:
        message = "the time lies outside the years 1 to 9999 in UTC"
        raise ValueError(message) from error


def iso(moment: datetime) -> str:
    """Write a UTC time as ISO 8601 with milliseconds; the year has four digits, else nobody can read it."""
    return f"{moment.isoformat(timespec='milliseconds')[:23]}Z"
