"""Format pydantic's errors, one line each with the path of the field."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

WORDS = {
    "extra_forbidden": "unknown field",
    "missing": "is missing",
    "model_type": "Input should be an object",
    "tuple_type": "Input should be a valid array",
}
"""Texts by error type, where pydantic's own use programming terms ("inputs", "extra", "instance of")."""
PREFIX = "Value error, "
"""Prefix that pydantic adds to our own messages."""
SHOWN = 300
"""Maximum length of a path or message, characters; both may contain untrusted input of any length."""
FINDINGS_SHOWN = 10
"""Maximum number of errors in a response."""


def in_words(findings: Sequence[Any], *, whole: str, root: str = "", most: int | None = None) -> list[str]:
    """Return a line for each of pydantic's errors.

    Args:
        findings: as returned by ``ValidationError.errors()``.
        whole: replaces the path of errors about the whole value.
        root: first part of paths, to be omitted.
        most: maximum number of errors; an additional line counts the rest.
    """
    lines = [f"{path_of(finding['loc'], root) or whole}: {words_of(finding)}" for finding in findings[:most]]
    more = len(findings) - len(lines)
    return [*lines, f"{whole}: {more} more invalid values"] if more else lines


def path_of(location: Iterable[str | int], root: str = "") -> str:
    """Return the path of a field: names and list indices, separated by dots."""
    parts = list(map(str, location))
    return shortened(".".join(parts[1:] if parts[:1] == [root] else parts))


def words_of(finding: Any) -> str:  # noqa: ANN401 - pydantic and FastAPI have types of their own for the same
    """Return the message of an error."""
    return WORDS.get(finding["type"]) or shortened(str(finding["msg"]).removeprefix(PREFIX))


def shortened(text: str) -> str:
    """Shorten a text to SHOWN characters."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def letters_of(word: str) -> str:
    """Return a word without what spellings of it differ in: letter case, blanks, `_` and `-`."""
    return word.casefold().replace("_", "").replace("-", "").replace(" ", "")
