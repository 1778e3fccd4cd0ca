"""Actions of an order: each has a state, begins in time, runs beside what it may, and ends once."""

from __future__ import annotations

from typing import Any

import pytest

from nena_conversations.pending import BoundedDict
from nena_conversations.rules import Rule, Severity
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import CODECS
from support.robot_core import action
from support.talk import Talk, doing


def at_once(*statuses: tuple[str, str], version: str = "3.0.0", blocking: str = "NONE") -> Talk:
    """Make the robot report ``statuses`` of the actions a and b on its node."""
    actions = [action("a", blocking), action("b")]
    talk = Talk(version).order("n0", "n1", node_actions={"n0": actions})
    return talk.state("n0", "n1", action_states=doing(*statuses))


@pytest.mark.parametrize("version", CODECS)
def test_each_action_has_a_state(version: str) -> None:
    fine = at_once(("a", "RUNNING"), ("b", "WAITING"), version=version)
    lost = at_once(("a", "RUNNING"), version=version)

    assert fine.findings == []
    (finding,) = lost.findings
    assert (finding.rule, finding.section) == (Rule.ACTION_LOST, "6.6.9" if version >= "3" else "6.11")


def test_actions_of_the_base_are_not_lost_by_an_update_those_of_the_horizon_are() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2, node_actions={"n0": [action("a")], "n2": [action("b")]})
    talk.order("n1", "n3", first=2, update=1)

    assert talk.state("n0", "n1", update=1, node_states=(), edge_states=()).rules == [Rule.ACTION_LOST]
    assert "'a'" in talk.texts


@pytest.mark.parametrize(
    ("before", "after", "fine"),
    [
        ("WAITING", "FINISHED", True),
        ("RUNNING", "RETRIABLE", True),
        ("RETRIABLE", "FINISHED", True),
        ("RUNNING", "INITIALIZING", True),  # by way of PAUSED
        ("FINISHED", "RUNNING", False),
        ("FAILED", "FINISHED", False),
        ("RUNNING", "WAITING", False),
    ],
)
def test_statuses_change_as_the_figure_allows(before: str, after: str, *, fine: bool) -> None:
    talk = at_once(("a", before), ("b", "WAITING"))
    talk.state("n0", "n1", action_states=doing(("a", after), ("b", "WAITING")))

    assert talk.rules == ([] if fine else [Rule.ACTION_STATUS])


@pytest.mark.parametrize(
    ("place", "status", "rules"),
    [
        ({"node_actions": {"n1": [action("a")]}}, "WAITING", []),
        ({"node_actions": {"n1": [action("a")]}}, "FAILED", []),
        ({"node_actions": {"n1": [action("a")]}}, "RUNNING", [Rule.ACTION_EARLY]),
        ({"node_actions": {"n1": [action("a")]}}, "FINISHED", [Rule.ACTION_EARLY]),
        ({"node_actions": {"n0": [action("a")]}}, "RUNNING", []),
        ({"edge_actions": {"n0-n1": [action("a")]}}, "RUNNING", []),
        ({"edge_actions": {"n1-n2": [action("a")]}}, "RUNNING", [Rule.ACTION_EARLY]),
    ],
)
def test_action_starts_only_when_its_node_is_reached(
    place: dict[str, Any], status: str, rules: list[Rule]
) -> None:
    edges = tuple(
        {"edge_id": name, "sequence_id": number, "released": True}
        for name, number in (("n0-n1", 1), ("n1-n2", 3))
    )
    talk = Talk().order("n0", "n1", "n2", **place)
    talk.state("n0", "n1", "n2", edge_states=edges, action_states=doing(("a", status)))

    assert talk.rules == rules


def test_a_robot_of_2_may_show_the_node_where_it_is() -> None:
    talk = Talk("2.1.0").order("n0", "n1", node_actions={"n0": [action("a")]})

    assert talk.state("n0", "n0", "n1", action_states=doing(("a", "RUNNING"))).rules == []


@pytest.mark.parametrize(
    ("blocking", "rules"),
    [("NONE", []), ("SOFT", []), ("SINGLE", [Rule.BLOCKING]), ("HARD", [Rule.BLOCKING])],
)
def test_some_actions_run_alone(blocking: str, rules: list[Rule]) -> None:
    assert at_once(("a", "RUNNING"), ("b", "WAITING"), blocking=blocking).rules == []
    assert at_once(("a", "RUNNING"), ("b", "RUNNING"), blocking=blocking).rules == rules


