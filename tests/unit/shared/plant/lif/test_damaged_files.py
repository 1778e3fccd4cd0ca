"""Whatever a file holds: a plant model, or PlantModelError."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.plant import PlantModelError, files, opentcs_xml
from nena_shared.plant.lif import read
from support.examples import DAMAGED_FILES
from support.lif_files import action, edge, lif_of, node, use
from support.plants import path, plant

WHOLE = lif_of(
    node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "theta": 1, "actions": [action("pick")]}]),
    node("B", 3, 4),
    edge(
        "A B",
        use(
            trajectory={
                "degree": 2,
                "knotVector": [0, 0, 0, 1, 1, 1],
                "controlPoints": [{"x": 0, "y": 0}, {"x": 1, "y": 2, "weight": 2}, {"x": 3, "y": 4}],
            },
            loadRestriction={"loaded": True, "unloaded": False},
            maxSpeed=1,
        ),
    ),
    edge("B A"),
    {"stationId": "S", "interactionNodeIds": ["A"], "stationPosition": {"x": 1, "y": 2}, "stationHeight": 1},
)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**400),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from(["", "A", "B", "1e400", "NaN", "GLOBAL", "\u0000", "0.11.0", "1.0.0"]),
    st.sampled_from([[], {}, [[]], [{}], [1, 2, 3], {"x": 1e308, "y": -1e308}]),
)


def spots(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the ways to all that is in a JSON value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [way, *(spot for key, each in inside for spot in spots(each, (*way, key)))][bool(not way) :]


SPOTS = spots(json.loads(WHOLE))


@settings(max_examples=3 * DAMAGED_FILES)
@given(st.lists(st.tuples(st.sampled_from(SPOTS), VALUES), min_size=1, max_size=3), st.booleans())
def test_any_value_at_any_place(changes: list[tuple[tuple[Any, ...], Any]], strict: bool) -> None:  # noqa: FBT001 - drawn
    content = json.loads(WHOLE)
    for (*way, last), value in changes:
        place = content
        with suppress(KeyError, IndexError, TypeError):
            for key in way:
                place = place[key]
            place[last] = value
    with suppress(PlantModelError):
        model = read(json.dumps(content).encode(), strict=strict).model
        again = opentcs_xml.read(opentcs_xml.write(model).data).model
        assert len(again.paths) == len(model.paths)


@settings(max_examples=DAMAGED_FILES)
@given(st.binary(max_size=60))
def test_any_bytes(data: bytes) -> None:
    with suppress(PlantModelError):
        files.read(data)


OWN = json.loads(plant(path("A B"), path("B A")).to_json())
OWN_SPOTS = spots(OWN)


@settings(max_examples=DAMAGED_FILES)
@given(st.sampled_from(OWN_SPOTS), VALUES)
def test_any_value_in_own_json(spot: tuple[Any, ...], value: Any) -> None:
    content = json.loads(json.dumps(OWN))
    place = content
    for key in spot[:-1]:
        place = place[key]
    place[spot[-1]] = value
    with suppress(PlantModelError):
        model = files.read(json.dumps(content).encode()).model
        assert sum(path.length_m for path in model.paths) >= 0
