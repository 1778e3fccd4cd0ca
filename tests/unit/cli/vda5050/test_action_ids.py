"""An actionId stands for one action."""

from __future__ import annotations

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from support.robot_core import action
from support.talk import VERSIONS, Talk


@pytest.mark.parametrize(("version", "section"), [("2.0.0", "6.7"), ("2.1.0", "6.6.6"), ("3.0.0", "7.3")])
def test_an_action_id_stands_for_one_type(version: str, section: str) -> None:
    talk = Talk(version).act(action("a", "NONE", "startPause")).act(action("a", "NONE", "stopPause"))

    (finding,) = talk.findings
    assert (finding.rule, finding.severity, finding.section) == (Rule.ACTION_ID, Severity.ERROR, section)


def test_an_action_id_belongs_to_one_order() -> None:
    talk = Talk().order("n0", node_actions={"n0": [action("a")]})
    talk.order("n0", order_id="o2", node_actions={"n0": [action("a")]})

    (finding,) = talk.findings
    assert (finding.rule, finding.severity) == (Rule.ACTION_ID, Severity.WARNING)
    assert "order 'o1'" in finding.text


@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_sent_again_has_its_id_again(version: str) -> None:
    again = {"n0": [action("a")]}
    talk = Talk(version).order("n0", node_actions=again).order("n0", node_actions=again)
    talk.act(action("i", "NONE", "startPause")).act(action("i", "NONE", "startPause"))

    assert talk.rules == []
