"""(f) What a plant of 10,000 points costs: to load it, and to find a way through it.

Seconds of CPU beside a bare parse of the same file, and milliseconds for each way beside a bare search of the
graph library over the same edges.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from datetime import UTC, datetime
from time import perf_counter, process_time
from typing import Any
from xml.etree.ElementTree import fromstring

import rustworkx as rx

from bench.figures import Figures, milliseconds
from nena_order_service.routing.router import Router
from nena_shared.plant import PlantModel, lif, opentcs_xml
from nena_shared.plant.files import read_nena
from support.plants import grid_plant

SIDE = 100
ROUTES = 200
ROUNDS = 3


def measure() -> dict[str, Any]:
    """Measure loading and routing on a grid of 100 by 100 points."""
    plant = grid_plant(SIDE, SIDE)
    return {"points": len(plant.points), "paths": len(plant.paths), **_loading(plant), **_routing(plant)}


def _loading(plant: PlantModel) -> dict[str, float]:
    xml = opentcs_xml.write(plant).data
    own = plant.to_json().encode()
    layout = lif.write(plant, at=datetime.now(UTC)).data
    return {
        "xml_mb": round(len(xml) / 1e6, 1),
        "load_xml_s": _least(lambda: opentcs_xml.read(xml)),
        "yardstick_parse_xml_s": _least(lambda: fromstring(xml)),  # noqa: S314 - written above
        "load_lif_s": _least(lambda: lif.read(layout)),
        "yardstick_parse_lif_s": _least(lambda: json.loads(layout)),
        "load_json_s": _least(lambda: read_nena(own)),
        "yardstick_parse_json_s": _least(lambda: json.loads(own)),
    }


def _least(work: Callable[[], object]) -> float:
    costs = []
    for _ in range(ROUNDS):
        start = process_time()
        work()
        costs.append(process_time() - start)
    return round(min(costs), 3)


def _routing(plant: PlantModel) -> dict[str, float | Figures]:
    chance = random.Random(1)
    names = [point.name for point in plant.points]
    pairs = [(chance.choice(names), chance.choice(names)) for _ in range(ROUTES)]
    avoid = frozenset({names[SIDE * SIDE // 2]})
    router = Router(plant)
    start = perf_counter()
    router.route(*pairs[0])
    first = perf_counter() - start
    bare = _bare_search(plant)
    return {
        "graph_built_s": round(first, 3),
        "route": _timed(router.route, pairs),
        "route_with_a_point_to_avoid": _timed(lambda a, b: router.route(a, b, avoid=avoid), pairs),
        "yardstick_search": _timed(bare, pairs),
    }


def _bare_search(plant: PlantModel) -> Callable[[str, str], object]:
    graph: rx.PyDiGraph[str, float] = rx.PyDiGraph()
    indices = dict(zip(plant.points_by_name, graph.add_nodes_from(list(plant.points_by_name)), strict=True))
    graph.add_edges_from(
        [(indices[each.source], indices[each.destination], float(each.length_mm)) for each in plant.paths]
    )

    def search(source: str, destination: str) -> object:
        return rx.digraph_dijkstra_shortest_paths(
            graph, indices[source], target=indices[destination], weight_fn=float
        )

    return search


def _timed(work: Callable[[str, str], object], pairs: list[tuple[str, str]]) -> Figures:
    durations = []
    for source, destination in pairs:
        start = perf_counter()
        work(source, destination)
        durations.append(perf_counter() - start)
    return milliseconds(durations)
