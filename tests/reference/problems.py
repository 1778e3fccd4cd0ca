"""Writes docs/problems.md: the types of problems of the order service and the status aggregator."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from nena_shared.fleet_api.refusals import TYPES, ProblemType
from nena_status_aggregator.api.problem_types import Rejection
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "problems.md"


def document() -> str:
    """Return the whole text."""
    text = (_HERE / "problems_introduction.md").read_text(encoding="utf-8")
    return "\n".join([text, *_table(TYPES.values()), "", "## Status aggregator", "", *_table(Rejection), ""])


def _table(kinds: Iterable[ProblemType]) -> Iterator[str]:
    head = ("type", "status", "meaning", "what to do")
    yield row(head)
    yield row("---" for _ in head)
    for each in kinds:
        yield row((f"`{each.uri}`", str(int(each.status)), each.meaning, each.remedy))


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
