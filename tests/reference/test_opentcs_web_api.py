from __future__ import annotations

from reference.opentcs_web_api import DOCUMENT, document
from support.opentcs_routes import ROUTES


def test_document_is_up_to_date() -> None:
    expected = document()
    assert DOCUMENT.read_text(encoding="utf-8") == expected, (
        "run `make reference` and commit docs/opentcs-web-api.md"
    )


def test_each_route_is_named_once() -> None:
    lines = [f"{each.method} {each.path}" for each in ROUTES]
    assert len(lines) == len(set(lines))
