"""What fleet control may send, and when."""

from __future__ import annotations

import pytest

from nena_cli.vda5050.finding import Rule
from nena_shared.vda5050.state import OperatingMode
from support.robot_core import action
from support.talk import VERSIONS, Talk, doing


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.FIRST_UPDATE_ID])])
def test_a_new_order_begins_with_update_0_where_the_version_says_so(version: str, rules: list[Rule]) -> None:
    talk = Talk(version).state("n0", of="").order("n0", "n1", update=3)

    assert talk.rules == rules


@pytest.mark.parametrize("version", VERSIONS)
def test_a_new_order_begins_with_sequence_id_0(version: str) -> None:
    assert Talk(version).state("n0", of="").order("n1", "n2", first=2).rules == [Rule.FIRST_SEQUENCE_ID]


def test_an_order_whose_beginning_was_not_heard_is_no_new_one() -> None:
    assert Talk().state("n1", "n2", of="o1").order("n2", "n3", first=4, update=1).rules == []


@pytest.mark.parametrize("version", VERSIONS)
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


@pytest.mark.parametrize("version", VERSIONS)
def test_an_update_begins_at_the_decision_point(version: str) -> None:
    fine = Talk(version).order("n0", "n1", "n2", released=2).order("n1", "n3", first=2, update=1)
    horizon = Talk(version).order("n0", "n1", "n2", released=2).order("n2", "n3", first=4, update=1)
    earlier = Talk(version).order("n0", "n1", "n2").order("n1", "n2", "n3", first=2, update=1)

    assert fine.rules == []
    assert horizon.rules == [Rule.STITCHING]
    assert earlier.rules == [Rule.STITCHING]
    assert "the base ends at 'n2' (4)" in earlier.texts


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.STITCHING_NODE])])
def test_the_decision_point_is_repeated_in_full_where_the_version_says_so(
    version: str, rules: list[Rule]
) -> None:
    work = {"n1": [action("a")]}
    talk = Talk(version).order("n0", "n1", node_actions=work)
    kept = Talk(version).order("n0", "n1", node_actions=work)

    assert talk.order("n1", "n2", first=2, update=1).rules == rules
    assert kept.order("n1", "n2", first=2, update=1, node_actions=work).rules == []


@pytest.mark.parametrize("version", VERSIONS)
def test_update_ids_rise(version: str) -> None:
    talk = Talk(version).order("n0", "n1").order("n1", "n2", first=2, update=2)

    assert talk.rules == []
    assert talk.order("n2", "n3", first=4, update=1).rules == [Rule.OUTDATED_UPDATE]


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.SAME_UPDATE_ID])])
def test_the_same_update_id_says_the_same(version: str, rules: list[Rule]) -> None:
    repeated = Talk(version).order("n0", "n1").order("n0", "n1")
    changed = Talk(version).order("n0", "n1").order("n0", "n2")

    assert repeated.rules == []
    assert changed.rules == rules


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.UPDATE_AFTER_CANCEL])])
def test_a_cancelled_order_gets_no_update(version: str, rules: list[Rule]) -> None:
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


@pytest.mark.parametrize("version", VERSIONS)
def test_an_order_whose_actions_run_is_not_ended(version: str) -> None:
    talk = Talk(version).order("n0", node_actions={"n0": [action("a")]})
    running = talk.state("n0", action_states=doing(("a", "RUNNING")))

    assert running.order("n0", "n1", order_id="o2").rules == [Rule.OTHER_ORDER]


@pytest.mark.parametrize("version", VERSIONS)
def test_instant_actions_that_run_keep_no_robot_from_an_order(version: str) -> None:
    talk = (
        Talk(version).order("n0").act(action("i")).state("n0", instant_action_states=doing(("i", "RUNNING")))
    )

    assert talk.order("n0", "n1", order_id="o2").rules == []
