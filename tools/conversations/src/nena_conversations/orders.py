"""Orders in a conversation: what fleet control sends (6.1), and what the robot's states echo (6.6.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import chain
from math import hypot
from typing import Final

from nena_conversations.message import ReceivedMessage
from nena_conversations.pending import BoundedDict, Unanswered
from nena_conversations.rules import Problem, Rule, Severity
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.order import Edge, Node, Order
from nena_shared.vda5050.state import State

OrderKey = tuple[str, int]
"""orderId and orderUpdateId."""


@dataclass(frozen=True, slots=True)
class StitchedOrder:
    """An order as sent so far over all updates: the base, and the last update with its horizon."""

    last: Order
    nodes: dict[int, Node]
    """Released nodes by sequenceId."""
    actions: dict[str, Action]
    """Actions of the base and of the last update's horizon, by actionId."""
    complete: bool
    """Whether the conversation contains the order from its beginning."""

    @property
    def key(self) -> OrderKey:
        """OrderId and orderUpdateId of the last update."""
        return self.last.order_id, self.last.order_update_id

    @property
    def decision_point(self) -> Node:
        """Last released node."""
        return self.nodes[max(self.nodes)]

    @property
    def end(self) -> int:
        """SequenceId of the last node, including the horizon."""
        return self.last.nodes[-1].sequence_id

    def released(self) -> dict[int, tuple[str, bool]]:
        """Return nodeId and released of each node, by sequenceId."""
        base = {number: (node.node_id, True) for number, node in self.nodes.items()}
        return base | {node.sequence_id: (node.node_id, node.released) for node in self.last.nodes}


def stitch(before: StitchedOrder | None, order: Order) -> StitchedOrder:
    """Return the order extended by an update, or a new one for another orderId."""
    nodes = {node.sequence_id: node for node in order.nodes if node.released}
    actions = {action.action_id: action for action in actions_of(order)}
    complete = order.nodes[0].sequence_id == 0
    # VDA 5050 3.0, 6.1.2: an update replaces the horizon, and with it the actions of the old one.
    if before and before.last.order_id == order.order_id:
        horizon = {action.action_id for action in _horizon_actions(before.last)}
        kept = {name: action for name, action in before.actions.items() if name not in horizon}
        nodes, actions, complete = before.nodes | nodes, kept | actions, before.complete
    return StitchedOrder(order, nodes, actions, complete)


def _horizon_actions(order: Order) -> Iterator[Action]:
    parts: Iterator[Node | Edge] = chain(order.nodes, order.edges)
    return chain.from_iterable(part.actions for part in parts if not part.released)


def actions_of(order: Order) -> Iterator[Action]:
    """Yield all actions of an order message, those of nodes first."""
    yield from chain.from_iterable(node.actions for node in order.nodes)
    yield from chain.from_iterable(edge.actions for edge in order.edges)


HEADER: Final = frozenset(Header.model_fields)


def new_order_problems(order: Order) -> Iterator[Problem]:
    """Check an order with a new orderId (6.1.1)."""
    if order.order_update_id:
        text = f"order '{order.order_id}' begins with orderUpdateId {order.order_update_id}, not 0"
        yield Rule.FIRST_UPDATE_ID, Severity.ERROR, text
    if order.nodes[0].sequence_id:
        text = f"order '{order.order_id}' begins with sequenceId {order.nodes[0].sequence_id}, not 0"
        yield Rule.FIRST_SEQUENCE_ID, Severity.ERROR, text


REACH: Final = 1.0
"""Distance at which a robot counts as standing on a node that names no deviation, m."""
EXACT: Final = 0.1
"""The same for a node that allows no deviation at all, m."""


