"""A robot says whether it is there, and a state comes every half minute."""

from __future__ import annotations

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_cli.vda5050.recording import Entry
from support.talk import VERSIONS, Talk


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_comes_each_half_minute(version: str) -> None:
    fine = Talk(version).online().state("n0", of="").wait(29).state("n0", of="")
    late = Talk(version).online().state("n0", of="").wait(40).state("n0", of="")

    assert fine.rules == []
    (finding,) = late.findings
    assert (finding.rule, finding.severity) == (Rule.STATE_INTERVAL, Severity.ERROR)
    assert finding.section == ("6.6" if version == "3.0.0" else "6.10")


def test_silence_is_told_while_others_speak() -> None:
    talk = Talk().online().state("n0", of="").wait(60)
    talk.entries.append(Entry(talk.now, "fleet/v3/ACME/0002/state", b"?"))

    first = talk.findings[0]
    assert (first.rule, first.number) == (Rule.STATE_INTERVAL, 2)
    assert talk.state("n0", of="").rules.count(Rule.STATE_INTERVAL) == 1


@pytest.mark.parametrize("away", ["OFFLINE", "HIBERNATING", "CONNECTION_BROKEN"])
def test_a_robot_that_is_away_says_nothing(away: str) -> None:
    talk = Talk().online().state("n0", of="").online(away).wait(400).online().state("n0", of="")

    assert talk.findings == []


@pytest.mark.parametrize(
    ("away", "severity"),
    [
        ("OFFLINE", Severity.ERROR),
        ("HIBERNATING", Severity.ERROR),
        ("CONNECTION_BROKEN", Severity.WARNING),
    ],
)
def test_a_robot_that_is_away_sends_no_states(away: str, severity: Severity) -> None:
    talk = Talk().online().state("n0", of="").online(away).state("n0", of="").state("n0", of="")

    (finding,) = talk.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.CONNECTION, severity, 4)


def test_a_robot_whose_connection_was_not_heard_may_be_there() -> None:
    assert Talk().state("n0", of="").findings == []
