"""Rules of the order graph (VDA 5050 3.0 section 6.1.1): an example each, and every mutation is found."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.vda5050.action import Action, BlockingType
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.order import Edge, Node, Order

BEEP = Action(action_type="beep", action_id="twice", blocking_type=BlockingType.NONE)


HEADER = Header(
    header_id=0,
    timestamp=datetime(2026, 1, 1, tzinfo=UTC),
    version="3.0.0",
    manufacturer="ACME",
    serial_number="0001",
)


def graph(releases: str) -> Order:
    """Make an order of node, edge, node, ...: ``+`` stands for a released one, ``-`` for the horizon."""
    return Order(
        **dict(HEADER),
        order_id="o1",
        order_update_id=0,
        nodes=tuple(
            Node(node_id=f"n{2 * index}", sequence_id=2 * index, released=each == "+", actions=())
            for index, each in enumerate(releases[::2])
        ),
        edges=tuple(
            Edge(edge_id=f"e{2 * index + 1}", sequence_id=2 * index + 1, released=each == "+", actions=())
            for index, each in enumerate(releases[1::2])
        ),
    )


def change_node(order: Order, index: int, **changes: object) -> Order:
    nodes = list(order.nodes)
    nodes[index] = nodes[index].model_copy(update=changes)
    return order.model_copy(update={"nodes": tuple(nodes)})


def change_edge(order: Order, index: int, **changes: object) -> Order:
    edges = list(order.edges)
    edges[index] = edges[index].model_copy(update=changes)
    return order.model_copy(update={"edges": tuple(edges)})


VALID = {
    "one node": graph("+"),
    "base only": graph("+++"),
    "horizon only behind the first node": graph("+--"),
    "base and horizon": graph("+++--"),
    "a node that comes twice": change_node(graph("+++"), 1, node_id="n0"),
    "an update that starts anywhere even": change_node(graph("+"), 0, sequence_id=14),
}


@pytest.mark.clause("6.1.1")
@pytest.mark.parametrize("order", VALID.values(), ids=VALID)
def test_valid_graphs(order: Order) -> None:
    assert violations(order) == ()


@pytest.mark.clause("6.1.1")
@pytest.mark.parametrize(
    ("order", "violation"),
    [
        (graph(""), "nodes: an order has at least one node"),
        (
            graph("+++").model_copy(update={"edges": graph("+++").edges * 2}),
            "edges: 2 nodes require 1 edges, but the order has 2",
        ),
        (
            change_node(graph("+"), 0, sequence_id=1),
            "nodes.0.sequenceId: node 'n0' has the odd sequenceId 1; those of nodes are even",
        ),
        (
            change_node(graph("+++"), 1, sequence_id=4),
            "nodes.1.sequenceId: node 'n2' has sequenceId 4, not 2",
        ),
        (
            change_edge(graph("+++"), 0, sequence_id=3),
            "edges.0.sequenceId: edge 'e1' has sequenceId 3, not 1",
        ),
        (graph("-"), "nodes.0.released: the first node 'n0' is not released"),
        (graph("++-"), "edges.0.released: edge 'e1' is released, but not both of its nodes are"),
        (graph("+--++"), "edges.1.released: edge 'e3' is released, but not both of its nodes are"),
        (graph("+-+"), "nodes.1.released: node 'n2' is released beyond the end of the base"),
    ],
)
def test_a_broken_rule_is_named(order: Order, violation: str) -> None:
    assert violations(order) == (violation,)


@pytest.mark.clause("6.1.1/ids")
@pytest.mark.parametrize("where", ["node and node", "node and edge", "one node"])
def test_action_ids_are_unique(where: str) -> None:
    order = change_node(graph("+++"), 0, actions=(BEEP, BEEP) if where == "one node" else (BEEP,))
    if where == "node and node":
        order = change_node(order, 1, actions=(BEEP,))
    if where == "node and edge":
        order = change_edge(order, 0, actions=(BEEP,))

    assert violations(order) == ("actionId: 'twice' is used twice in the order",)


@st.composite
def valid_graphs(draw: st.DrawFn, least_nodes: int = 1) -> Order:
    """Draw graphs of a base and perhaps a horizon, from any even number on, with an action each."""
    nodes = draw(st.integers(least_nodes, 6))
    base = draw(st.integers(1, nodes))
    first = 2 * draw(st.integers(0, 5))
    order = graph("+" * (2 * base - 1) + "-" * (2 * (nodes - base)))
    return order.model_copy(
        update={
            name: tuple(
                part.model_copy(update={"sequence_id": part.sequence_id + first, "actions": (own(part),)})
                for part in parts
            )
            for name, parts in (("nodes", order.nodes), ("edges", order.edges))
        }
    )


def own(part: Node | Edge) -> Action:
    return BEEP.model_copy(update={"action_id": f"at {part.sequence_id}"})


@pytest.mark.clause("6.1.1")
@given(valid_graphs())
def test_generated_graphs_keep_all_rules(order: Order) -> None:
    assert violations(order) == ()


def _shift_all_by_one(order: Order) -> Order:
    nodes = [node.model_copy(update={"sequence_id": node.sequence_id + 1}) for node in order.nodes]
    edges = [edge.model_copy(update={"sequence_id": edge.sequence_id + 1}) for edge in order.edges]
    return order.model_copy(update={"nodes": tuple(nodes), "edges": tuple(edges)})


MUTATIONS: dict[str, Callable[[Order], Order]] = {
    "drop an edge": lambda order: order.model_copy(update={"edges": order.edges[1:]}),
    "swap the nodes": lambda order: order.model_copy(update={"nodes": order.nodes[::-1]}),
    "take back the first node": lambda order: change_node(order, 0, released=False),
    "flip the last edge": lambda order: change_edge(order, -1, released=not order.edges[-1].released),
    "shift the last node": lambda order: change_node(order, -1, sequence_id=order.nodes[-1].sequence_id + 2),
    "shift all by one": _shift_all_by_one,
    "repeat an action": lambda order: change_node(
        change_node(order, 0, actions=(BEEP,)), -1, actions=(BEEP,)
    ),
}


@pytest.mark.clause("6.1.1")
@pytest.mark.parametrize("mutate", MUTATIONS.values(), ids=MUTATIONS)
@given(order=valid_graphs(least_nodes=2))
def test_each_mutation_of_a_valid_graph_is_found(mutate: Callable[[Order], Order], order: Order) -> None:
    assert violations(mutate(order)) != ()
