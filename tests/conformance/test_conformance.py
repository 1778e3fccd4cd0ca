from __future__ import annotations

from conformance.catalogue import chapters
from conformance.markers import shown_by_tests
from conformance.table import by_clause, problems


def test_each_clause_has_a_test_and_each_marker_a_clause() -> None:
    assert problems(chapters(), by_clause(shown_by_tests())) == []
