"""Writes docs/vda5050.md: how VDA 5050 is kept, clause by clause, and which tests show it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Final

from conformance.catalogue import VERSIONS, Chapter, Clause, Standing, chapters
from conformance.markers import TESTS, Shown, shown_by_tests
from nena_conversations.kit.fleet_clauses import FLEET_CLAUSES
from nena_conversations.kit.fleet_run import OF_ORDERS, OF_UPDATES
from nena_conversations.kit.robot_clauses import ROBOT_CLAUSES
from nena_conversations.kit.run import OF_THE_CONVERSATION
from nena_conversations.message import SENDERS
from nena_conversations.rules import MESSAGES
from nena_shared.vda5050.topics import Topic
from support.markdown import row

DOCUMENT: Final = TESTS.parent / "docs" / "vda5050.md"
_HERE: Final = Path(__file__).parent
NAMED: Final = 4
"""Tests of one file that a row names; of more it tells the number."""


def _of_the_kit() -> dict[str, list[str]]:
    """Return the clauses that `nena vda5050 test` judges, by section of 3.0."""
    found: dict[str, list[str]] = {}
    for side, clauses in (("robot", ROBOT_CLAUSES), ("fleet", FLEET_CLAUSES)):
        for clause in clauses:
            found.setdefault(str(clause.sections.v3), []).append(f"{side} {clause.id}")
    for side, rules in (("robot", OF_THE_CONVERSATION), ("fleet", OF_ORDERS | OF_UPDATES)):
        for rule in rules:
            section = str(rule.section(NEWEST, Topic.STATE))
            found.setdefault(section, []).append(f"{side} conversation/{rule.code}")
    for topic, sections in MESSAGES.items():
        found.setdefault(str(sections.v3), []).append(f"{SENDERS[topic]} {topic}/message")
    return found


NEWEST: Final = "3.0.0"
KIT: Final = _of_the_kit()

Tests = Mapping[str, tuple[Shown, ...]]
"""By clause."""


def by_clause(shown: Iterable[Shown]) -> Tests:
    """Sort what tests show by clause."""
    ordered = sorted(shown, key=lambda each: each.clause)
    return {clause: tuple(tests) for clause, tests in groupby(ordered, key=lambda each: each.clause)}


def problems(catalogue: Iterable[Chapter], tests: Tests) -> list[str]:
    """Return what does not match, a sentence each; empty if everything does."""
    clauses = {clause.id: clause for chapter in catalogue for clause in chapter.clause}
    unknown = (
        f"{test.file}::{test.test} shows clause {test.clause}, which is not in the catalogue"
        for clause in tests.keys() - clauses
        for test in tests[clause]
    )
    bare = (
        f"clause {clause.id} ({clause.title}) is {clause.standing}, and no test shows it"
        for clause in clauses.values()
        if clause.standing.needs_test and clause.id not in tests
    )
    return sorted([*unknown, *bare])


def document() -> str:
    """Return the whole text."""
    catalogue, tests = chapters(), by_clause(shown_by_tests())
    parts = [
        (_HERE / "introduction.md").read_text(),
        _summary(catalogue),
        *(_chapter(chapter, tests) for chapter in catalogue),
        (_HERE / "open_questions.md").read_text(),
    ]
    return "\n".join(parts)


def _summary(catalogue: Iterable[Chapter]) -> str:
    clauses = [clause for chapter in catalogue for clause in chapter.clause]
    counts = {each: sum(clause.standing is each for clause in clauses) for each in Standing}
    said = ", ".join(f"{count} {standing}" for standing, count in counts.items() if count)
    lines = [f"{len(clauses)} clauses: {said}.", ""]
    open_ones = [clause for clause in clauses if clause.standing is not Standing.DONE]
    if open_ones:
        lines += ["Not done, or only partly:", ""]
        lines += [
            f"- **{each.id}** {each.title} ({each.side}, {each.standing}): {each.reason}"
            for each in open_ones
        ]
        lines.append("")
    return "\n".join(lines)


def _chapter(chapter: Chapter, tests: Tests) -> str:
    head = ["Clause", "In 2.x", "Side", "Rule", *VERSIONS, "Shown by", "In the [test](conformance.md)"]
    rows = (
        _row(clause, tests.get(clause.id, ())) for clause in sorted(chapter.clause, key=lambda e: e.place)
    )
    lines = [f"## {chapter.title}", "", row(head), row("---" for _ in head), *map(row, rows), ""]
    return "\n".join(lines)


def _row(clause: Clause, shown: Iterable[Shown]) -> Iterator[str]:
    yield clause.id
    yield clause.v2 or "-"
    yield clause.side
    yield clause.title if clause.standing is Standing.DONE else f"{clause.title} (**{clause.standing}**)"
    yield from _texts(clause)
    yield "<br>".join(_tests(shown)) or "-"
    # rows of one section share the clauses of the kit: it names sections, not rows
    section = clause.id.partition("/")[0]
    yield ", ".join(sorted(KIT.get(section, ()))) or "-"


def _texts(clause: Clause) -> Iterator[str]:
    before = ""
    for version in VERSIONS:
        text = clause.in_version(version)
        yield ("same" if text == before else text) if text else "-"
        before = text


def _tests(shown: Iterable[Shown]) -> Iterator[str]:
    for file, group in groupby(shown, key=lambda each: each.file):
        names = [each.test.removeprefix("test_").replace("_", " ") for each in group]
        said = "; ".join(names) if len(names) <= NAMED else f"{len(names)} tests"
        yield f"[{Path(file).stem}](../tests/{file}): {said}"


if __name__ == "__main__":
    DOCUMENT.write_text(document())
