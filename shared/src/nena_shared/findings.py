"""Findings of pydantic in words, a line each with the path of the field."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

WORDS = {"extra_forbidden": "unknown field", "missing": "is missing"}
"""Texts by kind of finding, where pydantic uses programmers' terms: inputs and extras."""
PREFIX = "Value error, "
"""What pydantic puts before words of our own."""
SHOWN = 300
"""Length to which a name or a value in a text is cut: both may contain foreign input of any length."""
FINDINGS_SHOWN = 10
"""Maximum findings in one answer."""


def in_words(findings: Sequence[Any], *, whole: str, root: str = "", most: int | None = None) -> list[str]:
    """Return a line for each of pydantic's findings.

    Args:
        findings: as returned by ``ValidationError.errors()``.
        whole: replaces the path for a finding about the whole value.
        root: the first part of paths that is left out.
        most: maximum number of findings; one more line counts the rest.
    """
    lines = [f"{path_of(each['loc'], root) or whole}: {words_of(each)}" for each in findings[:most]]
    more = len(findings) - len(lines)
    return [*lines, f"{whole}: {more} more invalid values"] if more else lines


def path_of(location: Iterable[str | int], root: str = "") -> str:
    """Write where a field is: names and places in lists, with dots between them."""
    parts = list(map(str, location))
    return shortened(".".join(parts[1:] if parts[:1] == [root] else parts))


def words_of(finding: Any) -> str:  # noqa: ANN401 - pydantic and FastAPI have types of their own for the same
    """Return the problem of a field."""
    return WORDS.get(finding["type"]) or shortened(str(finding["msg"]).removeprefix(PREFIX))


def shortened(text: str) -> str:
    """Return the beginning of a long text."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
