from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from conformance.catalogue import CatalogueError, Chapter, Clause, Side, Standing, chapters
from conformance.markers import MarkerError, Shown, shown_by_tests
from conformance.table import DOCUMENT, by_clause, document, problems


def clause(**more: object) -> Clause:
    return Clause.model_validate({"id": "6.1", "title": "an order", "side": "robot", "how": "driven"} | more)


def test_each_clause_has_a_test_and_each_marker_a_clause() -> None:
    assert problems(chapters(), by_clause(shown_by_tests())) == []


def test_document_is_up_to_date() -> None:
    assert DOCUMENT.read_text() == document(), "run `make conformance` and commit docs/vda5050.md"


def test_a_clause_without_a_test_and_a_marker_without_a_clause_are_named() -> None:
    catalogue = [
        Chapter(
            title="orders",
            clause=(
                clause(),
                clause(id="6.2", standing="planned", reason="next month"),
                clause(id="6.3", standing="not done", reason="no robot can"),
                clause(id="6.4", standing="partly", reason="no robot can all of it"),
            ),
        )
    ]

    found = problems(catalogue, by_clause([Shown("6.5", "unit/test_a.py", "test_it")]))

    assert found == [
        "clause 6.1 (an order) is done, and no test shows it",
        "clause 6.4 (an order) is partly, and no test shows it",
        "unit/test_a.py::test_it shows clause 6.5, which is not in the catalogue",
    ]


def test_an_unsupported_clause_needs_a_reason() -> None:
    with pytest.raises(ValidationError, match=r"clause 6\.1 is not done, and no reason says why"):
        clause(standing=Standing.NOT_DONE)


def test_an_implemented_clause_describes_how() -> None:
    with pytest.raises(ValidationError, match=r"clause 6\.1 does not say how it is kept"):
        clause(how="")


def test_the_texts_of_a_version_override_the_common_ones() -> None:
    said = clause(side=Side.BOTH, how="all", in_2_1="2.1")
    assert [said.in_version(each) for each in ("2.0.0", "2.1.0", "3.0.0")] == ["all", "2.1", "all"]
    said = clause(how="", in_2="2.x", in_2_0="2.0")
    assert [said.in_version(each) for each in ("2.0.0", "2.1.0", "3.0.0")] == ["2.0", "2.x", ""]


def test_a_clause_is_defined_once(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(
            'title = "t"\n[[clause]]\nid = "6.1"\ntitle = "t"\nside = "robot"\nhow = "h"\n'
        )
    with pytest.raises(CatalogueError, match=r"twice in the catalogue: 6\.1"):
        chapters(tmp_path)


def test_markers_are_found_wherever_pytest_finds_them(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "import pytest\n"
        'pytestmark = [pytest.mark.broker, pytest.mark.clause("1")]\n'
        '@pytest.mark.clause("2", "3")\n'
        "def test_a(): ...\n"
        '@pytest.mark.parametrize("x", [pytest.param(1, marks=pytest.mark.clause("4"))])\n'
        "async def test_b(x): ...\n"
        "def helper(): ...\n"
        '@pytest.mark.clause("5")\n'
        "class TestC:\n"
        '    pytestmark = pytest.mark.clause("6")\n'
        "    def test_d(self): ...\n"
        "TestE = Machine.TestCase\n"
    )
    found = {(each.test, each.clause) for each in shown_by_tests(tmp_path)}
    assert found == {
        *(("test_a", each) for each in "123"),
        *(("test_b", each) for each in "14"),
        *(("test_d", each) for each in "156"),
        ("TestE", "1"),
    }


def test_a_marker_is_written_out(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text("@pytest.mark.clause(SECTION)\ndef test_a(): ...\n")
    with pytest.raises(MarkerError, match=r"test_it\.py:1: name the clauses"):
        shown_by_tests(tmp_path)
