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


@pytest.mark.clause("6.1.1")
@pytest.mark.parametrize(
    "releases",
    ["+", "+++", "+--", "+++--"],
    ids=["one node", "base only", "horizon only behind the first node", "base and horizon"],
)
def test_valid_graphs(releases: str) -> None:
    assert violations(graph(releases)) == ()


@pytest.mark.clause("6.1.1")
def test_a_node_may_come_twice() -> None:
    assert violations(change_node(graph("+++"), 1, node_id="n0")) == ()


@pytest.mark.clause("6.1.1")
def test_no_nodes() -> None:
    assert violations(graph("")) == ("an order has at least one node",)


@pytest.mark.clause("6.1.1")
def test_number_of_edges() -> None:
    order = graph("+++")

    assert violations(order.model_copy(update={"edges": order.edges * 2})) == (
        "2 nodes require 1 edges, but the order has 2",
    )


@pytest.mark.clause("6.1.1")
def test_nodes_are_even() -> None:
    order = change_node(graph("+"), 0, sequence_id=1)

    assert violations(order) == ("node 'n0' has the odd sequenceId 1; sequenceIds of nodes are even",)


@pytest.mark.clause("6.1.1")
def test_an_update_starts_anywhere_even() -> None:
    assert violations(change_node(graph("+"), 0, sequence_id=14)) == ()


@pytest.mark.clause("6.1.1")
def test_gap_at_a_node() -> None:
    order = change_node(graph("+++"), 1, sequence_id=4)

    assert violations(order) == ("node 'n2' has sequenceId 4, not 2",)


@pytest.mark.clause("6.1.1")
def test_gap_at_an_edge() -> None:
    order = change_edge(graph("+++"), 0, sequence_id=3)

    assert violations(order) == ("edge 'e1' has sequenceId 3, not 1",)


@pytest.mark.clause("6.1.1")
def test_first_node_is_released() -> None:
    assert violations(graph("-")) == ("the first node 'n0' is not released",)


@pytest.mark.clause("6.1.1")
def test_released_edge_needs_released_ends() -> None:
    assert violations(graph("++-")) == ("edge 'e1' is released, but not both of its nodes are",)


@pytest.mark.clause("6.1.1")
def test_nothing_is_released_behind_the_base() -> None:
    assert violations(graph("+--++")) == ("edge 'e3' is released, but not both of its nodes are",)
    assert violations(graph("+-+")) == ("node 'n2' is released beyond the end of the base",)


@pytest.mark.clause("6.1.1/ids")
@pytest.mark.parametrize("where", ["node and node", "node and edge", "one node"])
def test_action_ids_are_unique(where: str) -> None:
    order = change_node(graph("+++"), 0, actions=(BEEP, BEEP) if where == "one node" else (BEEP,))
    if where == "node and node":
        order = change_node(order, 1, actions=(BEEP,))
    if where == "node and edge":
        order = change_edge(order, 0, actions=(BEEP,))

    assert violations(order) == ("actionId 'twice' is used twice in the order",)


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


def _drop_an_edge(order: Order) -> Order:
    return order.model_copy(update={"edges": order.edges[1:]})


def _swap_nodes(order: Order) -> Order:
    return order.model_copy(update={"nodes": order.nodes[::-1]})


def _take_back_the_first_node(order: Order) -> Order:
    return change_node(order, 0, released=False)


def _flip_the_last_edge(order: Order) -> Order:
    return change_edge(order, -1, released=not order.edges[-1].released)


def _shift_the_last_node(order: Order) -> Order:
    return change_node(order, -1, sequence_id=order.nodes[-1].sequence_id + 2)


def _shift_all_by_one(order: Order) -> Order:
    nodes = [node.model_copy(update={"sequence_id": node.sequence_id + 1}) for node in order.nodes]
    edges = [edge.model_copy(update={"sequence_id": edge.sequence_id + 1}) for edge in order.edges]
    return order.model_copy(update={"nodes": tuple(nodes), "edges": tuple(edges)})


def _repeat_an_action(order: Order) -> Order:
    return change_node(change_node(order, 0, actions=(BEEP,)), -1, actions=(BEEP,))


MUTATIONS: list[Callable[[Order], Order]] = [
    _drop_an_edge,
    _swap_nodes,
    _take_back_the_first_node,
    _flip_the_last_edge,
    _shift_the_last_node,
    _shift_all_by_one,
    _repeat_an_action,
]


@pytest.mark.clause("6.1.1")
@pytest.mark.parametrize("mutate", MUTATIONS)
@given(order=valid_graphs(least_nodes=2))
def test_each_mutation_of_a_valid_graph_is_found(mutate: Callable[[Order], Order], order: Order) -> None:
    assert violations(mutate(order)) != ()
