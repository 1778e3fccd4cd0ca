"""Orders are answered, and what is refused does not count."""

from __future__ import annotations

from typing import Any

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from support.talk import VERSIONS, Talk


def refusal(**references: Any) -> ErrorEntry:
    return error(ErrorType.NO_ROUTE_TO_TARGET, "no way", **references)


@pytest.mark.parametrize("version", VERSIONS)
def test_an_order_is_answered_by_an_echo_or_an_error(version: str) -> None:
    silent, refused, echoed = (Talk(version).order("n0", "n1") for _ in range(3))
    entry = refusal(order_id="o1", order_update_id=0)
    for _ in range(4):
        silent.state("n0", of="")
        refused.state("n0", of="", errors=(entry,))
        echoed.state("n0", "n1")

    (finding,) = silent.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.ANSWER, Severity.WARNING, 1)
    assert refused.findings == []
    assert echoed.findings == []


def test_an_order_is_overdue_also_while_the_conversation_goes_on() -> None:
    talk = Talk().order("n0", "n1").state("n0", of="").wait(15).state("n0", of="").state("n0", of="")

    assert talk.rules == [Rule.ANSWER]


def test_a_robot_that_has_said_nothing_yet_is_waited_for() -> None:
    assert Talk().order("n0", "n1").wait(15).online().findings == []


def test_an_answer_may_come_after_the_end() -> None:
    talk = Talk().state("n0", of="").order("n0", "n1")
    for _ in range(3):
        talk.now = talk.entries[1].time
        talk.state("n0", of="")

    assert talk.rules == []


def test_an_error_that_names_an_order_alone_refuses_it_too() -> None:
    talk = Talk("2.1.0").order("n0", "n1")
    for _ in range(4):
        talk.state("n0", of="", errors=(refusal(order_id="o1"),))

    assert talk.findings == []


def test_an_error_about_the_order_that_the_robot_has_answers_no_update() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", first=2, update=1)
    for _ in range(4):
        talk.state("n0", "n1", errors=(refusal(order_id="o1"),))

    assert talk.rules == [Rule.ANSWER]


def test_a_refused_update_leaves_the_order_as_it_was() -> None:
    entry = refusal(order_id="o1", order_update_id=1)
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", first=2, update=1)
    talk.state("n0", "n1", errors=(entry,)).order("n1", "n3", first=2, update=2)

    assert talk.findings == []


def test_a_refused_order_may_come_again_while_its_error_stands() -> None:
    entry = refusal(order_id="o1", order_update_id=0)
    talk = Talk().order("n0", "n1").state("n0", of="", errors=(entry,)).order("n0", "n1")
    talk.state("n0", of="", errors=(entry,)).state("n0", "n1").state("n1")

    assert talk.findings == []


def test_a_state_names_orders_that_were_sent() -> None:
    other = Talk().order("n0", "n1").state("n0", "n1").state("n1").state("n1", of="o7")
    ahead = Talk().order("n0", "n1").state("n0", "n1").state("n0", "n1", update=4)

    assert [(each.rule, each.severity) for each in other.findings] == [(Rule.ECHO, Severity.WARNING)]
    assert "'o7'" in other.texts
    assert ahead.rules == [Rule.ECHO]


def test_a_robot_may_have_an_order_from_before_the_recording() -> None:
    assert Talk().state("n1", "n2", of="old").state("n2", of="old").rules == []


def test_where_fleet_control_is_not_recorded_its_orders_are_not_missed() -> None:
    assert Talk().state("n1", of="o1").state("n2", of="o2").state("n3", of="o3").rules == []


def test_updates_do_not_go_back() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", first=2, update=1)
    talk.state("n0", "n1", "n2", update=1).state("n0", "n1", update=0)

    assert [(each.rule, each.severity) for each in talk.findings] == [(Rule.ECHO, Severity.ERROR)]
