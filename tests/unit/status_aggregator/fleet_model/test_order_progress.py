from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from nena_status_aggregator.fleet_model.order_progress import OrderProgress
from support.fleet_briefs import state
from support.fleet_examples import way


def follow(progress: OrderProgress, **fields: Any) -> float:
    progress.follow(state(**fields))
    return progress.percent


def test_nodes_left_against_nodes_at_acceptance() -> None:
    progress = OrderProgress()
    assert follow(progress, order_id="o", **way("B", "C", "D", "E")) == 0
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4)) == 25
    assert follow(progress, order_id="o", last_node_sequence_id=8) == 100


def test_an_aggregator_started_in_mid_order_knows_the_whole() -> None:
    assert follow(OrderProgress(), order_id="o", last_node_sequence_id=6, **way("E", first=8)) == 75


def test_an_extended_base_makes_the_order_longer() -> None:
    progress = OrderProgress()
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", first=4)) == 50
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4)) == 25


def test_a_cancelled_order_stays_where_it_was() -> None:
    progress = OrderProgress()
    follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4))
    assert follow(progress, order_id="o", last_node_sequence_id=2) == 25


def test_the_next_order_begins_anew() -> None:
    progress = OrderProgress()
    follow(progress, order_id="o", last_node_sequence_id=8)
    assert follow(progress, order_id="p", **way("B", "C")) == 0


def test_an_order_of_one_node_has_nothing_to_drive() -> None:
    assert follow(OrderProgress(), order_id="o") == 100


def test_a_robot_that_lists_its_first_node_too_is_not_below_zero() -> None:
    assert follow(OrderProgress(), order_id="o", **way("A", "B", first=0)) == 0


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 6), st.integers(0, 40), st.sampled_from("op"))),
)
def test_always_between_0_and_100(states: list[tuple[int, int, int, str]]) -> None:
    progress = OrderProgress()
    for first, count, last, order_id in states:
        nodes = way(*[f"n{each}" for each in range(count)], first=2 * first)
        if first:
            percent = follow(progress, order_id=order_id, last_node_sequence_id=last, **nodes)
            assert 0 <= percent <= 100
