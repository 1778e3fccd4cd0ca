"""Actions in a conversation: states of actions (6.6.9), and instant actions with their answers (6.2.1)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from nena_conversations.message import ReceivedMessage
from nena_conversations.orders import StitchedOrder
from nena_conversations.pending import BoundedDict, Unanswered
from nena_conversations.rules import Problem, Rule, Severity
from nena_shared.vda5050.action import (
    START_HIBERNATION,
    WAKE_UP_TIME,
    Action,
    ActionState,
    ActionStatus,
    BlockingType,
    InstantActions,
    wake_up_time,
)
from nena_shared.vda5050.malformed import quoted
from nena_shared.vda5050.state import OperatingMode, State

S = ActionStatus

# 0010: one table for all versions; 2.x lacks some of these changes, and RETRIABLE.
NEXT: Final[Mapping[ActionStatus, frozenset[ActionStatus]]] = {
    S.WAITING: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.INITIALIZING: frozenset({S.RUNNING, S.PAUSED, S.FAILED}),
    S.RUNNING: frozenset({S.PAUSED, S.FINISHED, S.FAILED, S.RETRIABLE}),
    S.PAUSED: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED}),
    S.RETRIABLE: frozenset({S.INITIALIZING, S.RUNNING, S.FAILED, S.FINISHED}),
    S.FINISHED: frozenset(),
    S.FAILED: frozenset(),
}
"""Allowed next statuses (figure in 6.6.9)."""

# VDA 5050 3.0, 6.2.2: SINGLE runs alone but lets the robot drive, SOFT is the reverse.
ALONE: Final = frozenset({BlockingType.HARD, BlockingType.SINGLE})
STANDING: Final = frozenset({BlockingType.HARD, BlockingType.SOFT})


def _reachable_statuses() -> dict[ActionStatus, frozenset[ActionStatus]]:
    """Return the statuses reachable from each status: one state may combine several changes."""
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


REACHABLE: Final = _reachable_statuses()


def all_actions(state: State | None) -> tuple[ActionState, ...]:
    """Return order and instant action states together, as 2.x reports them."""
    return (*state.action_states, *state.instant_action_states) if state else ()


def status_problems(before: State | None, now: State) -> Iterator[Problem]:
    """Compare action states with those of the previous state, by actionId."""
    old = {action.action_id: action.action_status for action in all_actions(before)}
    for action in all_actions(now):
        was = old.get(action.action_id, action.action_status)
        if action.action_status not in REACHABLE[was]:
            text = f"action '{action.action_id}' was {was} and is {action.action_status}"
            yield Rule.ACTION_STATUS, Severity.ERROR, text


def order_action_problems(now: State, order: StitchedOrder) -> Iterator[Problem]:
    """Check the actions of ``order`` in a state that echoes it."""
    statuses = {action.action_id: action.action_status for action in all_actions(now)}
    for action_id in order.actions:
        if action_id not in statuses:
            text = f"action '{action_id}' of order '{order.last.order_id}' has no state"
            yield Rule.ACTION_LOST, Severity.ERROR, text
    yield from _check_early_actions(now, order, statuses)
    running = [each for key, each in order.actions.items() if statuses.get(key) is S.RUNNING]
    yield from _check_blocking(now, running)


def _check_early_actions(
    now: State, order: StitchedOrder, statuses: Mapping[str, ActionStatus]
) -> Iterator[Problem]:
    """Find actions that started before the robot reached their node or edge."""
    # Without a last node nothing tells which nodes are still ahead.
    if not now.last_node_id:
        return
    last = now.last_node_sequence_id
    nodes = {state.sequence_id for state in now.node_states if state.sequence_id > last}
    # The edge behind the last node (its number + 1) is entered at once: its actions may run.
    edges = {state.sequence_id for state in now.edge_states if state.sequence_id > last + 1}
    known = {node.sequence_id: node for node in order.last.nodes} | order.nodes
    ahead: list[tuple[str, Iterable[Action]]]
    ahead = [(f"node '{known[node].node_id}'", known[node].actions) for node in nodes if node in known]
    ahead += [(f"edge '{e.edge_id}'", e.actions) for e in order.last.edges if e.sequence_id in edges]
    for place, actions in ahead:
        for action in actions:
            if statuses.get(action.action_id) in (S.RUNNING, S.FINISHED):
                text = (
                    f"action '{action.action_id}' is {statuses[action.action_id]} before {place} is reached"
                )
                yield Rule.ACTION_EARLY, Severity.ERROR, text


def _check_blocking(now: State, running: list[Action]) -> Iterator[Problem]:
    for action in running:
        if action.blocking_type in ALONE and len(running) > 1:
            others = ", ".join(f"'{each.action_id}'" for each in running if each is not action)
            text = f"action '{action.action_id}' is {action.blocking_type} but runs in parallel with {others}"
            yield Rule.BLOCKING, Severity.ERROR, text
        if action.blocking_type in STANDING and now.driving:
            text = f"the robot drives while the {action.blocking_type} action '{action.action_id}' runs"
            yield Rule.BLOCKING, Severity.WARNING, text


CANCEL_ORDER: Final = "cancelOrder"
ENDS_ORDER: Final = frozenset({CANCEL_ORDER, START_HIBERNATION})
ENDINGS: Final = 50
"""Remembered actions that end an order."""
HARMLESS: Final = frozenset({"stateRequest", "factsheetRequest"})
"""Requests without effect on the robot; most fleet controls send them in any mode."""


@dataclass(slots=True)
class _Ending:
    """An instant action that ends an order."""

    order_ids: frozenset[str]
    """Orders that the action may end: the robot may not have received the newest one yet."""
    status: ActionStatus | None = None


class InstantConversation:
    """Follow instant actions to their end (6.2.1)."""

    def __init__(self) -> None:
        self._waiting: Unanswered[str] = Unanswered()
        self._types: BoundedDict[str, str] = BoundedDict()
        """actionType of each instant action, by actionId."""
        self._ending: BoundedDict[str, _Ending] = BoundedDict(ENDINGS)

    def on_instant_actions(
        self,
        received: ReceivedMessage,
        message: InstantActions,
        state: State | None,
        newest_order: str | None,
    ) -> Iterator[Problem]:
        """Check instant actions; ``state`` is the robot's last one, ``newest_order`` was sent last."""
        for action in message.actions:
            if action.action_id in self._types:
                continue  # repeated, in case the first one was lost
            self._types[action.action_id] = action.action_type
            self._waiting.add(action.action_id, received)
            if action.action_type in ENDS_ORDER:
                self._ending[action.action_id] = _Ending(_cancelled_orders(action, state, newest_order))
            if state and not _is_allowed(action.action_type, state.operating_mode):
                text = f"{action.action_type} is sent to a robot in the mode {state.operating_mode}"
                yield Rule.MODE, Severity.ERROR, text
            at = action.parameter(WAKE_UP_TIME)
            if action.action_type == START_HIBERNATION and at is not None and wake_up_time(action) is None:
                text = f"{WAKE_UP_TIME} of {START_HIBERNATION} is {quoted(at)}, not YYYY-MM-DDTHH:mm:ss.fffZ"
                yield Rule.SPELLING, Severity.WARNING, text

    def on_state(self, state: State) -> Iterator[Problem]:
        """Check the instant actions of a state."""
        statuses = {action.action_id: action.action_status for action in all_actions(state)}
        self._waiting.on_state(lambda action_id: action_id in statuses)
        for action_id, ending in self._ending.items():
            before, ending.status = ending.status, statuses.get(action_id, ending.status)
            if ending.status is ActionStatus.FINISHED and before is not ActionStatus.FINISHED:
                yield from self._end_problems(state, action_id)

    def unanswered(self, now: datetime, *, ended: bool) -> Iterator[tuple[ReceivedMessage, Problem]]:
        """Yield, once, instant actions without a state in time."""
        for action_id, received in self._waiting.overdue(now, ended=ended):
            text = f"no state contains the instant action '{action_id}'"
            yield received, (Rule.INSTANT_ANSWER, Severity.WARNING, text)

    def ends(self, order_id: str) -> bool:
        """Return whether an instant action ends or ended the order."""
        endings = (each for each in self._ending.values() if order_id in each.order_ids)
        # A cancelOrder that FAILED leaves the order as it is.
        return any(ending.status is not ActionStatus.FAILED for ending in endings)

    def on_hibernation(self) -> Iterator[Problem]:
        """Check that the robot has reported the end of startHibernation before it hibernates (6.2.3)."""
        for action_id, ending in self._ending.items():
            ended = ending.status is not None and ending.status.ended
            if self._types.get(action_id) == START_HIBERNATION and not ended:
                text = f"the robot hibernates before a state shows the end of '{action_id}'"
                yield Rule.CONNECTION, Severity.ERROR, text

    def _end_problems(self, state: State, action_id: str) -> Iterator[Problem]:
        name = f"{self._types[action_id]} '{action_id}' is FINISHED, and"
        if state.node_states or state.edge_states:
            yield Rule.CANCEL_END, Severity.ERROR, f"{name} nodes or edges of the order remain"
        open_ones = (each.action_id for each in state.action_states if not each.action_status.ended)
        # 2.x lists instant actions in the same array; cancelOrder does not end those.
        if unended := [one for one in open_ones if one not in self._types]:
            text = f"{name} actions of the order have not ended: {', '.join(unended)}"
            yield Rule.CANCEL_END, Severity.ERROR, text


def _cancelled_orders(action: Action, state: State | None, newest_order: str | None) -> frozenset[str]:
    named = action.parameter("orderId")
    # VDA 5050 3.0: cancelOrder may name its order; 2.x means the one that the robot has.
    if isinstance(named, str):
        return frozenset({named})
    held = state.order_id if state else None
    return frozenset(each for each in (held, newest_order) if each)


def _is_allowed(action_type: str, mode: OperatingMode) -> bool:
    # VDA 5050 3.0, 6.6.6: the order is kept while a person moves the robot, so it can be cancelled.
    if mode is OperatingMode.INTERVENED:
        return action_type in HARMLESS | {CANCEL_ORDER}
    return mode.fleet_controls or action_type in HARMLESS
