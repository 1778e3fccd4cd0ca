"""Instant actions are allowed, answered, and end an order completely."""

from __future__ import annotations

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_shared.vda5050.state import OperatingMode
from support.robot_core import action
from support.talk import VERSIONS, Talk, doing

CANCEL = action("c", "NONE", "cancelOrder")


@pytest.mark.parametrize("version", VERSIONS)
def test_an_instant_action_is_answered(version: str) -> None:
    silent, answered = (Talk(version).act(action("a", "NONE", "startPause")) for _ in range(2))
    for _ in range(4):
        silent.state("n0", of="")
        answered.state("n0", of="", instant_action_states=doing(("a", "FINISHED")))

    (finding,) = silent.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.INSTANT_ANSWER, Severity.WARNING, 1)
    assert answered.findings == []


def test_what_is_sent_again_after_its_answer_needs_no_other() -> None:
    talk = Talk().act(action("a", "NONE", "startPause"))
    talk.state("n0", of="", instant_action_states=doing(("a", "FINISHED")))
    talk.act(action("a", "NONE", "startPause"))
    for _ in range(4):
        talk.state("n0", of="")

    assert talk.findings == []


@pytest.mark.parametrize("version", VERSIONS)
def test_a_cancel_ends_with_no_node_left(version: str) -> None:
    talk = Talk(version).order("n0", "n1").state("n0", "n1").act(CANCEL)

    assert talk.state("n0", "n1", instant_action_states=doing(("c", "RUNNING"))).rules == []
    assert talk.state("n0", "n1", instant_action_states=doing(("c", "FINISHED"))).rules == [Rule.CANCEL_END]
    assert talk.state("n0", instant_action_states=doing(("c", "FINISHED"))).rules == [Rule.CANCEL_END]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_cancel_ends_with_no_action_under_way(version: str) -> None:
    talk = Talk(version).order("n0", node_actions={"n0": [action("a")]})
    talk.act(CANCEL, action("m", "NONE", "downloadMap"))
    instant = doing(("c", "FINISHED"), ("m", "RUNNING"))

    fine = talk.state("n0", action_states=doing(("a", "FAILED")), instant_action_states=instant)
    assert fine.rules == []
    talk.entries.pop()
    running = talk.state("n0", action_states=doing(("a", "RUNNING")), instant_action_states=instant)
    assert Rule.CANCEL_END in running.rules
    assert "have not ended: a" in running.texts


def test_a_cancel_that_fails_ends_nothing() -> None:
    talk = Talk().order("n0", "n1", "n2").state("n0", "n1", "n2").act(CANCEL)
    talk.state("n0", "n1", "n2", instant_action_states=doing(("c", "FAILED"))).state("n1")

    assert talk.rules == [Rule.PROGRESS]


def test_a_cancel_goes_on_while_other_orders_are_refused() -> None:
    talk = Talk().order("n0", "n1", "n2").state("n0", "n1", "n2").act(CANCEL)
    talk.state("n0", "n1", "n2", instant_action_states=doing(("c", "RUNNING"))).order("n0", order_id="o2")
    talk.state("n0", instant_action_states=doing(("c", "FINISHED")))

    assert talk.rules == [Rule.OTHER_ORDER]


def test_a_cancel_that_names_an_order_ends_no_other() -> None:
    other = action("c", "NONE", "cancelOrder", orderId="o7")
    talk = Talk().order("n0", "n1", "n2").state("n0", "n1", "n2").act(other).state("n1")

    assert talk.rules == [Rule.PROGRESS]


@pytest.mark.parametrize(
    ("mode", "action_type", "rules"),
    [
        ("AUTOMATIC", "startPause", []),
        ("SEMIAUTOMATIC", "startPause", []),
        ("INTERVENED", "cancelOrder", []),
        ("INTERVENED", "startPause", [Rule.MODE]),
        ("MANUAL", "cancelOrder", [Rule.MODE]),
        ("MANUAL", "stateRequest", []),
    ],
)
def test_instant_actions_come_in_modes_that_take_them(mode: str, action_type: str, rules: list[Rule]) -> None:
    talk = Talk().state("n0", of="", operating_mode=OperatingMode(mode))

    assert talk.act(action("a", "NONE", action_type)).rules == rules
