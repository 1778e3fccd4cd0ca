"""Reports of a conformance test: what must be kept, what should be, and what was not tried."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rich.console import Console

from nena_conversations.kit import report
from nena_conversations.kit.clause import Outcome, Strength, Verdict

KEPT = Verdict("state/position", "A position", "6.10", Strength.MUST, Outcome.PASSED)
ADVISED = replace(
    KEPT, id="errors/references", strength=Strength.SHOULD, outcome=Outcome.FAILED, reason="none"
)
VIOLATED = replace(ADVISED, id="order/lost", strength=Strength.MUST)
UNDRIVEN = replace(KEPT, id="drive", outcome=Outcome.NOT_APPLICABLE, drives=True)
ABOUT = {"robot": "ACME/1", "version": "2.1.0"}


def test_what_should_be_done_is_told_from_what_must_be() -> None:
    verdicts = [KEPT, ADVISED, VIOLATED]
    assert report.summary(verdicts) == "1 passed, 1 failed, 0 not applicable, 1 failed (should)"
    assert (report.colour_of(ADVISED), report.colour_of(VIOLATED)) == ("yellow", "red")
    page = report.as_html(verdicts, ABOUT)
    assert '<span class="failed">failed (should)</span>' in page
    assert '<span class="violated">failed</span>' in page
    console = Console(width=200)
    with console.capture() as shown:
        console.print(report.table(verdicts))
    assert "failed (should)" in shown.get()


@pytest.mark.parametrize(
    ("verdicts", "text", "colour"),
    [
        ([KEPT, ADVISED], "1 passed", "#0a6b2d"),
        ([KEPT, UNDRIVEN], "1 passed, no drives", "#7a5b00"),
        ([KEPT, VIOLATED, UNDRIVEN], "1 failed, no drives", "#b00020"),
    ],
)
def test_the_badge_is_green_only_if_drives_were_tested(
    verdicts: list[Verdict], text: str, colour: str
) -> None:
    badge = report.as_badge(verdicts, ABOUT)
    assert f">{text}<" in badge
    assert colour in badge
