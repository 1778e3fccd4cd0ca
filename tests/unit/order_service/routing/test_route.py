from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.routing.graph import Route, Step
from nena_shared.plant import DirectedEdge, Orientation
from support.plants import path

LENGTHS = st.lists(st.integers(1, 10_000), max_size=6)


def route(lengths: list[int]) -> Route:
    """Drive along a chain of paths of these lengths, each for half of its millimetres."""
    edges = [
        DirectedEdge(path(f"{number} {number + 1}", length), Orientation.FORWARD)
        for number, length in enumerate(lengths)
    ]
    return Route("0", str(len(lengths)), tuple(Step(each, each.path.length_mm / 2) for each in edges))


@given(LENGTHS)
def test_cost_and_length_are_those_of_all_steps(lengths: list[int]) -> None:
    found = route(lengths)

    assert found.cost == pytest.approx(sum(lengths) / 2)
    assert found.length_m == pytest.approx(sum(lengths) / 1000)


@given(LENGTHS)
def test_it_passes_every_point_from_its_source_to_its_destination(lengths: list[int]) -> None:
    found = route(lengths)

    assert found.points == tuple(map(str, range(len(lengths) + 1)))
    assert (found.points[0], found.points[-1]) == (found.source, found.destination)


def test_a_step_is_its_edge() -> None:
    (step,) = route([700]).steps

    assert (step.source, step.destination, step.orientation) == ("0", "1", Orientation.FORWARD)
    assert (step.path.name, step.edge_id) == ("0 --- 1", step.edge.id)
