"""The results of the checks, as Markdown and as JSON."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass

from nav2_acceptance.checks import CHECKS
from nav2_acceptance.site import LeftOutError, Nav2Site

OK, FAILED, LEFT_OUT = "ok", "FAILED", "skipped"


@dataclass(frozen=True)
class Finding:
    """The result of one check: ``text`` is what it found, ``seconds`` how long it took."""

    letter: str
    name: str
    verdict: str
    text: str
    seconds: float


async def run(site: Nav2Site, letters: Iterable[str] = tuple(CHECKS)) -> list[Finding]:
    """Run the checks one after the other; after one that fails, robot and agent are reset."""
    findings = []
    for letter in letters:
        name, check = CHECKS[letter]
        began = time.monotonic()
        site.tell(f"{letter} {name} ...")
        try:
            verdict, text = OK, await check(site)
        except LeftOutError as error:
            verdict, text = LEFT_OUT, str(error)
        except Exception as error:  # noqa: BLE001 - any failure belongs in the report
            verdict, text = FAILED, _words(error)
        finding = Finding(letter, name, verdict, text, round(time.monotonic() - began, 1))
        site.tell(f"{letter} {name}: {verdict} after {finding.seconds:g} s: {text}")
        findings.append(finding)
        if verdict != OK:
            await _reset(site)
    return findings


async def _reset(site: Nav2Site) -> None:
    try:
        await site.reset()
    except Exception as error:  # noqa: BLE001 - the next check shows what still works
        site.tell(f"the reset has failed, so the next check may fail too: {_words(error)}")


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error)[:500]}"


def as_json(findings: Iterable[Finding]) -> str:
    """Return the report for programs."""
    return json.dumps([asdict(each) for each in findings], indent=2) + "\n"


def as_markdown(findings: Iterable[Finding]) -> str:
    """Return the report for people."""
    lines = ["| | check | result | found | s |", "|---|---|---|---|---|"]
    for each in findings:
        text = each.text.replace("|", "/").replace("\n", " ")
        lines.append(f"| {each.letter} | {each.name} | {each.verdict} | {text} | {each.seconds:g} |")
    return "\n".join(lines) + "\n"
