"""Errors of messages that cannot be accepted."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import ValidationError
from pydantic_core import from_json, to_json

from nena_shared.findings import in_words

REFERENCE_KEYS = ("headerId", "orderId", "orderUpdateId")
REFERENCE_LENGTH = 1024
"""Characters; a longer value refers to nothing that was ever accepted."""

QUOTE = " (received "
"""Separator between a problem and the quoted value."""

QUOTED = 60
"""Characters of a received value that are quoted."""

PROBLEMS_SHOWN = 5
TOO_MANY = 1000


class MalformedMessageError(Exception):
    """The payload is not a message of its topic and version.

    ``problems`` has one sentence per error; ``references`` has what could still be read of headerId, orderId
    and orderUpdateId, so that the answer can identify the message (section 6.6.5.2).
    """

    def __init__(
        self, kind: str, problems: Sequence[str], payload: bytes = b"", *, received: str = ""
    ) -> None:
        self.kind = kind
        self.received = received
        """The value that the first problem is about, shortened; empty if there is none."""
        self.problems = tuple(problems[:PROBLEMS_SHOWN])
        self.references = _readable_references(payload)
        super().__init__(f"not a valid {kind}: {'; '.join(self.problems)}")

    @property
    def reason(self) -> str:
        """The first problem with the value that was received, in one line."""
        quote = f"{QUOTE}{self.received})" if self.received else ""
        return f"{self.problems[0]}{quote}"

    @property
    def quoted_problems(self) -> tuple[str, ...]:
        """The problems, the first with the value that was received."""
        return (self.reason, *self.problems[1:])


def received_in(error: ValidationError, payload: bytes) -> str:
    """Quote what pydantic's first finding is about: a value, or the beginning of what is no JSON."""
    if error.error_count() > TOO_MANY:
        return ""
    first = error.errors(include_url=False, include_context=False)[0]
    if first["type"] == "missing":
        return ""
    if first["type"] == "json_invalid":
        return repr(payload[:QUOTED])[1:]
    return quoted(first["input"])


def quoted(value: object) -> str:
    """Return a value as it was in a message, shortened."""
    if isinstance(value, str | int | list | dict):
        try:
            text = to_json(value).decode()
        except (ValueError, RecursionError):
            text = repr(value)
    else:
        text = "null" if value is None else repr(value)
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def problems_of(error: ValidationError, most: int | None = None) -> list[str]:
    """Put pydantic's findings into sentences with the path of the field, ``most`` of them at most.

    Very many are only counted: to list a hundred thousand of them keeps a program from its work for seconds.
    """
    if error.error_count() > TOO_MANY:
        return [f"message: {error.error_count()} values do not fit"]
    found = error.errors(include_url=False, include_context=False, include_input=False)
    return in_words(found, whole="message", most=most)


def _readable_references(payload: bytes) -> dict[str, str]:
    try:
        content = from_json(payload)
    except ValueError:
        return {}
    if not isinstance(content, dict):
        return {}
    found = {key: content.get(key) for key in REFERENCE_KEYS}
    return {
        key: text
        for key, value in found.items()
        if isinstance(value, str | int) and not isinstance(value, bool)
        if len(text := str(value)) <= REFERENCE_LENGTH
    }
