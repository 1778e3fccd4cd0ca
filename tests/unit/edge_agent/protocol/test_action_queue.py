"""Blocking types (section 6.2.2)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.action_queue import ActionQueue, lets_drive
from support.robot_core import Bench, action, order


def queue(*kinds: str) -> ActionQueue:
    """Make a queue of actions that are called like their kinds: N NONE, S SOFT, H HARD, 1 SINGLE."""
    names = {"N": "NONE", "S": "SOFT", "H": "HARD", "1": "SINGLE"}
    made = ActionQueue()
    made.append([action(kind, names[kind[0]]) for kind in kinds])
    return made


@pytest.mark.clause("6.2.2")
@pytest.mark.parametrize(
    ("kinds", "runnable", "driving"),
    [
        ((), [], True),
        (("Na", "Nb"), ["Na", "Nb"], True),
        (("Sa", "Nb", "Sc"), ["Sa", "Nb", "Sc"], False),
        (("Ha", "Nb"), ["Ha"], False),
        (("Na", "Hb", "Nc"), ["Na"], False),
        (("1a", "Nb"), ["1a"], True),
        (("Na", "1b"), ["Na"], True),
        (("Sa", "1b", "Hc"), ["Sa"], False),
        (("Na", "Nb", "Sc", "Hd"), ["Na", "Nb", "Sc"], False),
    ],
)
def test_what_may_run_and_whether_the_robot_may_drive(
    kinds: tuple[str, ...],
    runnable: list[str],
    driving: bool,  # noqa: FBT001
) -> None:
    made = queue(*kinds)

    assert made.runnable() == runnable
    assert made.driving_allowed is driving


@pytest.mark.clause("6.2.2")
def test_an_ended_action_leaves_the_queue_and_lets_the_next_ones_run() -> None:
    made = queue("Na", "Hb", "Nc")

    made.remove("Na")
    assert made.runnable() == ["Hb"]
    made.remove("Hb")
    assert (made.runnable(), made.driving_allowed) == (["Nc"], True)


@pytest.mark.clause("6.2.2")
def test_a_node_lets_drive_unless_an_action_wants_the_robot_to_stand() -> None:
    assert lets_drive([action("a", "NONE"), action("b", "SINGLE")])
    assert not lets_drive([action("a", "NONE"), action("b", "SOFT")])


@pytest.mark.clause("6.2.2")
def test_the_example_of_the_standard() -> None:
    """[N1, H1, N2, H2, N3]: stop; N1; then H1 alone; N2; H2 alone; N3, now driving is allowed."""
    names = ["N1", "H1", "N2", "H2", "N3"]
    bench = Bench()
    actions = [action(name, "NONE" if name[0] == "N" else "HARD") for name in names]
    bench.send(order("n0", "n1", node_actions={"n0": actions}))

    for position, name in enumerate(names):
        begun = [bench.status(each) for each in names]
        assert begun == ["FINISHED"] * position + ["INITIALIZING"] + ["WAITING"] * (4 - position)
        assert bool(bench.goals) is (name == "N3")
        bench.runs(name)
        bench.finishes(name)

    assert len(bench.goals) == 1


@pytest.mark.clause("6.2.2", "6.6.9/failed")
def test_a_failed_action_does_not_hold_back_the_others() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n0": [action("a", "HARD"), action("b", "HARD")]}))

    bench.fails("a")

    assert bench.status("b") == "INITIALIZING"
    bench.finishes("b")
    assert len(bench.goals) == 1


@pytest.mark.clause("6.2.2/outlive")
def test_actions_of_a_node_may_outlive_it() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n0": [action("a")], "n1": [action("b", "HARD")]}))
    bench.runs("a")
    bench.arrive()
    assert bench.statuses() == {"a": "RUNNING", "b": "WAITING"}

    bench.finishes("a")

    assert bench.status("b") == "INITIALIZING"


@pytest.mark.clause("6.2.2/edge")
def test_what_cannot_be_interrupted_outlives_its_edge() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [action("e", "NONE", "press")]}))
    bench.runs("e")

    bench.arrive()
    assert bench.status("e") == "RUNNING"
    assert not bench.idle
    bench.finishes("e")

    assert bench.status("e") == "FINISHED"
    assert not bench.errors
