"""The planned path covers the base, and nothing of the horizon."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.base_way import BaseWay
from nena_edge_agent.protocol.rules import RULES
from support.robot_core import Bench, order

pytestmark = pytest.mark.clause("6.6.2/path")


def test_it_leads_over_the_nodes_of_the_base() -> None:
    nodes = order("n0", "n1", "n2", "n3", released=3).nodes

    path = BaseWay(nodes[1:]).path(nodes[0], 2)

    assert path is not None
    assert [point.x for point in path.trajectory.control_points] == [0.0, 10.0, 20.0]
    assert path.trajectory.degree == 1
    assert path.trajectory.knot_vector == (0.0, 0.0, 0.5, 1.0, 1.0)
    assert path.traversed_nodes == ("n1", "n2")


def test_without_a_base_ahead_there_is_none() -> None:
    nodes = order("n0", "n1", released=1).nodes

    assert BaseWay(nodes[1:]).path(nodes[0], 2) is None
    assert BaseWay().path(None, 0) is None


def test_it_becomes_shorter_as_the_robot_drives() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1", "n2"))
    bench.arrive()

    path = bench.state.planned_path
    assert path is not None
    assert path.traversed_nodes == ("n2",)
    bench.arrive()
    assert bench.state.planned_path is None


def test_the_way_that_is_left_is_measured_from_each_node() -> None:
    way = BaseWay(order("n0", "n1", "n2", "n3", released=3).nodes[1:])

    assert [way.length_from(number) for number in (2, 4, 6, 99)] == [10.0, 0.0, 0.0, 0.0]
