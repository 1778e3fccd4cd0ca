"""One robot's conversation with its fleet control, followed message by message."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from nena_cli.vda5050.action_checks import FINAL, lost_problems, status_problems
from nena_cli.vda5050.finding import Rule, Severity
from nena_cli.vda5050.header_checks import HeaderChecks, Problem
from nena_cli.vda5050.order_checks import (
    Base,
    extended,
    new_order_problems,
    situation_problems,
    update_problems,
)
from nena_cli.vda5050.progress_checks import progress_problems
from nena_cli.vda5050.said import Said
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.rules import RULES, Rules
from nena_shared.vda5050.state import State

LONGEST_SILENCE: Final = timedelta(seconds=30)
GRACE: Final = timedelta(seconds=5)
"""On the way over the broker, and for clocks that are not exact."""
ANSWERED_WITHIN: Final = timedelta(seconds=10)
CHANCES: Final = 3
"""States: a robot that has sent so many, or any in that time, has not got the message, or does not answer."""
CANCEL_ORDER: Final = "cancelOrder"


@dataclass(slots=True)
class _Sent:
    """A message of fleet control that is to be answered, by what names it."""

    said: Said
    states: int = 0
    """States of the robot since then."""

    def overdue(self, now: datetime | None) -> bool:
        """Tell whether it should have been answered by ``now``, None: by the end."""
        if now is None:
            return self.states >= CHANCES
        return self.states > 0 and now - self.said.time > ANSWERED_WITHIN


@dataclass(slots=True)
class RobotConversation:
    """What was said so far; a conversation may begin in the middle of an order."""

    headers: HeaderChecks = field(default_factory=HeaderChecks)
    base: Base | None = None
    base_before: Base | None = None
    """What counts if the robot refuses the last order."""
    state: State | None = None
    state_at: datetime | None = None
    online: bool = True
    cancelled: bool = False
    orders: dict[tuple[str, int], _Sent] = field(default_factory=dict)
    instants: dict[str, _Sent] = field(default_factory=dict)
    cancels: set[str] = field(default_factory=set)
    known_actions: dict[str, Action] = field(default_factory=dict)

    def check(self, said: Said) -> Iterator[Problem]:
        """Take in the next message, and say what is wrong with it."""
        message = said.message
        if message is None:
            for problem in said.problems:
                yield Rule.MESSAGE, Severity.ERROR, problem
            return
        yield from self.headers.check(said, message)
        if isinstance(message, Order):
            yield from self._order(said, message)
        elif isinstance(message, InstantActions):
            yield from self._instant_actions(said, message)
        elif isinstance(message, State):
            yield from self._state(said, message)
        elif isinstance(message, Connection):
            self.online = message.connection_state is ConnectionState.ONLINE
            self.state_at = None

    def unanswered(self, now: datetime | None) -> Iterator[tuple[Said, Problem]]:
        """Name what was to be answered long before ``now`` (None: the end), and was not, once."""
        for key, sent in list(self.orders.items()):
            if sent.overdue(now):
                del self.orders[key]
                text = f"no state echoes update {key[1]} of order '{key[0]}', and no error names it"
                yield sent.said, (Rule.ANSWER, Severity.WARNING, text)
        for action_id, sent in list(self.instants.items()):
            if sent.overdue(now):
                del self.instants[action_id]
                text = f"no state shows the instant action '{action_id}'"
                yield sent.said, (Rule.INSTANT_ANSWER, Severity.WARNING, text)

    def _order(self, said: Said, order: Order) -> Iterator[Problem]:
        rules = _rules(said)
        yield from self._reused(action for node in order.nodes for action in node.actions)
        if self.base and self.base.order_id == order.order_id:
            yield from update_problems(order, self.base, rules, cancelled=self.cancelled)
        else:
            if self.state is None or self.state.order_id != order.order_id:
                yield from new_order_problems(order, rules)
            yield from situation_problems(order, self.state)
        self.orders[order.order_id, order.order_update_id] = _Sent(said)
        self._candidate(order)

    def _candidate(self, order: Order) -> None:
        """Hold the order for the robot's if nothing says yet that it is not."""
        older = self.base and self.base.order_id == order.order_id
        if older and self.base and order.order_update_id <= self.base.order_update_id:
            return
        if not older:
            self.cancelled = False
        self.base_before = self.base
        self.base = extended(self.base, order)

    def _instant_actions(self, said: Said, message: InstantActions) -> Iterator[Problem]:
        yield from self._reused(message.actions)
        for action in message.actions:
            self.instants.setdefault(action.action_id, _Sent(said))
            if action.action_type == CANCEL_ORDER:
                self.cancels.add(action.action_id)

    def _reused(self, actions: Iterator[Action] | tuple[Action, ...]) -> Iterator[Problem]:
        for action in actions:
            known = self.known_actions.setdefault(action.action_id, action)
            if known.action_type != action.action_type:
                both = f"'{known.action_type}' and '{action.action_type}'"
                text = f"actionId '{action.action_id}' stands for {both}"
                yield Rule.ACTION_ID, Severity.ERROR, text

    def _state(self, said: Said, state: State) -> Iterator[Problem]:
        if self.state_at and self.online and said.time - self.state_at > LONGEST_SILENCE + GRACE:
            silence = (said.time - self.state_at).total_seconds()
            yield Rule.STATE_INTERVAL, Severity.ERROR, f"no state for {silence:.0f} s"
        self._answered(state)
        if self.base:
            yield from self._of_order(state, self.base)
        before = {each.action_id: each for each in _all_actions(self.state)}
        yield from status_problems(before, _all_actions(state))
        yield from self._cancel_ends(state)
        self.state, self.state_at = state, said.time

    def _answered(self, state: State) -> None:
        """Strike out what the state answers, and count it as a chance for the rest."""
        for sent in (*self.orders.values(), *self.instants.values()):
            sent.states += 1
        refused = _refused_orders(state)
        for key in list(self.orders):
            echoed = key[0] == state.order_id and key[1] <= state.order_update_id
            if echoed or key in refused or ((key[0], None) in refused and key[0] != state.order_id):
                del self.orders[key]
                if not echoed and self.base and (self.base.order_id, self.base.order_update_id) == key:
                    self.base = self.base_before
        for each in _all_actions(state):
            self.instants.pop(each.action_id, None)

    def _of_order(self, state: State, base: Base) -> Iterator[Problem]:
        if state.order_id != base.order_id or state.order_update_id != base.order_update_id:
            return
        if base.complete:
            yield from progress_problems(self.state, state, base)
        expected = [action.action_id for node in base.last.nodes for action in node.actions]
        expected += [action.action_id for edge in base.last.edges for action in edge.actions]
        yield from lost_problems(expected, _all_actions(state), base.order_id)

    def _cancel_ends(self, state: State) -> Iterator[Problem]:
        for each in _all_actions(state):
            if each.action_id not in self.cancels or each.action_status not in FINAL:
                continue
            self.cancels.discard(each.action_id)
            if each.action_status is not ActionStatus.FINISHED:
                continue
            self.cancelled = True
            if state.node_states or state.edge_states:
                text = f"cancelOrder '{each.action_id}' is FINISHED, and nodes or edges of the order are left"
                yield Rule.CANCEL_END, Severity.ERROR, text


def _rules(said: Said) -> Rules:
    return RULES[said.codec.version]


def _all_actions(state: State | None) -> tuple[ActionState, ...]:
    return (*state.action_states, *state.instant_action_states) if state else ()


def _refused_orders(state: State) -> set[tuple[str, int | None]]:
    """Give the orders that errors name, with their updates where they do."""
    found: set[tuple[str, int | None]] = set()
    for error in state.errors:
        references = {each.reference_key: each.reference_value for each in error.error_references}
        update = references.get("orderUpdateId", "")
        if "orderId" in references:
            found.add((references["orderId"], int(update) if update.isdecimal() else None))
    return found
