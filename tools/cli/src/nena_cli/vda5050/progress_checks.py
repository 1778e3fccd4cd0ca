"""Nodes and edges in the states of a robot: they go in their order, and none comes back (section 6.6.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nena_cli.vda5050.base import SentOrder
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_shared.vda5050.state import State


def progress_problems(
    before: State | None, now: State, order: SentOrder, *, ends_early: bool
) -> Iterator[Problem]:
    """Check a state that echoes ``order``, after the state ``before``.

    ``ends_early``: something ends the order, so that nodes may vanish that were not reached.
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
            text = f"the rest of order '{now.order_id}' is gone behind node {now.last_node_sequence_id}"
            yield Rule.PROGRESS, Severity.WARNING, f"{text}, and nothing tells why"
        return
    yield from _first_node_problems(now)
    yield from _skipped(now, order)
    if before and same:
        yield from _steps(before, now, order)


def _content_problems(now: State, order: SentOrder) -> Iterator[Problem]:
    known = order.released()
    for each in now.node_states:
        node_id, released = known.get(each.sequence_id, (None, False))
        name = f"node '{each.node_id}' ({each.sequence_id})"
        if node_id != each.node_id:
            yield _error(f"{name} is none of the order")
        elif released is not each.released:
            yield _error(f"{name} is told with released {each.released}, the order has {released}")
    yield from _not_rising([each.sequence_id for each in now.node_states], "nodeStates")
    yield from _not_rising([each.sequence_id for each in now.edge_states], "edgeStates")


def _last_node_problems(now: State, order: SentOrder) -> Iterator[Problem]:
    """Look for a robot that has driven into the horizon."""
    number = now.last_node_sequence_id
    if order.released().get(number) == (now.last_node_id, False):
        yield _error(f"the robot has come to node '{now.last_node_id}' ({number}), which is not released")


def _not_rising(numbers: Sequence[int], what: str) -> Iterator[Problem]:
    if list(numbers) != sorted(set(numbers)):
        yield _error(f"the sequenceIds of {what} do not rise: {', '.join(map(str, numbers))}")


def _first_node_problems(now: State) -> Iterator[Problem]:
    if now.node_states[0].sequence_id == 0:
        text = f"the first node '{now.node_states[0].node_id}' of the order stands in nodeStates"
        yield Rule.FIRST_NODE, Severity.ERROR, text


def _skipped(now: State, order: SentOrder) -> Iterator[Problem]:
    """Look for nodes that are gone though the robot has not come to any of them."""
    ahead, last = min(each.sequence_id for each in now.node_states), now.last_node_sequence_id
    if now.last_node_id and ahead > last + 2:
        numbers = f"{last + 2}" if ahead == last + 4 else f"{last + 2} to {ahead - 2}"
        yield _error(f"node {numbers} of order '{order.last.order_id}' is gone, and was not reached")


def _steps(before: State, now: State, order: SentOrder) -> Iterator[Problem]:
    """Compare two states of one order: nothing comes back."""
    number = now.last_node_sequence_id
    known = order.released().get(number)
    if known and now.last_node_id and known[0] != now.last_node_id:
        yield _error(f"lastNodeId '{now.last_node_id}' is not the node {number} of the order")
    if before.order_update_id == now.order_update_id:
        old = {each.sequence_id for each in before.node_states}
        for each in now.node_states:
            if each.sequence_id not in old:
                yield _error(f"node '{each.node_id}' ({each.sequence_id}) was gone and is back")
    if number < before.last_node_sequence_id and now.last_node_id:
        yield _error(f"lastNodeSequenceId goes back from {before.last_node_sequence_id} to {number}")


def _error(text: str) -> Problem:
    return Rule.PROGRESS, Severity.ERROR, text
