"""Errors of messages that cannot be accepted."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from pydantic import ValidationError
from pydantic_core import from_json, to_json

from nena_shared.findings import in_words

REFERENCE_KEYS = ("headerId", "orderId", "orderUpdateId")
_FIELD: Final = re.compile(r"(?!message:)([A-Za-z][\w.]*): ", re.ASCII)
"""The path of a field at the beginning of a problem."""
_PLACE: Final = re.compile(r"line (\d+) column (\d+)")
"""Where pydantic finds invalid JSON."""
REFERENCE_LENGTH = 1024
"""Maximum length of a reference, characters; no longer ID is ever accepted."""

QUOTE = " (received "
"""Separator between a problem and the quoted value."""

QUOTED = 60
"""Maximum length of a quoted value, characters."""

TWICE: Final = "is there twice, with different values"
"""What is wrong with a repeated key."""

PROBLEMS_SHOWN = 5
TOO_MANY = 1000


class MalformedMessageError(Exception):
    """The payload is not a message of its topic and version.

    ``problems`` has one sentence per error. ``references`` has headerId, orderId and orderUpdateId as far as
    they could be read, to identify the message in the error report (section 6.6.5.2), and as parameter the
    path of the first field with a problem.
    """

    def __init__(
        self, kind: str, problems: Sequence[str], payload: bytes = b"", *, received: str = ""
    ) -> None:
        self.kind = kind
        self.received = received
        """The value that caused the first problem, shortened; empty if there is none."""
        self.problems = tuple(problems[:PROBLEMS_SHOWN])
        self.references = _readable_references(payload)
        if self.problems and (field := _FIELD.match(self.problems[0])):
            self.references["parameter"] = field[1]
        super().__init__(f"not a valid {kind}: {'; '.join(self.problems)}")

    @property
    def reason(self) -> str:
        """The first problem with the received value, in one line."""
        quote = f"{QUOTE}{self.received})" if self.received else ""
        return f"{self.problems[0]}{quote}"

    @property
    def quoted_problems(self) -> tuple[str, ...]:
        """All problems, the first with the received value."""
        return (self.reason, *self.problems[1:])


def repeated_key(payload: bytes) -> str:
    """Return a key that stands in one object with different values, of which readers take the last; or ""."""
    repeated: list[str] = []

    def note(pairs: list[tuple[str, object]]) -> dict[str, object]:
        content = dict(pairs)
        if len(content) < len(pairs):
            repeated.extend(key for key, value in pairs if content[key] != value)
        return content

    with suppress(ValueError, RecursionError):
        json.loads(payload, object_pairs_hook=note)
    return repeated[0] if repeated else ""


def received_in(error: ValidationError, payload: bytes) -> str:
    """Quote the value of pydantic's first error; for invalid JSON the text around the place."""
    if error.error_count() > TOO_MANY:
        return ""
    first = error.errors(include_url=False, include_context=False)[0]
    if first["type"] == "missing":
        return ""
    if first["type"] == "json_invalid":
        if b"\0" in payload[:4]:  # the first characters of JSON are ASCII
            return "text in UTF-16 or UTF-32; JSON is sent in UTF-8"
        # what is wrong is before the place that the parser names
        line, column = map(int, _PLACE.findall(first["msg"])[0])
        lines = payload.split(b"\n")
        at = sum(len(each) + 1 for each in lines[: line - 1]) + column
        return repr(payload[max(at - QUOTED // 2, 0) :][:QUOTED])[1:]
    return quoted(first["input"])


def quoted(value: object) -> str:
    """Return a received value as JSON, shortened."""
    if isinstance(value, (str, int, list, dict)):  # a tuple is faster than a union
        try:
            text = to_json(value).decode()
        except (ValueError, RecursionError):
            text = repr(value)
    else:
        text = "null" if value is None else repr(value)
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def problems_of(error: ValidationError, most: int | None = None) -> list[str]:
    """Convert pydantic's errors to at most ``most`` sentences with field paths.

    Beyond TOO_MANY they are only counted, as listing 100,000 errors takes seconds.
    """
    if error.error_count() > TOO_MANY:
        return [f"message: {error.error_count()} invalid values"]
    errors = error.errors(include_url=False, include_context=False, include_input=False)
    return in_words(errors, whole="message", most=most)


def _readable_references(payload: bytes) -> dict[str, str]:
    try:
        content = from_json(payload)
    except ValueError:
        return {}
    if not isinstance(content, dict):
        return {}
    return {
        key: text
        for key in REFERENCE_KEYS
        if isinstance(value := content.get(key), str | int) and not isinstance(value, bool)
        if len(text := str(value)) <= REFERENCE_LENGTH
    }
