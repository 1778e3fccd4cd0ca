from __future__ import annotations

from nena_shared.fleet_api.refusals import MalformedRequest, Refusal
from nena_status_aggregator.api.problem_types import Rejection
from reference.problems import DOCUMENT, document


def test_document_is_up_to_date() -> None:
    expected = document()
    assert DOCUMENT.read_text(encoding="utf-8") == expected, (
        "run `make reference` and commit docs/problems.md"
    )


def test_each_type_is_described() -> None:
    for each in (*MalformedRequest, *Refusal, *Rejection):
        assert f"| `{each.uri}` | {int(each.status)} |" in document()
