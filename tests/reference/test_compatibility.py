from __future__ import annotations

from reference.compatibility import DOCUMENT, document
from support.deviating_robots import DEVIATIONS


def test_document_is_up_to_date() -> None:
    expected = document()
    assert DOCUMENT.read_text(encoding="utf-8") == expected, (
        "run `make reference` and commit docs/compatibility.md"
    )


def test_each_deviation_is_named_once() -> None:
    words = [each.words for each in DEVIATIONS]
    assert len(words) == len(set(words))
