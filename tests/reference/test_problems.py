from __future__ import annotations

from nena_shared.fleet_api.refusals import MalformedRequest, Refusal
from reference.problems import DOCUMENT, document


def test_document_is_up_to_date() -> None:
    expected = document()
    assert DOCUMENT.read_text(encoding="utf-8") == expected, (
        "run `make reference` and commit docs/problems.md"
    )


def test_each_type_is_described() -> None:
    for each in (*MalformedRequest, *Refusal):
        assert f"| `{each.uri}` | {int(each.status)} |" in document()
