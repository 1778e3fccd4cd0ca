"""Rules of order graphs that JSON Schema cannot express (VDA 5050 3.0 section 6.1.1)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise

from nena_shared.vda5050.order import Order


def violations(order: Order) -> tuple[str, ...]:
    """Return a sentence for each rule that ``order`` violates; empty for a valid graph (section 6.1.1)."""
    nodes, edges = len(order.nodes), len(order.edges)
    if not nodes:
        return ("nodes: an order has at least one node",)
    if edges != nodes - 1:
        # which edge joins which nodes is then unknown, so the other rules say nothing
        return (f"edges: {nodes} nodes require {nodes - 1} edges, but the order has {edges}",)
    return (*_sequence_violations(order), *_release_violations(order), *_action_violations(order))


def _sequence_violations(order: Order) -> Iterator[str]:
    first = order.nodes[0].sequence_id
    if first % 2:
        problem = f"node {order.nodes[0].node_id!r} has the odd sequenceId {first}; those of nodes are even"
        yield f"nodes.0.sequenceId: {problem}"
    for index, node in enumerate(order.nodes):
        if node.sequence_id != first + 2 * index:
            problem = f"node {node.node_id!r} has sequenceId {node.sequence_id}, not {first + 2 * index}"
            yield f"nodes.{index}.sequenceId: {problem}"
    for index, edge in enumerate(order.edges):
        if edge.sequence_id != first + 2 * index + 1:
            problem = f"edge {edge.edge_id!r} has sequenceId {edge.sequence_id}, not {first + 2 * index + 1}"
            yield f"edges.{index}.sequenceId: {problem}"


def _release_violations(order: Order) -> Iterator[str]:
    if not order.nodes[0].released:
        yield f"nodes.0.released: the first node {order.nodes[0].node_id!r} is not released"
    for index, ((start, end), edge) in enumerate(zip(pairwise(order.nodes), order.edges, strict=True)):
        if edge.released and not (start.released and end.released):
            yield f"edges.{index}.released: edge {edge.edge_id!r} is released, but not both of its nodes are"
        if end.released and not edge.released:
            yield f"nodes.{index + 1}.released: node {end.node_id!r} is released beyond the end of the base"


def _action_violations(order: Order) -> Iterator[str]:
    seen: set[str] = set()
    on_nodes = (action for node in order.nodes for action in node.actions)
    on_edges = (action for edge in order.edges for action in edge.actions)
    for action in chain(on_nodes, on_edges):
        if action.action_id in seen:
            yield f"actionId: {action.action_id!r} is used twice in the order"
        seen.add(action.action_id)
