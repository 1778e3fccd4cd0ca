"""What must hold however often the agent has died."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from support.restarts.life import History
from support.restarts.scenario import Scenario

FINAL = (ActionStatus.FINISHED, ActionStatus.FAILED)
INTERRUPTED = "interrupted"
NOT_BEGUN_ANEW = ("press", "lamp", "initPosition", "initializePosition")
"""Types of actions that a death fails."""
Place = tuple[float, float]


def check(history: History) -> None:
    """Check all that needs no other history to compare with.

    Raises:
        AssertionError: something does not hold.

    """
    check_headers((each.topic, each.payload) for each in history.wire.published)
    check_states(history.fleet.states)
    _nothing_is_driven_twice(history)
    _nothing_is_done_twice(history)


def check_end(history: History, undisturbed: History) -> None:
    """Check that ``history`` has ended as the ``undisturbed`` one, but for actions that a death fails.

    Raises:
        AssertionError: it has not.

    """
    failed = _interrupted(history)
    end, wanted = _end_of(history, failed), _end_of(undisturbed, failed)
    differences = {name: (value, wanted[name]) for name, value in end.items() if value != wanted[name]}
    assert not differences, f"ends with, instead of: {differences}"


def _end_of(history: History, without: set[str]) -> dict[str, Any]:
    """Return what the last state shows, and where the robot is, ``without`` some actions."""
    state = history.fleet.states[-1]
    end = {
        "order": (state.order_id, state.order_update_id),
        "ahead": (state.node_states, state.edge_states),
        "paused": state.paused,
        "operating mode": state.operating_mode,
    }
    if history.scenario.changeful:
        return end
    allowed = {ErrorType.ACTION_FAILED.value, "actionFailed"} if without else set()
    errors = {each.error_type for each in state.errors} - allowed
    return end | {
        "last node": (state.last_node_id, state.last_node_sequence_id),
        "actions": {a.action_id: a.action_status for a in _actions(state) if a.action_id not in without},
        "loads": state.loads,
        "zones": (state.zone_sets, state.zone_requests),
        "errors": errors,
        "place": (round(history.world.pose.x, 3), round(history.world.pose.y, 3)),
        "goals": Counter(_place(goal.pose) for _, goal in history.accepted),
    }


def _interrupted(history: History) -> set[str]:
    """Return the actions that a death has failed; they must be such that cannot be begun again."""
    failed = [
        each
        for each in _actions(history.fleet.states[-1])
        if each.action_status is ActionStatus.FAILED and INTERRUPTED in (each.action_result or "")
    ]
    assert history.scenario.changeful or {each.action_type for each in failed} <= set(NOT_BEGUN_ANEW)
    return {each.action_id for each in failed}


def check_headers(messages: Iterable[tuple[str, bytes]]) -> None:
    """Check that the headerId rises in the messages of each topic, last wills left out.

    Raises:
        AssertionError: it does not.

    """
    last: dict[str, int] = {}
    for topic, payload in messages:
        number = json.loads(payload)["headerId"]
        assert number > last.get(topic, -1), f"headerId {number} of {topic} does not rise"
        last[topic] = number


def check_states(states: Sequence[State]) -> None:
    """Check that no state contradicts an earlier one.

    Raises:
        AssertionError: one does.
    """
    for before, after in pairwise(states):
        _states_agree(before, after)
    changes = [after.order_id for before, after in pairwise(states) if before.order_id != after.order_id]
    assert len(changes) == len(set(changes)), f"an order comes back: {changes}"


def _states_agree(before: State, after: State) -> None:
    ahead = [*(n.sequence_id for n in after.node_states), *(e.sequence_id for e in after.edge_states)]
    assert not ahead or min(ahead) > after.last_node_sequence_id, "a traversed node is ahead"
    if before.order_id != after.order_id:
        return
    assert after.order_update_id >= before.order_update_id
    assert after.last_node_sequence_id >= before.last_node_sequence_id, "the last node goes back"
    now = {each.action_id: each.action_status for each in _actions(after)}
    for each in _actions(before):
        if each.action_status in FINAL:
            shown = now.get(each.action_id, each.action_status)
            assert shown is each.action_status, f"{each.action_id}: {each.action_status}, then {shown}"


def _nothing_is_driven_twice(history: History) -> None:
    """Each goal leads to a node that was ahead when it was given, by what the robot had reported."""
    for seen, goal in history.accepted:
        state = history.fleet.states[seen - 1] if seen else None
        places = _ahead(history.scenario, state)
        assert _place(goal.pose) in places, f"a goal to {goal.pose} with {places} ahead"


def _ahead(scenario: Scenario, state: State | None) -> set[Place]:
    """Return the places that a robot may drive to that has shown ``state``."""
    orders = [step.message for step in scenario.steps if isinstance(step.message, Order)]
    ids = [(each.order_id, each.order_update_id) for each in orders]
    now = (state.order_id, state.order_update_id) if state else ("", 0)
    newer = orders[ids.index(now) + 1 if now in ids else 0 :]
    nodes = [node.node_position for each in newer for node in each.nodes]
    nodes += [node.node_position for node in state.node_states] if state else []
    return {(each.x, each.y) for each in nodes if each}


def _nothing_is_done_twice(history: History) -> None:
    for seen, action_id in history.begun:
        reported = (each for state in history.fleet.states[:seen] for each in _actions(state))
        ended = any(each.action_id == action_id and each.action_status in FINAL for each in reported)
        assert not ended, f"'{action_id}' begins after its end was reported"
    for action_id, times in history.world.begun_once.items():
        assert times == 1, f"'{action_id}' cannot be begun again, and was"


def _actions(state: State) -> tuple[ActionState, ...]:
    return (*state.action_states, *state.instant_action_states)


def _place(pose: Any) -> Place:
    return round(pose.x, 3), round(pose.y, 3)
