"""Nodes and edges of an order go in their order, and none is left out."""

from __future__ import annotations

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_shared.vda5050.state import OperatingMode
from support.robot_core import action
from support.talk import VERSIONS, Talk, doing


def driving(*nodes: str, version: str = "3.0.0") -> Talk:
    return Talk(version).order(*nodes).state(*nodes)


@pytest.mark.parametrize("version", VERSIONS)
def test_nodes_leave_one_by_one(version: str) -> None:
    talk = driving("n0", "n1", "n2", version=version).state("n1", "n2").state("n2")

    assert talk.findings == []


@pytest.mark.parametrize("version", VERSIONS)
def test_no_node_is_skipped(version: str) -> None:
    one = driving("n0", "n1", "n2", version=version).state("n0", "n2")
    two = driving("n0", "n1", "n2", "n3", version=version).state("n0", "n3")

    assert one.rules == [Rule.PROGRESS]
    assert "node 2 of" in one.texts
    assert "node 2 to 4 of" in two.texts
    assert one.findings[0].section == ("6.6.2" if version == "3.0.0" else "6.10.2")


def test_several_nodes_may_be_reached_between_two_states() -> None:
    assert driving("n0", "n1", "n2", "n3").state("n2", "n3").findings == []


def test_no_node_comes_back() -> None:
    talk = driving("n0", "n1", "n2").state("n1", "n2").state("n1", "n1", "n2")

    assert talk.rules == [Rule.PROGRESS]
    assert "was gone and is back" in talk.texts


def test_nodes_are_those_of_the_order() -> None:
    assert "is none of the order" in driving("n0", "n1").state("n0", "n1", "n7").texts


def test_the_base_stays_released_and_the_horizon_not() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2)
    horizon = {"node_id": "n2", "sequence_id": 4, "released": False}
    base = {"node_id": "n1", "sequence_id": 2, "released": True}

    assert talk.state("n0", node_states=(base, horizon)).findings == []
    assert (
        "released False, the order has True"
        in talk.state("n0", node_states=(base | {"released": False}, horizon)).texts
    )


def test_sequence_ids_rise() -> None:
    edges = tuple({"edge_id": "e", "sequence_id": each, "released": True} for each in (3, 1))

    assert driving("n0", "n1", "n2").state("n0", "n2", "n1").rules == [Rule.PROGRESS]
    assert "edgeStates" in driving("n0", "n1", "n2").state("n0", "n1", "n2", edge_states=edges).texts


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.FIRST_NODE])])
def test_the_first_node_counts_as_reached_where_the_version_says_so(version: str, rules: list[Rule]) -> None:
    talk = Talk(version).order("n0", "n1").state("n0", "n0", "n1")

    assert talk.rules == rules


def test_the_last_node_does_not_go_back() -> None:
    talk = driving("n0", "n1", "n2", "n3").state("n2", "n3").state("n1", "n3")

    assert "goes back from 4 to 2" in talk.texts


def test_the_last_node_is_one_of_the_order() -> None:
    talk = driving("n0", "n1", "n2").state("n1", "n2", last_node_id="n9")

    assert "'n9' is not the node 2" in talk.texts


def test_an_order_does_not_vanish() -> None:
    gone = driving("n0", "n1", "n2").state("n1")
    manual = driving("n0", "n1", "n2").state("n1", operating_mode=OperatingMode.MANUAL)
    back = driving("n0", "n1", "n2").state("n0", "n1", "n2", operating_mode=OperatingMode.STARTUP).state("n1")
    cancelled = driving("n0", "n1", "n2").act(action("c", "NONE", "cancelOrder"))
    cancelled.state("n1", instant_action_states=doing(("c", "FINISHED")))

    assert "the rest of order 'o1' is gone behind node 2" in gone.texts
    assert gone.findings[0].severity is Severity.WARNING
    assert manual.findings == []
    assert back.findings == []
    assert cancelled.findings == []


def test_a_horizon_may_be_taken_back() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2)
    talk.state("n0", node_states=({"node_id": "n1", "sequence_id": 2, "released": True},))
    talk.order("n1", first=2, update=1).state("n0", "n1", update=1).state("n1", update=1)

    assert talk.rules == []


def test_what_was_not_heard_from_the_beginning_is_not_judged() -> None:
    talk = Talk().state("n1", "n2", of="o1").order("n2", "n3", first=4, update=1).state("n1", "n9", update=1)

    assert talk.rules == []


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("left", [(), ("n3",)])
def test_no_robot_drives_into_the_horizon(version: str, left: tuple[str, ...]) -> None:
    horizon = tuple({"node_id": each, "sequence_id": 2 * int(each[1:]), "released": False} for each in left)
    talk = Talk(version).order("n0", "n1", "n2", *left, released=2)

    talk.state("n2", node_states=horizon)

    assert Rule.PROGRESS in talk.rules
    assert "'n2' (4), which is not released" in talk.texts
