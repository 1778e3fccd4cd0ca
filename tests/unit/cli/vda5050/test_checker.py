"""A conversation of several robots, in several versions."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nena_cli.vda5050.checker import Checker
from nena_cli.vda5050.finding import MESSAGES, Rule
from nena_cli.vda5050.recording import Entry
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS
from support.talk import START, VERSIONS, Talk


@pytest.mark.parametrize("version", VERSIONS)
def test_an_order_that_is_driven_to_its_end_is_fine(version: str) -> None:
    talk = Talk(version).online().state("n0", of="")
    talk.order("n0", "n1", "n2").state("n0", "n1", "n2").state("n1", "n2").state("n2").online("OFFLINE")

    assert talk.findings == []


def test_other_topics_and_cleared_messages_are_passed_over() -> None:
    checker = Checker()
    for entry in Talk().raw("house/kitchen/light", b"on").raw("fleet/v3/ACME/0001/connection", b"").entries:
        assert list(checker.take(entry)) == []

    assert checker.checked == 0
    assert list(checker.end()) == []


def test_robots_are_followed_each_for_itself() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1")
    other = Talk().order("n0", "n1", order_id="o9").state("n0", of="o9", node_states=())
    talk.entries += [
        replace(
            each, topic=each.topic.replace("0001", "0002"), payload=each.payload.replace(b"0001", b"0002")
        )
        for each in other.entries
    ]

    assert talk.findings == []


def test_a_robot_that_changes_its_version_begins_anew() -> None:
    talk = Talk("2.1.0").order("n0", "n1").state("n0", "n1")
    talk.entries += Talk("3.0.0").online().state("n0", of="").entries

    assert talk.findings == []


def test_numbers_count_what_is_passed_over_as_well() -> None:
    checker = Checker()
    checker.skip()
    (finding,) = checker.take(Entry(START, "fleet/v2/ACME/1/state", b"?"))

    assert (finding.number, checker.checked) == (2, 1)


def test_a_finding_is_an_object_for_scripts() -> None:
    checker = Checker()
    (finding,) = checker.take(Entry(START, "fleet/v2/ACME/1/state", b"?"))

    assert finding.as_json() == {
        "number": 1,
        "time": "2026-01-01T00:00:00+00:00",
        "robot": "ACME/1",
        "topic": "state",
        "version": "2.1.0",
        "rule": "message",
        "section": "6.10.6",
        "severity": "error",
        "text": finding.text,
    }


def test_each_rule_has_a_code_of_its_own_and_a_section_in_some_version() -> None:
    assert len({rule.code for rule in Rule}) == len(Rule)
    assert set(MESSAGES) == set(Topic)
    for rule in Rule:
        assert any(rule.section(version, Topic.ORDER) for version in CODECS), rule
