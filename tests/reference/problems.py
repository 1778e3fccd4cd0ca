"""Writes docs/problems.md: the types of problems of the order service."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from nena_shared.fleet_api.refusals import TYPES
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "problems.md"


def document() -> str:
    """Return the whole text."""
    text = (_HERE / "problems_introduction.md").read_text(encoding="utf-8")
    rows = (
        row((f"`{each.uri}`", str(int(each.status)), each.meaning, each.remedy)) for each in TYPES.values()
    )
    head = ("type", "status", "meaning", "what to do")
    return "\n".join([text, row(head), row("---" for _ in head), *rows, ""])


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
