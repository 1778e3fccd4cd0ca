"""What fleet control may send, and when."""

from __future__ import annotations

from typing import Any

import pytest

from nena_conversations.rules import Rule, Severity
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import CODECS
from support.fleet_examples import position
from support.robot_core import MAP, action
from support.talk import Talk, doing


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.FIRST_UPDATE_ID])])
def test_new_order_starts_with_update_0_if_the_version_requires_it(version: str, rules: list[Rule]) -> None:
    talk = Talk(version).state("n0", of="").order("n0", "n1", update=3)

    assert talk.rules == rules


@pytest.mark.parametrize("version", CODECS)
def test_new_order_starts_with_sequence_id_0(version: str) -> None:
    assert Talk(version).state("n0", of="").order("n1", "n2", first=2).rules == [Rule.FIRST_SEQUENCE_ID]


def test_order_without_a_recorded_start_does_not_count_as_new() -> None:
    assert Talk().state("n1", "n2", of="o1").order("n2", "n3", first=4, update=1).rules == []


@pytest.mark.parametrize("version", CODECS)
def test_a_new_order_is_for_an_idle_robot(version: str) -> None:
    busy = Talk(version).order("n0", "n1").state("n0", "n1").order("n1", "n2", order_id="o2")
    idle = Talk(version).order("n0", "n1").state("n0", "n1").state("n1").order("n1", "n2", order_id="o2")

    assert busy.rules == [Rule.OTHER_ORDER]
    assert idle.rules == []


@pytest.mark.parametrize(
    ("mode", "rules"),
    [
        (OperatingMode.AUTOMATIC, []),
        (OperatingMode.INTERVENED, []),
        (OperatingMode.MANUAL, [Rule.MODE]),
        (OperatingMode.STARTUP, [Rule.MODE]),
    ],
)
def test_an_order_comes_in_modes_that_take_it(mode: OperatingMode, rules: list[Rule]) -> None:
    talk = Talk().state("n0", of="", operating_mode=mode).order("n0", "n1")

    assert talk.rules == rules


@pytest.mark.parametrize("version", CODECS)
def test_update_starts_at_the_decision_point(version: str) -> None:
    fine = Talk(version).order("n0", "n1", "n2", released=2).order("n1", "n3", first=2, update=1)
    horizon = Talk(version).order("n0", "n1", "n2", released=2).order("n2", "n3", first=4, update=1)
    earlier = Talk(version).order("n0", "n1", "n2").order("n1", "n2", "n3", first=2, update=1)

    assert fine.rules == []
    assert horizon.rules == [Rule.STITCHING]
    assert earlier.rules == [Rule.STITCHING]
    assert "the base ends at 'n2' (4)" in earlier.texts


@pytest.mark.parametrize(
    ("x", "last", "map_id", "rules"),
    [
        (0.5, "", MAP, []),
        (30.0, "n0", MAP, []),
        (30.0, "", MAP, [Rule.START_NODE]),
        (0.0, "", "other", [Rule.START_NODE]),
    ],
)
def test_a_new_order_begins_where_the_robot_is(x: float, last: str, map_id: str, rules: list[Rule]) -> None:
    place = {**position(x, 0.0), "map_id": map_id}
    talk = Talk().state(last, of="", mobile_robot_position=place)

    assert talk.order("n0", "n1").rules == rules


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.STITCHING_NODE])])
def test_decision_point_is_repeated_unchanged_if_the_version_requires_it(
    version: str, rules: list[Rule]
) -> None:
    work = {"n1": [action("a")]}
    talk = Talk(version).order("n0", "n1", node_actions=work)
    kept = Talk(version).order("n0", "n1", node_actions=work)

    assert talk.order("n1", "n2", first=2, update=1).rules == rules
    assert kept.order("n1", "n2", first=2, update=1, node_actions=work).rules == []


