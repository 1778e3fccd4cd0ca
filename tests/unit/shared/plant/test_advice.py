"""What makes robots wait for each other: dead ends, stations in the only way, long two-way tracks."""

from __future__ import annotations

import random
from typing import Any

import pytest
import rustworkx

from nena_shared.plant import PlantModel
from nena_shared.plant.advice import find_advice


def plant(ways: str, *, stations: str = "", parking: str = "", apart: int = 1000, **path: Any) -> PlantModel:
    """Return a plant with ways such as `AB` (both directions) and `A>B` (one way), points in a row."""
    names = sorted({letter for way in ways.split() for letter in way if letter != ">"})
    paths = []
    for way in ways.split():
        one, other = way[0], way[-1]
        both = {} if ">" in way else {"maxReverseVelocityMmS": 1000}
        ends = {"name": way, "source": one, "destination": other}
        paths.append({**ends, "lengthMm": apart, **both, **path})
    points = [
        {
            "name": each,
            "xMm": apart * at,
            "yMm": 0,
            "type": "PARK_POSITION" if each in parking else "HALT_POSITION",
        }
        for at, each in enumerate(names)
    ]
    types = [{"name": "Station", "allowedOperations": ["Load"]}, {"name": "Door", "allowedOperations": []}]
    locations = [
        {
            "name": f"at {each}",
            "type": "Station" if each.isupper() else "Door",
            "links": [{"point": each.upper()}],
        }
        for each in stations
    ]
    content = {
        "name": "hall",
        "points": points,
        "paths": paths,
        "locationTypes": types,
        "locations": locations,
    }
    return PlantModel.model_validate(content)


@pytest.mark.parametrize(
    ("model", "found"),
    [
        (plant("AB BC CA"), []),
        (plant("AB BC CA CD"), [("DEAD_END", "D")]),
        (plant("AB BC CA CD", parking="D"), []),
        (plant("AB BC CA CD", stations="D"), []),
        (plant("AB BC CA CD", stations="BD"), []),
        (plant("AB BC CA CD", stations="CD"), [("STATION_BLOCKS_WAY", "C")]),
        (plant("AB BC CA CD", stations="cD"), []),
        (plant("AB BC CA AD DB", stations="C"), []),
        (plant("AB BC CA CD DE EF FG GD"), []),
        (plant("A>B B>C C>A CD DE EF F>G G>H H>F", apart=5000), [("NO_PASSING_PLACE", "DE")]),
        (plant("A>B B>C C>A CD DE EF F>G G>H H>F", apart=4000), []),
        (plant("A>B B>C C>A C>D D>E E>F F>G G>H H>F", apart=5000), []),
        (plant("A>B B>C C>A CD DE EF F>G G>H H>F DI", parking="I", apart=5000), [("NO_PASSING_PLACE", "DI")]),
        (plant("AB BC CA CD", parking="D", apart=5000), [("NO_PASSING_PLACE", "AB")]),
        (plant("AB BC CA CD", locked=True), []),
    ],
)
def test_advice(model: PlantModel, found: list[tuple[str, str]]) -> None:
    assert [(each.code, each.name) for each in find_advice(model)] == found


def test_the_way_is_named_with_its_length() -> None:
    (problem,) = find_advice(plant("A>B B>C C>A CD DE EF F>G G>H H>F", apart=5000))
    assert problem.text.startswith(
        "robots use the 15 m from 'C' to 'F' in one direction at a time: make them one-way"
    )


@pytest.mark.parametrize("seed", range(60))
def test_stations_block_the_way_where_the_plant_falls_apart_without_them(seed: int) -> None:
    rng = random.Random(seed)
    letters = "ABCDEFGHIJ"
    pairs = {tuple(sorted(rng.sample(letters, 2))) for _ in range(rng.randint(3, 16))}
    graph = rustworkx.PyGraph(multigraph=False)
    graph.add_nodes_from(letters)
    graph.add_edges_from([(letters.index(a), letters.index(b), None) for a, b in pairs])
    wanted = {letters[at] for at in rustworkx.articulation_points(graph)}
    used = "".join(sorted({each for pair in pairs for each in pair}))
    model = plant(" ".join(a + b for a, b in pairs), stations=used)
    assert {each.name for each in find_advice(model) if each.code == "STATION_BLOCKS_WAY"} == wanted
