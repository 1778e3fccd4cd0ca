"""Action states: each action has one, and it changes as the standard allows (section 6.6.9)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from nena_cli.vda5050.finding import Rule, Severity
from nena_cli.vda5050.header_checks import Problem
from nena_shared.vda5050.action import ActionState, ActionStatus

S = ActionStatus

FINAL: Final = frozenset({S.FINISHED, S.FAILED})
NEXT: Final[dict[ActionStatus, frozenset[ActionStatus]]] = {
    S.WAITING: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.INITIALIZING: frozenset({S.RUNNING, S.PAUSED, S.FAILED}),
    S.RUNNING: frozenset({S.PAUSED, S.FINISHED, S.FAILED, S.RETRIABLE}),
    S.PAUSED: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED}),
    S.RETRIABLE: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.FINISHED: frozenset(),
    S.FAILED: frozenset(),
}
"""What may follow each status, as the figure has it."""


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


def status_problems(before: dict[str, ActionState], now: Iterable[ActionState]) -> Iterator[Problem]:
    """Compare action states with those of the state before, by their id."""
    for each in now:
        old = before.get(each.action_id)
        if old and each.action_status not in REACHABLE[old.action_status]:
            text = f"action '{each.action_id}' was {old.action_status} and is {each.action_status}"
            yield Rule.ACTION_STATUS, Severity.ERROR, text


def lost_problems(expected: Iterable[str], now: Iterable[ActionState], order_id: str) -> Iterator[Problem]:
    """Look for actions of the order that the state does not name."""
    named = {each.action_id for each in now}
    for action_id in expected:
        if action_id not in named:
            text = f"action '{action_id}' of order '{order_id}' has no state"
            yield Rule.ACTION_LOST, Severity.ERROR, text
