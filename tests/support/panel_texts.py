"""The panel's texts, so that tests find its controls in any language."""

from __future__ import annotations

import json
import re
from functools import cache

from nena_status_aggregator.api.app import PANEL

ENTRY = re.compile(r'^  "([\w.:]+)":\s+("(?:[^"\\]|\\.)*"),$', re.MULTILINE)


@cache
def _catalogue(language: str) -> dict[str, str]:
    source = (PANEL / "texts" / f"{language}.js").read_text(encoding="utf-8")
    return {key: json.loads(text) for key, text in ENTRY.findall(source)}


class Texts:
    """The texts of one language."""

    def __init__(self, language: str) -> None:
        """``language`` is a BCP 47 tag such as ``de-DE``."""
        self._texts = _catalogue(language[:2])

    def __call__(self, key: str, **values: object) -> str:
        """Return a text with its values filled in."""
        return re.sub(r"\{(\w+)\}", lambda found: str(values[found[1]]), self._texts[key])

    def start(self, key: str) -> str:
        """Return a text up to its first value."""
        return self._texts[key].partition("{")[0].strip()
