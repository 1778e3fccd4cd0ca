"""Nodes and edges in the states of a robot: they go in their order, and none comes back (section 6.6.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nena_cli.vda5050.finding import Rule, Severity
from nena_cli.vda5050.header_checks import Problem
from nena_cli.vda5050.order_checks import Base
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State


def progress_problems(before: State | None, now: State, base: Base) -> Iterator[Problem]:
    """Compare a state with the one before it; both are about the order that ``base`` is of."""
    known = {node.sequence_id: node.node_id for node in (*base.nodes.values(), *base.last.nodes)}
    for each in now.node_states:
        if known.get(each.sequence_id) != each.node_id:
            text = f"node '{each.node_id}' ({each.sequence_id}) is none of the order"
            yield Rule.PROGRESS, Severity.ERROR, text
    yield from _gaps([each.sequence_id for each in now.node_states], "nodeStates")
    yield from _gaps([each.sequence_id for each in now.edge_states], "edgeStates")
    if not now.node_states:
        return  # the robot may be put elsewhere, and be told so
    if known.get(now.last_node_sequence_id) not in (now.last_node_id, None) and now.last_node_id:
        text = f"lastNodeId '{now.last_node_id}' is not the node {now.last_node_sequence_id} of the order"
        yield Rule.PROGRESS, Severity.ERROR, text
    if before and before.order_id == now.order_id:
        yield from _steps(before, now, base.last)


def _gaps(numbers: Sequence[int], what: str) -> Iterator[Problem]:
    if list(numbers) != sorted(set(numbers)):
        yield Rule.PROGRESS, Severity.ERROR, f"the sequenceIds of {what} do not rise: {numbers}"


def _steps(before: State, now: State, order: Order) -> Iterator[Problem]:
    """Look for what came back, and for nodes that were left out."""
    if before.order_update_id == now.order_update_id:
        old = {each.sequence_id for each in before.node_states}
        for each in now.node_states:
            if each.sequence_id not in old:
                text = f"node '{each.node_id}' ({each.sequence_id}) was gone and is back"
                yield Rule.PROGRESS, Severity.ERROR, text
    if now.last_node_sequence_id < before.last_node_sequence_id and now.last_node_id:
        text = (
            f"lastNodeSequenceId goes back from {before.last_node_sequence_id} to {now.last_node_sequence_id}"
        )
        yield Rule.PROGRESS, Severity.ERROR, text
    left = [each.sequence_id for each in now.node_states]
    ahead = min(left, default=None)
    if ahead is not None and now.last_node_id and ahead > now.last_node_sequence_id + 2:
        skipped = f"{now.last_node_sequence_id + 2} to {ahead - 2}"
        text = f"nodes {skipped} of order '{order.order_id}' are gone, and none of them was reached"
        yield Rule.PROGRESS, Severity.ERROR, text