def start_problems(order: Order, state: State) -> Iterator[Problem]:
    """Check that a new order begins where the robot is (6.1.4.7)."""
    first, place = order.nodes[0], state.mobile_robot_position
    at = first.node_position
    if first.node_id == state.last_node_id or at is None or place is None or not place.localized:
        return
    name = f"order '{order.order_id}' begins at node '{first.node_id}'"
    away = hypot(at.x - place.x, at.y - place.y)
    allowed = REACH if at.allowed_deviation_xy is None else max(EXACT, at.allowed_deviation_xy.a)
    if at.map_id != place.map_id:
        text = f"{name} on map '{at.map_id}', the robot is on map '{place.map_id}'"
        yield Rule.START_NODE, Severity.ERROR, text
    elif away > allowed:
        yield Rule.START_NODE, Severity.ERROR, f"{name}, which is {away:.2f} m from the robot"


def situation_problems(order: Order, state: State | None, held: StitchedOrder | None) -> Iterator[Problem]:
    """Check whether the robot, by its last state, may receive an order (6.1.4.6, 6.6.6).

    ``held`` is the order that the state echoes, if known.
    """
    if state is None:
        return
    if not state.operating_mode.takes_orders:
        text = f"order '{order.order_id}' is sent to a robot in the mode {state.operating_mode}"
        yield Rule.MODE, Severity.ERROR, text
    # Only the order's own actions: 2.x lists instant actions beside them, which do not keep a robot busy.
    open_actions = {each.action_id for each in state.action_states if not each.action_status.ended}
    acts = held is not None and not open_actions.isdisjoint(held.actions)
    if state.order_id != order.order_id and (state.node_states or state.edge_states or acts):
        text = f"order '{order.order_id}' is sent while '{state.order_id}' has not ended"
        yield Rule.OTHER_ORDER, Severity.ERROR, text


def update_problems(order: Order, before: StitchedOrder, *, cancelled: bool) -> Iterator[Problem]:
    """Check an order with the same orderId as the previous one (6.1.2, 6.1.4)."""
    name = f"update {order.order_update_id} of order '{order.order_id}'"
    last = before.last.order_update_id
    # VDA 5050 3.0, 6.1.4.5: a repetition with the same content is legal, and robots drop it.
    if order.order_update_id == last:
        if _content_of(order) != _content_of(before.last):
            yield Rule.SAME_UPDATE_ID, Severity.ERROR, f"{name} is repeated with different content"
        return
    if order.order_update_id < last:
        yield Rule.OUTDATED_UPDATE, Severity.ERROR, f"{name} follows update {last}"
        return
    if cancelled:
        yield Rule.UPDATE_AFTER_CANCEL, Severity.ERROR, f"{name} follows the order's cancelOrder"
    yield from _stitching_problems(order, before, name)


def _stitching_problems(order: Order, before: StitchedOrder, name: str) -> Iterator[Problem]:
    first, point = order.nodes[0], before.decision_point
    if (first.node_id, first.sequence_id) != (point.node_id, point.sequence_id):
        text = (
            f"{name} begins at node '{first.node_id}' ({first.sequence_id}), the base ends at "
            f"'{point.node_id}' ({point.sequence_id})"
        )
        yield Rule.STITCHING, Severity.ERROR, text
    # 2.x: robots ignore the content of the repeated node, so only 3.0 has this rule.
    elif first != point:
        yield Rule.STITCHING_NODE, Severity.ERROR, f"{name} changes the decision point '{first.node_id}'"


def _content_of(order: Order) -> str:
    # A repeated message has a new headerId and timestamp.
    return order.model_dump_json(exclude=set(HEADER), exclude_none=True)


def progress_problems(
    before: State | None, now: State, order: StitchedOrder, *, ends_early: bool
) -> Iterator[Problem]:
    """Check nodes and edges of a state of ``order``, after the state ``before`` (6.6.2).

    ``ends_early``: something ends the order, so nodes may disappear without being reached.
    """
    yield from _content_problems(now, order)
    yield from _last_node_problems(now, order)
    same = before is not None and before.order_id == now.order_id
    if not now.node_states:
        if (
            before
            and same
            and before.node_states
            and not ends_early
            and now.last_node_sequence_id != order.end
        ):
            # a person may have switched the mode and back between two states
            text = f"the rest of order '{now.order_id}' disappeared after node {now.last_node_sequence_id}"
            yield Rule.PROGRESS, Severity.WARNING, f"{text} without a visible reason"
        return
    yield from _first_node_problems(now)
    yield from _check_skipped_nodes(now, order)
    if before and same:
        yield from _check_steps(before, now, order)


