"""Commands in the guides of docs, for tests that follow them."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def commands(page: str, holding: str) -> str:
    """Return the one block of shell commands of a page that holds a text."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks: list[str] = re.findall(r"```bash\n(.*?)```", text, re.DOTALL)
    found = [each for each in blocks if holding in each]
    assert len(found) == 1, f"{page} has {len(found)} blocks with {holding!r}"
    return found[0]
