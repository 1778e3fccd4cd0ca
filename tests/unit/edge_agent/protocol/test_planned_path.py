"""The planned path covers the base, and nothing of the horizon."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.planned_path import planned_path
from nena_edge_agent.protocol.rules import RULES
from support.robot_core import Bench, order

pytestmark = pytest.mark.clause("6.6.2/path")


def test_it_leads_over_the_nodes_of_the_base() -> None:
    nodes = order("n0", "n1", "n2", "n3", released=3).nodes

    path = planned_path(nodes[0], nodes[1:])

    assert path is not None
    assert [point.x for point in path.trajectory.control_points] == [0.0, 10.0, 20.0]
    assert path.trajectory.degree == 1
    assert path.trajectory.knot_vector == (0.0, 0.0, 0.5, 1.0, 1.0)
    assert path.traversed_nodes == ("n1", "n2")


def test_without_a_base_ahead_there_is_none() -> None:
    nodes = order("n0", "n1", released=1).nodes

    assert planned_path(nodes[0], nodes[1:]) is None
    assert planned_path(None, ()) is None


def test_it_becomes_shorter_as_the_robot_drives() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1", "n2"))
    bench.arrive()

    path = bench.state.planned_path
    assert path is not None
    assert path.traversed_nodes == ("n2",)
    bench.arrive()
    assert bench.state.planned_path is None