def _content_problems(now: State, order: StitchedOrder) -> Iterator[Problem]:
    known = order.released()
    for state in now.node_states:
        node_id, released = known.get(state.sequence_id, (None, False))
        name = f"node '{state.node_id}' ({state.sequence_id})"
        if node_id != state.node_id:
            yield _progress_error(f"{name} is not part of the order")
        elif released is not state.released:
            yield _progress_error(f"{name} has released {state.released}, in the order {released}")
    yield from _not_rising([each.sequence_id for each in now.node_states], "nodeStates")
    yield from _not_rising([each.sequence_id for each in now.edge_states], "edgeStates")


def _last_node_problems(now: State, order: StitchedOrder) -> Iterator[Problem]:
    """Check that the robot has not driven into the horizon."""
    number = now.last_node_sequence_id
    if order.released().get(number) == (now.last_node_id, False):
        yield _progress_error(
            f"the robot reached node '{now.last_node_id}' ({number}), which is not released"
        )


def _not_rising(numbers: Sequence[int], what: str) -> Iterator[Problem]:
    if list(numbers) != sorted(set(numbers)):
        yield _progress_error(f"the sequenceIds of {what} do not increase: {', '.join(map(str, numbers))}")


def _first_node_problems(now: State) -> Iterator[Problem]:
    # VDA 5050 3.0, 6.6.1: the first node counts as reached on acceptance; 2.x leaves it open.
    if now.node_states[0].sequence_id == 0:
        text = f"the first node '{now.node_states[0].node_id}' of the order is in nodeStates"
        yield Rule.FIRST_NODE, Severity.ERROR, text


def _check_skipped_nodes(now: State, order: StitchedOrder) -> Iterator[Problem]:
    """Find nodes that disappeared although the robot reached none of them."""
    ahead, last = min(state.sequence_id for state in now.node_states), now.last_node_sequence_id
    # Nodes have even sequenceIds: the next one is two further.
    if now.last_node_id and ahead > last + 2:
        numbers = f"{last + 2}" if ahead == last + 4 else f"{last + 2} to {ahead - 2}"
        yield _progress_error(
            f"node {numbers} of order '{order.last.order_id}' disappeared without being reached"
        )


def _check_steps(before: State, now: State, order: StitchedOrder) -> Iterator[Problem]:
    """Compare two states of one order: no node reappears."""
    number = now.last_node_sequence_id
    known = order.released().get(number)
    if known and now.last_node_id and known[0] != now.last_node_id:
        yield _progress_error(f"lastNodeId '{now.last_node_id}' is not node {number} of the order")
    # An update may list nodes that the state before did not have.
    if before.order_update_id == now.order_update_id:
        old = {state.sequence_id for state in before.node_states}
        for state in now.node_states:
            if state.sequence_id not in old:
                yield _progress_error(
                    f"node '{state.node_id}' ({state.sequence_id}) disappeared and is listed again"
                )
    if number < before.last_node_sequence_id and now.last_node_id:
        yield _progress_error(f"lastNodeSequenceId decreases from {before.last_node_sequence_id} to {number}")


def _progress_error(text: str) -> Problem:
    return Rule.PROGRESS, Severity.ERROR, text


ORDERS_REMEMBERED: Final = 200


