"""The orders of one robot: what was sent, what its states echo, and how it goes on."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Final

from nena_cli.vda5050.action_checks import order_action_problems
from nena_cli.vda5050.base import OrderKey, SentOrder, extended
from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.order_checks import new_order_problems, situation_problems, update_problems
from nena_cli.vda5050.progress_checks import progress_problems
from nena_cli.vda5050.said import Said
from nena_cli.vda5050.sent import Unanswered
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State

ORDERS_REMEMBERED: Final = 200


class OrderConversation:
    """Follows orders, updates and their echoes; may begin in the middle of an order."""

    def __init__(self) -> None:
        self._sent: SentOrder | None = None
        """The newest that was sent and not refused."""
        self._taken: SentOrder | None = None
        """What the robot's last state echoed."""
        self._known: Remembered[OrderKey, SentOrder] = Remembered(ORDERS_REMEMBERED)
        self._waiting: Unanswered[OrderKey] = Unanswered()

    @property
    def newest(self) -> str | None:
        """The orderId that was sent last and not refused, if any was."""
        return self._sent.last.order_id if self._sent else None

    def on_order(
        self, said: Said, order: Order, state: State | None, *, cancelled: bool
    ) -> Iterator[Problem]:
        """Check an order or update; ``state`` is the robot's last one."""
        before = self._before(order)
        yield from situation_problems(order, state, self._taken)
        if before:
            yield from update_problems(order, before, cancelled=cancelled)
        elif state is None or state.order_id != order.order_id:
            yield from new_order_problems(order)
        self._waiting.add((order.order_id, order.order_update_id), said)
        if before is None or order.order_update_id > before.last.order_update_id:
            self._sent = extended(before, order)
            self._known[self._sent.key] = self._sent

    def on_state(self, state: State, before: State | None, *, ends_early: bool) -> Iterator[Problem]:
        """Check what a state says of orders.

        ``before`` is the state before it; ``ends_early``: nodes may vanish that were not reached.
        """
        refused = _refused_orders(state)
        self._waiting.state_came(lambda key: _echoes(state, key) or _refuses(state, key, refused))
        yield from self._echo_problems(state, before)
        self._taken = self._known.get((state.order_id, state.order_update_id))
        if self._sent and _refuses(state, self._sent.key, refused):
            self._sent = self._taken
        if self._taken and self._taken.complete:
            yield from progress_problems(before, state, self._taken, ends_early=ends_early)
        if self._taken:
            yield from order_action_problems(state, self._taken)

    def unanswered(self, now: datetime, *, ended: bool) -> Iterator[tuple[Said, Problem]]:
        """Name orders that no state has answered in time, once."""
        for (order_id, update), said in self._waiting.overdue(now, ended=ended):
            text = f"no state echoes update {update} of order '{order_id}', and no error names it"
            yield said, (Rule.ANSWER, Severity.WARNING, text)

    def _before(self, order: Order) -> SentOrder | None:
        """Give what is known of an order from before this message."""
        candidates = (self._sent, self._taken)
        return next((each for each in candidates if each and each.last.order_id == order.order_id), None)

    def _echo_problems(self, state: State, before: State | None) -> Iterator[Problem]:
        key = state.order_id, state.order_update_id
        if before is None or key == (before.order_id, before.order_update_id) or not state.order_id:
            return
        if state.order_id == before.order_id and state.order_update_id < before.order_update_id:
            text = f"orderUpdateId goes back from {before.order_update_id} to {state.order_update_id}"
            yield Rule.ECHO, Severity.ERROR, text
        elif self._known and key not in self._known:
            text = f"a state names update {key[1]} of order '{key[0]}', which was not sent here"
            yield Rule.ECHO, Severity.WARNING, text


def _echoes(state: State, key: OrderKey) -> bool:
    return key[0] == state.order_id and key[1] <= state.order_update_id


def _refuses(state: State, key: OrderKey, refused: set[tuple[str, int | None]]) -> bool:
    """Tell whether an error names the order; one that the robot has may be named for other reasons."""
    if _echoes(state, key):
        return False
    return key in refused or (key[0] != state.order_id and (key[0], None) in refused)


def _refused_orders(state: State) -> set[tuple[str, int | None]]:
    """Give the orders that errors name, with their updates where they do."""
    found: set[tuple[str, int | None]] = set()
    for error in state.errors:
        references = {each.reference_key: each.reference_value for each in error.error_references}
        update = references.get("orderUpdateId", "")
        if "orderId" in references:
            found.add((references["orderId"], int(update) if update.isdecimal() else None))
    return found
