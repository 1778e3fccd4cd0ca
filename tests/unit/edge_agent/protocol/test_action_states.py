"""Transitions of action states (section 6.6.9, figure 21)."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.protocol.action_states import ActionQueue, ActionRecord, ActionStates, allow_driving
from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange
from nena_edge_agent.protocol.events import LoadSensed, StartAction
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.state import Load
from support.robot_core import ACTIONS, Bench, action, instant, order


def states(status: str) -> ActionStates:
    made = ActionStates()
    made.add([ActionRecord(action("a"), ActionScope.NODE, 0, ActionStatus(status), None)])
    return made


@pytest.mark.clause("6.6.9")
@pytest.mark.parametrize("ended", ["FINISHED", "FAILED"])
@pytest.mark.parametrize("to", list(ActionStatus))
def test_an_ended_action_never_changes(ended: str, to: ActionStatus) -> None:
    made = states(ended)

    assert not made.change("a", to)
    assert made.states[0].action_status == ended


@pytest.mark.clause("6.6.9")
@pytest.mark.parametrize(
    ("old", "new", "allowed"),
    [
        ("WAITING", "INITIALIZING", True),
        ("WAITING", "RUNNING", True),
        ("WAITING", "PAUSED", False),
        ("INITIALIZING", "RUNNING", True),
        ("RUNNING", "INITIALIZING", False),
        ("RUNNING", "PAUSED", True),
        ("RUNNING", "WAITING", False),
        ("RUNNING", "RETRIABLE", True),
        ("PAUSED", "RUNNING", True),
        ("RETRIABLE", "FAILED", True),
        ("INITIALIZING", "FINISHED", True),
    ],
)
def test_transitions_follow_figure_21(old: str, new: str, allowed: bool) -> None:  # noqa: FBT001
    made = states(old)

    assert made.change("a", ActionStatus(new)) is allowed
    assert made.states[0].action_status == (new if allowed else old)


def test_a_new_result_is_a_change_and_a_repeated_status_is_not() -> None:
    made = states("RUNNING")
    revision = made.revision

    assert not made.change("a", ActionStatus.RUNNING)
    assert made.revision == revision
    assert made.change("a", ActionStatus.RUNNING, "half done")
    assert made.states[0].action_result == "half done"


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
def test_runnable_actions_and_whether_driving_is_allowed(
    kinds: tuple[str, ...],
    runnable: list[str],
    driving: bool,  # noqa: FBT001
) -> None:
    made = queue(*kinds)

    assert made.runnable() == runnable
    assert made.driving_allowed is driving


@pytest.mark.clause("6.2.2")
def test_a_node_allows_driving_unless_an_action_requires_standstill() -> None:
    assert allow_driving([action("a", "NONE"), action("b", "SINGLE")])
    assert not allow_driving([action("a", "NONE"), action("b", "SOFT")])


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
def test_a_failed_action_does_not_block_the_others() -> None:
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
def test_an_uninterruptible_action_outlives_its_edge() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [action("e", "NONE", "press")]}))
    bench.runs("e")

    bench.arrive()
    assert bench.status("e") == "RUNNING"
    assert not bench.idle
    bench.finishes("e")

    assert bench.status("e") == "FINISHED"
    assert not bench.errors


SCOPES = (ActionScope.NODE, ActionScope.EDGE, ActionScope.INSTANT)
PICK = ActionDeclaration("pick", SCOPES, load=LoadChange.TAKE)
DROP = ActionDeclaration("drop", SCOPES, load=LoadChange.GIVE)
BOX = Load(load_id="box", load_type="EPAL")


def robot(*, memory: Memory | None = None) -> Bench:
    return Bench(memory=memory, actions={**ACTIONS, "pick": PICK, "drop": DROP})


def pick(action_id: str = "p") -> Action:
    return action(action_id, "HARD", "pick", loadId="box", loadType="EPAL")


def drop(action_id: str = "d") -> Action:
    return action(action_id, "HARD", "drop")


def loaded() -> Bench:
    bench = robot()
    bench.send(order("n0", order_id="fetch", node_actions={"n0": [pick()]}))
    bench.runs("p")
    bench.finishes("p")
    assert bench.state.loads == (BOX,)
    return bench


@pytest.mark.clause("6.2.3/pick", "7.8/loads")
def test_taking_loads_the_robot_and_giving_unloads_it() -> None:
    bench = loaded()

    bench.send(order("n0", order_id="bring", node_actions={"n0": [drop()]}))
    bench.finishes("d")

    assert bench.state.loads == ()


def test_a_failed_action_does_not_change_the_load() -> None:
    bench = loaded()
    bench.send(order("n0", order_id="bring", node_actions={"n0": [drop()]}))
    bench.fails("d")

    assert bench.state.loads == (BOX,)


@pytest.mark.clause("6.1.4.3")
@pytest.mark.parametrize(
    ("what", "refused"),
    [
        ([drop()], "carries none"),
        ([pick(), pick("p2")], "already loaded"),
        ([pick(), drop(), drop("d2")], "carries none"),
        ([pick(), drop(), pick("p2")], None),
    ],
)
def test_an_order_that_contradicts_the_load_is_refused_before_the_robot_drives(
    what: list[Action], refused: str | None
) -> None:
    bench = robot()
    names = [f"n{number}" for number in range(len(what) + 1)]
    bench.send(order(*names, node_actions={name: [each] for name, each in zip(names[1:], what, strict=True)}))

    assert bool(bench.goals) == (refused is None)
    assert bench.errors == (["INVALID_ORDER_ACTION"] if refused else [])
    if refused:
        assert refused in str(bench.state.errors[0].error_description)


def test_edge_actions_are_ordered_between_those_of_their_nodes() -> None:
    bench = robot()
    bench.send(order("n0", "n1", node_actions={"n0": [pick()]}, edge_actions={"n0-n1": [drop()]}))

    assert bench.errors == []


def test_an_update_begins_with_the_load_at_the_end_of_the_base() -> None:
    bench = robot()
    bench.send(order("n0", "n1", node_actions={"n1": [pick()]}))
    bench.send(order("n1", "n2", update=1, first=2, node_actions={"n1": [pick()], "n2": [pick("p2")]}))
    assert bench.errors == ["INVALID_ORDER_ACTION"]

    bench.send(order("n1", "n2", update=1, first=2, node_actions={"n1": [pick()], "n2": [drop()]}))
    assert bench.errors == []


def test_an_order_resent_after_its_load_was_picked_up_is_the_same_order() -> None:
    bench = robot()
    sent = order("n0", "n1", node_actions={"n0": [pick()]})
    bench.send(sent)
    bench.finishes("p")
    bench.send(sent)

    assert bench.errors == []


@pytest.mark.clause("6.2.3/pick")
def test_an_action_without_its_expected_load_fails_before_its_plug_in() -> None:
    bench = robot()
    bench.send(order("n0", node_actions={"n0": [pick(), drop(), action("w", "HARD")]}))
    bench.fails("p")

    assert bench.statuses() == {"p": "FAILED", "d": "FAILED", "w": "INITIALIZING"}
    started = [each.action.action_id for each in bench.effects_of(StartAction)]
    assert started == ["p", "w"]


@pytest.mark.clause("6.2.1/refused")
def test_an_instant_action_that_contradicts_the_load_is_refused() -> None:
    bench = robot()
    bench.do(instant(drop()))

    assert bench.status("d") == "FAILED"
    assert bench.errors == ["INVALID_INSTANT_ACTION"]


@pytest.mark.clause("7.8/loads")
def test_the_load_survives_a_restart() -> None:
    kept = loaded().core.memory().model_dump_json(exclude_defaults=True)

    assert robot(memory=Memory.model_validate_json(kept)).state.loads == (BOX,)


def test_a_load_sensor_overrides_the_loads_and_reports_no_ids() -> None:
    bench = loaded()

    def seen(*, loaded: bool) -> tuple[Load, ...]:
        bench.do(LoadSensed(loaded=loaded))
        return bench.core.robot.loads

    assert seen(loaded=True) == (BOX,)
    assert seen(loaded=False) == ()
    assert seen(loaded=True) == (Load(),)


def test_an_unavailable_action_is_refused_with_its_reason() -> None:
    away: dict[str, Any] = {
        "actions": {"lift": ActionDeclaration("lift", SCOPES, unavailable="it has no ROS")}
    }
    bench = Bench(**away)
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD", "lift")]}))

    assert "it has no ROS" in str(bench.state.errors[0].error_description)