class OrderConversation:
    """Follow orders, updates and their echoes; may begin in the middle of an order."""

    def __init__(self) -> None:
        self._sent: StitchedOrder | None = None
        """Newest order that was sent and not rejected."""
        self._taken: StitchedOrder | None = None
        """Order of the robot's last state."""
        self._known: BoundedDict[OrderKey, StitchedOrder] = BoundedDict(ORDERS_REMEMBERED)
        self._waiting: Unanswered[OrderKey] = Unanswered()

    @property
    def current(self) -> StitchedOrder | None:
        """Order of the robot's last state, if it was sent in this conversation."""
        return self._taken

    @property
    def newest(self) -> str | None:
        """OrderId that was sent last and not rejected, if any."""
        return self._sent.last.order_id if self._sent else None

    def on_order(
        self, received: ReceivedMessage, order: Order, state: State | None, *, cancelled: bool
    ) -> Iterator[Problem]:
        """Check an order or update; ``state`` is the robot's last one."""
        before = self._order_before(order)
        yield from situation_problems(order, state, self._taken)
        if before:
            yield from update_problems(order, before, cancelled=cancelled)
        # An order that the robot already has began before the conversation: this is an update.
        elif state is None or state.order_id != order.order_id:
            yield from new_order_problems(order)
            if state:
                yield from start_problems(order, state)
        self._waiting.add((order.order_id, order.order_update_id), received)
        if before is None or order.order_update_id > before.last.order_update_id:
            self._sent = stitch(before, order)
            self._known[self._sent.key] = self._sent

    def on_state(self, state: State, before: State | None, *, ends_early: bool) -> Iterator[Problem]:
        """Check the order of a state.

        ``before`` is the previous state; ``ends_early``: nodes may disappear without being reached.
        """
        rejected = _rejected_orders(state)
        self._waiting.on_state(lambda key: _echoes_order(state, key) or _rejects_order(state, key, rejected))
        yield from self._echo_problems(state, before)
        self._taken = self._known.get((state.order_id, state.order_update_id))
        # A rejected order changes nothing: the next update must fit the one that the robot holds.
        if self._sent and _rejects_order(state, self._sent.key, rejected):
            self._sent = self._taken
        # An order whose beginning is missing lacks nodes that its states may still list.
        if self._taken and self._taken.complete:
            yield from progress_problems(before, state, self._taken, ends_early=ends_early)

    def unanswered(self, now: datetime, *, ended: bool) -> Iterator[tuple[ReceivedMessage, Problem]]:
        """Yield, once, orders without an answer in time."""
        for (order_id, update), received in self._waiting.overdue(now, ended=ended):
            text = f"no state echoes update {update} of order '{order_id}', and no error names it"
            yield received, (Rule.ANSWER, Severity.WARNING, text)

    def _order_before(self, order: Order) -> StitchedOrder | None:
        """Return the order as known before this message."""
        candidates = (self._sent, self._taken)
        return next(
            (
                candidate
                for candidate in candidates
                if candidate and candidate.last.order_id == order.order_id
            ),
            None,
        )

    def _echo_problems(self, state: State, before: State | None) -> Iterator[Problem]:
        key = state.order_id, state.order_update_id
        if before is None or key == (before.order_id, before.order_update_id) or not state.order_id:
            return
        if state.order_id == before.order_id and state.order_update_id < before.order_update_id:
            text = f"orderUpdateId decreases from {before.order_update_id} to {state.order_update_id}"
            yield Rule.ECHO, Severity.ERROR, text
        # A warning: the recording may lack the message that sent it.
        elif self._known and key not in self._known:
            text = f"the state has update {key[1]} of order '{key[0]}', which was not sent here"
            yield Rule.ECHO, Severity.WARNING, text


def _echoes_order(state: State, key: OrderKey) -> bool:
    # A newer update also confirms older ones: the robot may take two between two states.
    return key[0] == state.order_id and key[1] <= state.order_update_id


def _rejects_order(state: State, key: OrderKey, rejected: set[tuple[str, int | None]]) -> bool:
    """Return whether an error rejects the order; errors may name an accepted order for other reasons."""
    if _echoes_order(state, key):
        return False
    # 2.x does not demand orderUpdateId in the references: then the orderId must be another one.
    return key in rejected or (key[0] != state.order_id and (key[0], None) in rejected)


def _rejected_orders(state: State) -> set[tuple[str, int | None]]:
    """Return orderId and, if given, orderUpdateId of the orders that errors name."""
    found: set[tuple[str, int | None]] = set()
    for error in state.errors:
        references = {
            reference.reference_key: reference.reference_value for reference in error.error_references
        }
        update = references.get("orderUpdateId", "")
        if "orderId" in references:
            found.add((references["orderId"], int(update) if update.isdecimal() else None))
    return found