def test_instant_actions_run_beside_any_other() -> None:
    talk = Talk("2.1.0").order("n0", node_actions={"n0": [action("a", "HARD")]})
    talk.act(action("i", "NONE", "downloadMap"))

    assert talk.state("n0", action_states=doing(("a", "RUNNING"), ("i", "RUNNING"))).rules == []


@pytest.mark.parametrize(
    ("blocking", "rules"),
    [("NONE", []), ("SINGLE", []), ("SOFT", [Rule.BLOCKING]), ("HARD", [Rule.BLOCKING])],
)
def test_robot_stands_during_blocking_actions(blocking: str, rules: list[Rule]) -> None:
    talk = Talk().order("n0", "n1", node_actions={"n0": [action("a", blocking)]})
    talk.state("n0", "n1", driving=True, action_states=doing(("a", "RUNNING")))

    assert talk.rules == rules
    assert {each.severity for each in talk.findings} <= {Severity.WARNING}


@pytest.mark.parametrize("version", CODECS)
def test_actions_of_edges_of_the_base_are_not_lost_by_an_update(version: str) -> None:
    talk = Talk(version).order("n0", "n1", edge_actions={"n0-n1": [action("a")]})
    talk.state("n0", "n1", action_states=doing(("a", "RUNNING"))).order("n1", "n2", first=2, update=1)

    assert talk.state("n0", "n1", "n2", update=1).rules == [Rule.ACTION_LOST]


CANCEL = action("c", "NONE", "cancelOrder")


@pytest.mark.parametrize("version", CODECS)
def test_an_instant_action_is_answered(version: str) -> None:
    silent, answered = (Talk(version).act(action("a", "NONE", "startPause")) for _ in range(2))
    for _ in range(4):
        silent.state("n0", of="")
        answered.state("n0", of="", instant_action_states=doing(("a", "FINISHED")))

    (finding,) = silent.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.INSTANT_ANSWER, Severity.WARNING, 1)
    assert answered.findings == []


def test_repetition_after_the_answer_needs_no_other_answer() -> None:
    talk = Talk().act(action("a", "NONE", "startPause"))
    talk.state("n0", of="", instant_action_states=doing(("a", "FINISHED")))
    talk.act(action("a", "NONE", "startPause"))
    for _ in range(4):
        talk.state("n0", of="")

    assert talk.findings == []


@pytest.mark.parametrize("version", CODECS)
def test_finished_cancellation_leaves_no_node(version: str) -> None:
    talk = Talk(version).order("n0", "n1").state("n0", "n1").act(CANCEL)

    assert talk.state("n0", "n1", instant_action_states=doing(("c", "RUNNING"))).rules == []
    assert talk.state("n0", "n1", instant_action_states=doing(("c", "FINISHED"))).rules == [Rule.CANCEL_END]
    assert talk.state("n0", instant_action_states=doing(("c", "FINISHED"))).rules == [Rule.CANCEL_END]


@pytest.mark.parametrize("version", CODECS)
def test_finished_cancellation_leaves_no_running_action(version: str) -> None:
    talk = Talk(version).order("n0", node_actions={"n0": [action("a")]})
    talk.act(CANCEL, action("m", "NONE", "downloadMap"))
    instant = doing(("c", "FINISHED"), ("m", "RUNNING"))

    fine = talk.state("n0", action_states=doing(("a", "FAILED")), instant_action_states=instant)
    assert fine.rules == []
    talk.entries.pop()
    running = talk.state("n0", action_states=doing(("a", "RUNNING")), instant_action_states=instant)
    assert Rule.CANCEL_END in running.rules
    assert "have not ended: a" in running.texts


def test_failed_cancellation_ends_nothing() -> None:
    talk = Talk().order("n0", "n1", "n2").state("n0", "n1", "n2").act(CANCEL)
    talk.state("n0", "n1", "n2", instant_action_states=doing(("c", "FAILED"))).state("n1")

    assert talk.rules == [Rule.PROGRESS]


def test_cancellation_continues_while_other_orders_are_refused() -> None:
    talk = Talk().order("n0", "n1", "n2").state("n0", "n1", "n2").act(CANCEL)
    talk.state("n0", "n1", "n2", instant_action_states=doing(("c", "RUNNING"))).order("n0", order_id="o2")
    talk.state("n0", instant_action_states=doing(("c", "FINISHED")))

    assert talk.rules == [Rule.OTHER_ORDER]


def test_cancellation_of_a_named_order_ends_no_other() -> None:
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


def test_the_oldest_is_forgotten_first() -> None:
    known: BoundedDict[str, int] = BoundedDict(2)
    for number, key in enumerate("abac"):
        known[key] = number

    assert dict(known) == {"b": 1, "c": 3}
