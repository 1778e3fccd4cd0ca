"""Action states: each action has one, begins in time, and changes as the standard allows (6.6.9)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from nena_cli.vda5050.base import SentOrder
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.state import State

S = ActionStatus

NEXT: Final[Mapping[ActionStatus, frozenset[ActionStatus]]] = {
    S.WAITING: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.INITIALIZING: frozenset({S.RUNNING, S.PAUSED, S.FAILED}),
    S.RUNNING: frozenset({S.PAUSED, S.FINISHED, S.FAILED, S.RETRIABLE}),
    S.PAUSED: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED}),
    S.RETRIABLE: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.FINISHED: frozenset(),
    S.FAILED: frozenset(),
}
"""What may follow each status, as the figure has it."""

ALONE: Final = frozenset({BlockingType.HARD, BlockingType.SINGLE})
STANDING: Final = frozenset({BlockingType.HARD, BlockingType.SOFT})


def _reachable() -> dict[ActionStatus, frozenset[ActionStatus]]:
    """Give what may follow each status in the end: one state may tell of several changes."""
    found: dict[ActionStatus, frozenset[ActionStatus]] = {}
    for start in ActionStatus:
        seen: set[ActionStatus] = set()
        ahead = [start]
        while ahead:
            fresh = NEXT[ahead.pop()] - seen
            seen |= fresh
            ahead += fresh
        found[start] = frozenset(seen | {start})
    return found


REACHABLE: Final = _reachable()


def all_actions(state: State | None) -> tuple[ActionState, ...]:
    """Give the states of the order's and of instant actions, which 2.x does not tell apart."""
    return (*state.action_states, *state.instant_action_states) if state else ()


def status_problems(before: State | None, now: State) -> Iterator[Problem]:
    """Compare action states with those of the state before, by their id."""
    old = {each.action_id: each.action_status for each in all_actions(before)}
    for each in all_actions(now):
        was = old.get(each.action_id, each.action_status)
        if each.action_status not in REACHABLE[was]:
            text = f"action '{each.action_id}' was {was} and is {each.action_status}"
            yield Rule.ACTION_STATUS, Severity.ERROR, text


def order_action_problems(now: State, order: SentOrder) -> Iterator[Problem]:
    """Check the actions of ``order`` in a state that echoes it."""
    statuses = {each.action_id: each.action_status for each in all_actions(now)}
    for action_id in order.actions:
        if action_id not in statuses:
            text = f"action '{action_id}' of order '{order.last.order_id}' has no state"
            yield Rule.ACTION_LOST, Severity.ERROR, text
    yield from _early(now, order, statuses)
    running = [each for key, each in order.actions.items() if statuses.get(key) is S.RUNNING]
    yield from _blocking(now, running)


def _early(now: State, order: SentOrder, statuses: Mapping[str, ActionStatus]) -> Iterator[Problem]:
    """Look for actions that have begun before the robot came to their node or edge."""
    if not now.last_node_id:
        return
    last = now.last_node_sequence_id
    nodes = {each.sequence_id for each in now.node_states if each.sequence_id > last}
    edges = {each.sequence_id for each in now.edge_states if each.sequence_id > last + 1}
    known = {each.sequence_id: each for each in order.last.nodes} | order.nodes
    ahead: list[tuple[str, Iterable[Action]]]
    ahead = [(f"node '{known[each].node_id}'", known[each].actions) for each in nodes if each in known]
    ahead += [(f"edge '{e.edge_id}'", e.actions) for e in order.last.edges if e.sequence_id in edges]
    for place, actions in ahead:
        for action in actions:
            if statuses.get(action.action_id) in (S.RUNNING, S.FINISHED):
                text = (
                    f"action '{action.action_id}' is {statuses[action.action_id]} before {place} is reached"
                )
                yield Rule.ACTION_EARLY, Severity.ERROR, text


def _blocking(now: State, running: list[Action]) -> Iterator[Problem]:
    for action in running:
        if action.blocking_type in ALONE and len(running) > 1:
            others = ", ".join(f"'{each.action_id}'" for each in running if each is not action)
            text = f"action '{action.action_id}' is {action.blocking_type} and runs beside {others}"
            yield Rule.BLOCKING, Severity.ERROR, text
        if action.blocking_type in STANDING and now.driving:
            text = f"the robot drives while the {action.blocking_type} action '{action.action_id}' runs"
            yield Rule.BLOCKING, Severity.WARNING, text
