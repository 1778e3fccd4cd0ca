"""Writes docs/opentcs-web-api.md: the routes of openTCS's web API, and what NeNa answers."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from support.markdown import row
from support.opentcs_routes import ROUTES, Route

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "opentcs-web-api.md"


def document() -> str:
    """Return the whole text."""
    head = ("route", "documented", "tried", "in NeNa")
    text = (_HERE / "opentcs_web_api_introduction.md").read_text(encoding="utf-8")
    return "\n".join([text, row(head), row("---" for _ in head), *map(_row, ROUTES), ""])


def _row(route: Route) -> str:
    tried = sorted({each.status for each in route.tries})
    return row(
        (
            f"`{route.method} {route.path}`",
            ", ".join(map(str, route.documented)),
            ", ".join(map(str, tried)) or "by a test of its own",
            route.note,
        )
    )


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