@pytest.mark.parametrize("version", CODECS)
def test_update_ids_rise(version: str) -> None:
    talk = Talk(version).order("n0", "n1").order("n1", "n2", first=2, update=2)

    assert talk.rules == []
    assert talk.order("n2", "n3", first=4, update=1).rules == [Rule.OUTDATED_UPDATE]


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.SAME_UPDATE_ID])])
def test_repeated_update_id_has_the_same_content(version: str, rules: list[Rule]) -> None:
    repeated = Talk(version).order("n0", "n1").order("n0", "n1")
    changed = Talk(version).order("n0", "n1").order("n0", "n2")

    assert repeated.rules == []
    assert changed.rules == rules


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.UPDATE_AFTER_CANCEL])])
def test_cancelled_order_receives_no_update(version: str, rules: list[Rule]) -> None:
    update = {"first": 2, "update": 1}
    during = Talk(version).order("n0", "n1").state("n0", "n1").act(action("c", "NONE", "cancelOrder"))
    nothing_cancelled = Talk(version).order("n0", "n1").state("n0", "n1").state("n1")
    nothing_cancelled.act(action("c", "NONE", "cancelOrder"))
    nothing_cancelled.state("n1", instant_action_states=doing(("c", "FAILED")))

    assert during.order("n1", "n2", **update).rules == rules
    assert nothing_cancelled.order("n1", "n2", **update).rules == []


def test_the_order_after_a_cancelled_one_gets_updates() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").act(action("c", "NONE", "cancelOrder"))
    talk.state("n0", instant_action_states=doing(("c", "FINISHED")))
    talk.order("n0", "n1", order_id="o2").order("n1", "n2", order_id="o2", first=2, update=1)

    assert talk.rules == []


@pytest.mark.parametrize("version", CODECS)
def test_an_order_whose_actions_run_is_not_ended(version: str) -> None:
    talk = Talk(version).order("n0", node_actions={"n0": [action("a")]})
    running = talk.state("n0", action_states=doing(("a", "RUNNING")))

    assert running.order("n0", "n1", order_id="o2").rules == [Rule.OTHER_ORDER]


@pytest.mark.parametrize("version", CODECS)
def test_instant_actions_that_run_keep_no_robot_from_an_order(version: str) -> None:
    talk = (
        Talk(version).order("n0").act(action("i")).state("n0", instant_action_states=doing(("i", "RUNNING")))
    )

    assert talk.order("n0", "n1", order_id="o2").rules == []


def driving(*nodes: str, version: str = "3.0.0") -> Talk:
    return Talk(version).order(*nodes).state(*nodes)


@pytest.mark.parametrize("version", CODECS)
def test_nodes_leave_one_by_one(version: str) -> None:
    talk = driving("n0", "n1", "n2", version=version).state("n1", "n2").state("n2")

    assert talk.findings == []


@pytest.mark.parametrize("version", CODECS)
def test_no_node_is_skipped(version: str) -> None:
    one = driving("n0", "n1", "n2", version=version).state("n0", "n2")
    two = driving("n0", "n1", "n2", "n3", version=version).state("n0", "n3")

    assert one.rules == [Rule.PROGRESS]
    assert "node 2 of" in one.texts
    assert "node 2 to 4 of" in two.texts
    assert one.findings[0].section == ("6.6.2" if version >= "3" else "6.10.2")


def test_several_nodes_may_be_reached_between_two_states() -> None:
    assert driving("n0", "n1", "n2", "n3").state("n2", "n3").findings == []


def test_no_node_reappears() -> None:
    talk = driving("n0", "n1", "n2").state("n1", "n2").state("n1", "n1", "n2")

    assert talk.rules == [Rule.PROGRESS]
    assert "disappeared and is listed again" in talk.texts


def test_nodes_are_those_of_the_order() -> None:
    assert "is not part of the order" in driving("n0", "n1").state("n0", "n1", "n7").texts


def test_the_base_stays_released_and_the_horizon_not() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2)
    horizon = {"node_id": "n2", "sequence_id": 4, "released": False}
    base = {"node_id": "n1", "sequence_id": 2, "released": True}

    assert talk.state("n0", node_states=(base, horizon)).findings == []
    assert (
        "released False, in the order True"
        in talk.state("n0", node_states=(base | {"released": False}, horizon)).texts
    )


