"""The benchmark's plants by lot are like the site that they were modelled on."""

from __future__ import annotations

import pytest
import rustworkx

from bench.sites import site


@pytest.mark.parametrize("seed", range(1, 4))
def test_sites_have_the_bridges_and_dead_ends_of_a_real_one(seed: int) -> None:
    hall = site(seed)
    graph: rustworkx.PyGraph[str, None] = rustworkx.PyGraph(multigraph=False)
    node = {point.name: graph.add_node(point.name) for point in hall.plant.points}
    for path in hall.plant.paths:
        graph.add_edge(node[path.source], node[path.destination], None)
    dead_ends = {graph[index] for index in graph.node_indices() if graph.degree(index) == 1}

    assert (graph.num_nodes(), graph.num_edges(), len(hall.plant.paths)) == (253, 255, 510)
    assert rustworkx.is_connected(graph)
    assert len(rustworkx.bridges(graph)) == 153
    assert 35 <= len(dead_ends) <= 38
    assert set(hall.station_points.values()) == dead_ends


def test_the_same_seed_draws_the_same_site_of_any_size() -> None:
    assert site.__wrapped__(7, 60).plant == site(7, 60).plant
    assert site(7, 60).plant != site(8, 60).plant
    assert len(site(7, 60).plant.points) == 60
