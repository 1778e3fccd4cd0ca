"""Reports of a test: terminal, JSON, JUnit XML, a badge, and one HTML file that works offline."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from html import escape
from typing import Final
from xml.etree.ElementTree import Element, SubElement, tostring

from pydantic_core import to_json
from rich.table import Table
from rich.text import Text

from nena_conversations.kit.clause import Outcome, Verdict

COLOURS: Final = {Outcome.PASSED: "green", Outcome.FAILED: "yellow", Outcome.NOT_APPLICABLE: "dim"}
"""Colours of outcomes; what must be kept and is not is red."""


def colour_of(verdict: Verdict) -> str:
    """Return the colour of a verdict on a terminal."""
    return "red" if verdict.violated else COLOURS[verdict.outcome]


def violations(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the clauses that the tested side must keep and violates."""
    return [each for each in verdicts if each.violated]


def summary(verdicts: Sequence[Verdict]) -> str:
    """Return the numbers of clauses by outcome in a sentence."""
    counts = Counter(each.words for each in verdicts)
    always = {outcome.value: None for outcome in Outcome}
    return ", ".join(f"{counts[words]} {words}" for words in always | dict.fromkeys(sorted(counts)))


def table(verdicts: Sequence[Verdict]) -> Table:
    """Return a table of all clauses that did not pass."""
    shown = Table("clause", "section", "strength", "verdict", "why")
    for each in verdicts:
        if each.outcome is not Outcome.PASSED:
            verdict = Text(each.words, style=colour_of(each))
            shown.add_row(Text(each.id), each.section, each.strength.value, verdict, Text(each.reason))
    return shown


def as_json(verdicts: Sequence[Verdict], about: dict[str, str]) -> bytes:
    """Return all verdicts as one JSON object."""
    return to_json({**about, "clauses": [asdict(each) for each in verdicts]}, indent=2)


def as_junit(verdicts: Sequence[Verdict], about: dict[str, str]) -> bytes:
    """Return all verdicts as JUnit XML: what should be done and is not is skipped, not failed."""
    counts = {"tests": str(len(verdicts)), "failures": str(len(violations(verdicts)))}
    suite = Element(
        "testsuite", {"name": f"VDA 5050 {about['version']} {next(iter(about.values()))}", **counts}
    )
    for each in verdicts:
        case = SubElement(
            suite, "testcase", {"name": each.id, "classname": each.section, "time": f"{each.seconds:.3f}"}
        )
        if each.violated:
            SubElement(case, "failure", {"message": each.reason}).text = "\n".join(each.messages)
        elif each.outcome is not Outcome.PASSED:
            SubElement(case, "skipped", {"message": each.reason})
    written: bytes = tostring(suite, encoding="utf-8", xml_declaration=True)
    return written


def as_html(verdicts: Sequence[Verdict], about: dict[str, str]) -> str:
    """Return one page with all verdicts and the messages of violations."""
    rows = "".join(_row(each) for each in verdicts)
    heads = "".join(f"<th>{name}</th>" for name in ("Clause", "Section", "Strength", "Verdict", "Why"))
    what = next(iter(about))
    facts = ", ".join(f"{escape(key)} {escape(value)}" for key, value in about.items())
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>VDA 5050 test</title><style>'
        "body{font:15px/1.5 system-ui,sans-serif;margin:2rem;max-width:75rem}table{border-collapse:collapse}"
        "th,td{text-align:left;vertical-align:top;padding:.3rem .6rem;border-bottom:1px solid #ccc}"
        ".passed{color:#0a6b2d}.failed{color:#7a5b00}.violated{color:#b00020;font-weight:600}pre{white-space:pre-wrap;font-size:12px}"
        f"</style><h1>VDA 5050 test of a {what}</h1><p>{facts}</p><p>{escape(summary(verdicts))}</p>"
        f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></html>"
    )


def as_badge(verdicts: Sequence[Verdict], about: dict[str, str]) -> str:
    """Return an SVG image for a README: the version, and how many clauses passed."""
    passed = sum(each.outcome is Outcome.PASSED for each in verdicts)
    failed = len(violations(verdicts))
    left, right = f"VDA 5050 {about['version']}", f"{failed} failed" if failed else f"{passed} passed"
    undriven = any(each.drives and each.outcome is Outcome.NOT_APPLICABLE for each in verdicts)
    right += ", no drives" if undriven else ""
    widths = [7 * len(text) + 14 for text in (left, right)]
    colour = "#b00020" if failed else "#7a5b00" if undriven else "#0a6b2d"
    texts = "".join(
        f'<text x="{middle}" y="14">{escape(text)}</text>'
        for text, middle in ((left, widths[0] / 2), (right, widths[0] + widths[1] / 2))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sum(widths)}" height="20" role="img">'
        f'<rect width="{widths[0]}" height="20" fill="#444"/>'
        f'<rect x="{widths[0]}" width="{widths[1]}" height="20" fill="{colour}"/>'
        f'<g fill="#fff" font-family="sans-serif" font-size="11" text-anchor="middle">{texts}</g></svg>'
    )


def _row(each: Verdict) -> str:
    messages = "".join(f"<pre>{escape(message)}</pre>" for message in each.messages)
    seen = f"<details><summary>messages</summary>{messages}</details>" if messages else ""
    cells = (
        f"{escape(each.id)}<br>{escape(each.title)}",
        escape(each.section),
        each.strength.value,
        f'<span class="{"violated" if each.violated else each.outcome.name.lower()}">{each.words}</span>',
        escape(each.reason) + seen,
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
