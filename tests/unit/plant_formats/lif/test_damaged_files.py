"""Whatever a file holds: a plant model, or PlantModelError."""

from __future__ import annotations

import json
from contextlib import suppress
from copy import deepcopy
from datetime import UTC, datetime
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from nena_plant_formats import files, opentcs_xml
from nena_plant_formats.lif import LifVersion, read, write
from nena_shared.plant import PlantModelError
from support.examples import DAMAGED_FILES
from support.lif_files import (
    action,
    edge,
    lif_2_0_of,
    lif_of,
    node,
    robot_action,
    robot_edge,
    robot_node,
    use,
)
from support.plants import path, plant

NOW = datetime(2026, 11, 20, 10, 0, tzinfo=UTC)
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
WHOLE_2_0 = lif_2_0_of(
    robot_node(
        "A",
        0,
        0,
        "M.t M.u",
        theta=1,
        requiredActions=[robot_action("beep", actionParameters=[{"key": "k", "value": {"x": [1]}}])],
        forbiddenActionTypes=["drop"],
        allowedDeviationXY={"aMinimum": 0.1, "aMaximum": 0.5, "bMaximum": 0.2, "theta": 0.5},
        loadRestriction={"loaded": True, "unloaded": False},
    ),
    robot_node("B", 3, 4, "M.t M.u"),
    robot_edge(
        "A B",
        mobileRobotOrientations=[0, 3.14159],
        reachOrientationBeforeEntering=True,
        corridor={"maximumLeftWidth": 1, "maximumRightWidth": 2, "corridorReferencePoint": "CONTOUR"},
        physicalLineGuidedProperty={"direction": "LEFT", "length": 5},
        maximumSpeed=1,
    ),
    robot_edge("B A", feasibleActions=[robot_action("pick", blockingType="SINGLE")]),
    {"stationId": "S", "interactionNodeIds": ["A"], "stationType": "rack"},
)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**400),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from(["", "A", "B", "1e400", "NaN", "GLOBAL", "\u0000", "0.11.0", "1.0.0", "2.0.0", "2.1"]),
    st.sampled_from([[], {}, [[]], [{}], [1, 2, 3], {"x": 1e308, "y": -1e308}]),
)


def spots(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the ways to all that is in a JSON value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [way, *(spot for key, each in inside for spot in spots(each, (*way, key)))][bool(not way) :]


CHANGES = st.sampled_from([WHOLE, WHOLE_2_0]).flatmap(
    lambda whole: st.tuples(
        st.just(whole),
        st.lists(st.tuples(st.sampled_from(spots(json.loads(whole))), VALUES), min_size=1, max_size=3),
    )
)


@settings(max_examples=3 * DAMAGED_FILES)
@given(CHANGES, st.booleans())
def test_any_value_at_any_place(
    change: tuple[bytes, list[tuple[tuple[Any, ...], Any]]],
    strict: bool,  # noqa: FBT001 - drawn
) -> None:
    whole, changes = change
    content = json.loads(whole)
    for (*way, last), value in changes:
        place = content
        with suppress(KeyError, IndexError, TypeError):
            for key in way:
                place = place[key]
            place[last] = deepcopy(value)
    with suppress(PlantModelError):
        model = read(json.dumps(content).encode(), strict=strict).model
        again = opentcs_xml.read(opentcs_xml.write(model).data).model
        assert len(again.paths) == len(model.paths)
        for version in LifVersion:
            again = read(write(model, version, at=NOW).data).model
            assert len(again.points) == len(model.points)


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
    place[spot[-1]] = deepcopy(value)
    with suppress(PlantModelError):
        model = files.read(json.dumps(content).encode()).model
        assert sum(path.length_m for path in model.paths) >= 0
