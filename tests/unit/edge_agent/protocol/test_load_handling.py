"""The load: what actions do to it, and which orders do not fit it."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange
from nena_edge_agent.protocol.effects import StartAction
from nena_edge_agent.protocol.events import ActionReport, LoadSensed
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.state import Load
from support.robot_core import ACTIONS, Bench, action, instant, order

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


def test_an_action_that_fails_leaves_the_load_alone() -> None:
    bench = loaded()
    bench.send(order("n0", order_id="bring", node_actions={"n0": [drop()]}))
    bench.fails("d")

    assert bench.state.loads == (BOX,)


def test_a_plug_in_may_know_the_load_better() -> None:
    bench = robot()
    bench.send(order("n0", node_actions={"n0": [pick()]}))
    bench.do(ActionReport("p", ActionStatus.FINISHED, loads=(Load(load_id="two"),)))

    assert bench.state.loads == (Load(load_id="two"),)


@pytest.mark.clause("6.1.4.3")
@pytest.mark.parametrize(
    ("what", "refused"),
    [
        ([drop()], "carries nothing"),
        ([pick(), pick("p2")], "loaded already"),
        ([pick(), drop(), drop("d2")], "carries nothing"),
        ([pick(), drop(), pick("p2")], None),
    ],
)
def test_an_order_that_will_not_fit_the_load_is_refused_before_the_robot_drives(
    what: list[Action], refused: str | None
) -> None:
    bench = robot()
    names = [f"n{number}" for number in range(len(what) + 1)]
    bench.send(order(*names, node_actions={name: [each] for name, each in zip(names[1:], what, strict=True)}))

    assert bool(bench.goals) == (refused is None)
    assert bench.errors == (["INVALID_ORDER_ACTION"] if refused else [])
    if refused:
        assert refused in str(bench.state.errors[0].error_description)


def test_actions_of_edges_have_their_turn_between_those_of_nodes() -> None:
    bench = robot()
    bench.send(order("n0", "n1", node_actions={"n0": [pick()]}, edge_actions={"n0-n1": [drop()]}))

    assert bench.errors == []


def test_an_update_begins_with_the_load_that_the_base_will_leave() -> None:
    bench = robot()
    bench.send(order("n0", "n1", node_actions={"n1": [pick()]}))
    bench.send(order("n1", "n2", update=1, first=2, node_actions={"n1": [pick()], "n2": [pick("p2")]}))
    assert bench.errors == ["INVALID_ORDER_ACTION"]

    bench.send(order("n1", "n2", update=1, first=2, node_actions={"n1": [pick()], "n2": [drop()]}))
    assert bench.errors == []


def test_an_order_that_comes_again_when_its_load_is_taken_is_no_other_order() -> None:
    bench = robot()
    sent = order("n0", "n1", node_actions={"n0": [pick()]})
    bench.send(sent)
    bench.finishes("p")
    bench.send(sent)

    assert bench.errors == []


@pytest.mark.clause("6.2.3/pick")
def test_an_action_whose_load_did_not_come_fails_without_its_plug_in() -> None:
    bench = robot()
    bench.send(order("n0", node_actions={"n0": [pick(), drop(), action("w", "HARD")]}))
    bench.fails("p")

    assert bench.statuses() == {"p": "FAILED", "d": "FAILED", "w": "INITIALIZING"}
    started = [each.action.action_id for each in bench.effects_of(StartAction)]
    assert started == ["p", "w"]


@pytest.mark.clause("6.2.1/refused")
def test_an_instant_action_that_does_not_fit_the_load_is_refused() -> None:
    bench = robot()
    bench.do(instant(drop()))

    assert bench.status("d") == "FAILED"
    assert bench.errors == ["INVALID_INSTANT_ACTION"]


@pytest.mark.clause("7.8/loads")
def test_the_load_survives_a_restart() -> None:
    kept = loaded().core.memory().model_dump_json(exclude_defaults=True)

    assert robot(memory=Memory.model_validate_json(kept)).state.loads == (BOX,)


def test_a_sensor_has_the_last_word_and_knows_no_names() -> None:
    bench = loaded()

    def seen(*, loaded: bool) -> tuple[Load, ...]:
        bench.do(LoadSensed(loaded=loaded))
        return bench.core.parts.loads

    assert seen(loaded=True) == (BOX,)
    assert seen(loaded=False) == ()
    assert seen(loaded=True) == (Load(),)


def test_what_a_robot_never_does_is_refused_with_its_reason() -> None:
    away: dict[str, Any] = {
        "actions": {"lift": ActionDeclaration("lift", SCOPES, unavailable="it has no ROS")}
    }
    bench = Bench(**away)
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD", "lift")]}))

    assert "it has no ROS" in str(bench.state.errors[0].error_description)