def test_sequence_ids_rise() -> None:
    edges = tuple({"edge_id": "e", "sequence_id": each, "released": True} for each in (3, 1))

    assert driving("n0", "n1", "n2").state("n0", "n2", "n1").rules == [Rule.PROGRESS]
    assert "edgeStates" in driving("n0", "n1", "n2").state("n0", "n1", "n2", edge_states=edges).texts


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.FIRST_NODE])])
def test_first_node_counts_as_reached_if_the_version_requires_it(version: str, rules: list[Rule]) -> None:
    talk = Talk(version).order("n0", "n1").state("n0", "n0", "n1")

    assert talk.rules == rules


def test_the_last_node_does_not_go_back() -> None:
    talk = driving("n0", "n1", "n2", "n3").state("n2", "n3").state("n1", "n3")

    assert "decreases from 4 to 2" in talk.texts


def test_the_last_node_is_one_of_the_order() -> None:
    talk = driving("n0", "n1", "n2").state("n1", "n2", last_node_id="n9")

    assert "'n9' is not node 2" in talk.texts


def test_order_does_not_disappear() -> None:
    gone = driving("n0", "n1", "n2").state("n1")
    manual = driving("n0", "n1", "n2").state("n1", operating_mode=OperatingMode.MANUAL)
    back = driving("n0", "n1", "n2").state("n0", "n1", "n2", operating_mode=OperatingMode.STARTUP).state("n1")
    cancelled = driving("n0", "n1", "n2").act(action("c", "NONE", "cancelOrder"))
    cancelled.state("n1", instant_action_states=doing(("c", "FINISHED")))

    assert "the rest of order 'o1' disappeared after node 2" in gone.texts
    assert gone.findings[0].severity is Severity.WARNING
    assert manual.findings == []
    assert back.findings == []
    assert cancelled.findings == []


def test_horizon_may_be_withdrawn() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2)
    talk.state("n0", node_states=({"node_id": "n1", "sequence_id": 2, "released": True},))
    talk.order("n1", first=2, update=1).state("n0", "n1", update=1).state("n1", update=1)

    assert talk.rules == []


def test_order_without_a_recorded_start_is_not_checked() -> None:
    talk = Talk().state("n1", "n2", of="o1").order("n2", "n3", first=4, update=1).state("n1", "n9", update=1)

    assert talk.rules == []


@pytest.mark.parametrize("version", CODECS)
@pytest.mark.parametrize("left", [(), ("n3",)])
def test_no_robot_drives_into_the_horizon(version: str, left: tuple[str, ...]) -> None:
    horizon = tuple({"node_id": each, "sequence_id": 2 * int(each[1:]), "released": False} for each in left)
    talk = Talk(version).order("n0", "n1", "n2", *left, released=2)

    talk.state("n2", node_states=horizon)

    assert Rule.PROGRESS in talk.rules
    assert "'n2' (4), which is not released" in talk.texts


def refusal(**references: Any) -> ErrorEntry:
    return error(ErrorType.NO_ROUTE_TO_TARGET, "no way", **references)


@pytest.mark.parametrize("version", CODECS)
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


def test_unanswered_order_is_reported_during_the_conversation() -> None:
    talk = Talk().order("n0", "n1").state("n0", of="").wait(15).state("n0", of="").state("n0", of="")

    assert talk.rules == [Rule.ANSWER]


def test_robot_without_a_message_yet_is_awaited() -> None:
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


def test_refused_update_keeps_the_order_unchanged() -> None:
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


def test_orders_are_not_required_without_fleet_control() -> None:
    assert Talk().state("n1", of="o1").state("n2", of="o2").state("n3", of="o3").rules == []


def test_updates_do_not_go_back() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", first=2, update=1)
    talk.state("n0", "n1", "n2", update=1).state("n0", "n1", update=0)

    assert [(each.rule, each.severity) for each in talk.findings] == [(Rule.ECHO, Severity.ERROR)]
