"""One message by itself: readable, valid, and said in its version's own words."""

from __future__ import annotations

import json
from typing import Any

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.versions import codec_for
from support.fleet_examples import state as example_state
from support.robot_core import action, order, position
from support.talk import HEADER, VERSIONS, Talk


def said(version: str, topic: str, payload: bytes) -> Talk:
    return Talk(version).raw(f"fleet/{codec_for(version).major_version}/ACME/r1/{topic}", payload)


def changed(version: str, **fields: Any) -> Talk:
    """Give a conversation of one state, with some fields of its JSON replaced."""
    content = json.loads(codec_for(version).encode(example_state())) | fields
    return said(version, "state", json.dumps(content).encode())


@pytest.mark.parametrize("version", VERSIONS)
def test_a_message_in_order_is_fine(version: str) -> None:
    assert changed(version).findings == []


@pytest.mark.parametrize(
    ("version", "topic", "section"),
    [
        ("2.0.0", "order", "6.7"),
        ("2.1.0", "order", "6.6.6"),
        ("3.0.0", "order", "7.3"),
        ("2.0.0", "factsheet", "7"),
        ("2.1.0", "state", "6.10.6"),
        ("3.0.0", "responses", "7.5"),
        ("2.1.0", "responses", "6.5"),
    ],
)
def test_what_is_no_message_is_named_with_the_section_that_describes_it(
    version: str, topic: str, section: str
) -> None:
    talk = said(version, topic, json.dumps({"version": version}).encode())

    assert {each.rule for each in talk.findings} == {Rule.MESSAGE}
    finding = talk.findings[0]
    assert (finding.number, finding.severity, finding.section) == (1, Severity.ERROR, section)
    assert str(finding.robot) == "ACME/r1"


def test_what_is_no_json_is_read_by_the_version_of_its_topic() -> None:
    (finding,) = said("2.1.0", "state", b"hello").findings

    assert (finding.rule, finding.version) == (Rule.MESSAGE, "2.1.0")


@pytest.mark.parametrize(("version", "section"), [("2.0.0", "6.6.1"), ("3.0.0", "6.1.1")])
def test_a_graph_that_a_schema_would_let_pass_is_named(version: str, section: str) -> None:
    good = codec_for(version).encode(order("n0", "n1"))
    talk = said(version, "order", good.replace(b'"sequenceId":2', b'"sequenceId":4'))

    (finding,) = talk.findings
    assert (finding.rule, finding.section) == (Rule.GRAPH, section)
    assert "sequenceId 4, not 2" in finding.text


@pytest.mark.parametrize("version", VERSIONS)
def test_a_field_that_the_version_does_not_have_is_a_warning(version: str) -> None:
    (finding,) = changed(version, colour="red").findings

    assert (finding.rule, finding.severity) == (Rule.FIELD, Severity.WARNING)
    assert finding.text.startswith("colour ")


def test_a_field_of_another_version_is_none_of_this_one() -> None:
    zone_sets: list[Any] = []

    assert changed("3.0.0", zoneSets=zone_sets).findings == []
    assert changed("2.1.0", zoneSets=zone_sets).rules == [Rule.FIELD]


def test_fields_deep_inside_are_named_by_their_path() -> None:
    payload = json.loads(codec_for("2.1.0").encode(order("n0", "n1")))
    payload["nodes"][1]["nodePosition"]["z"] = 3.0

    assert said("2.1.0", "order", json.dumps(payload).encode()).texts.startswith("nodes.1.nodePosition.z ")


def test_what_is_understood_in_spite_of_its_spelling_is_named() -> None:
    (finding,) = changed("3.0.0", operatingMode="TEACHIN").findings

    assert (finding.rule, finding.severity, finding.section) == (Rule.SPELLING, Severity.ERROR, "7.1")
    assert "'TEACHIN'" in finding.text
    assert "'TEACH_IN'" in finding.text
    assert changed("2.1.0", operatingMode="TEACHIN").findings == []


def test_an_instant_action_of_3_blocks_nothing() -> None:
    pause = InstantActions(**HEADER, actions=(action("a", "HARD", "startPause"),))
    payload = codec_for("2.1.0").encode(pause)

    assert said("2.1.0", "instantActions", payload).rules == []
    (finding,) = said("3.0.0", "instantActions", payload.replace(b'"2.1.0"', b'"3.0.0"')).findings
    assert finding.rule is Rule.SPELLING
    assert "actions.0.blockingType is written 'HARD'; this version writes 'NONE'" in finding.text


def test_a_stop_that_acknowledges_itself_is_a_word_of_2() -> None:
    stop = {"eStop": "AUTOACK", "fieldViolation": False}

    assert changed("2.1.0", safetyState=stop).findings == []


@pytest.mark.parametrize(
    ("timestamp", "rules"),
    [
        ("2026-01-01T00:00:00Z", []),
        ("2026-01-01T00:00:00.123456Z", []),
        ("2026-01-01T01:00:00.00+01:00", [Rule.SPELLING]),
        ("2026-01-01T00:00:00.00", [Rule.SPELLING]),
    ],
)
def test_times_are_written_in_utc(timestamp: str, rules: list[Rule]) -> None:
    assert changed("2.1.0", timestamp=timestamp).rules == rules


@pytest.mark.parametrize("version", VERSIONS)
def test_what_the_versions_write_differently_is_compared_as_it_stands(version: str) -> None:
    places = {"n0": position(0.0), "n1": position(10.0, radius=0.5)}

    assert Talk(version).order("n0", "n1", positions=places).findings == []


def test_only_so_many_are_told_of_one_message() -> None:
    assert len(changed("3.0.0", **{f"x{number}": 1 for number in range(50)}).findings) == 5
