"""A layout of 10,000 nodes is loaded in time that grows with its size only; `make bench` has figures."""

from __future__ import annotations

import json
from math import pi
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_plant_formats.exchange import JsonLimits
from nena_plant_formats.lif import read
from nena_plant_formats.lif.document import Station, StationPosition
from nena_plant_formats.lif.reader import Names, StationMaker
from nena_shared.plant import ConnectionType, PlantModel, PlantModelError
from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.model import NO_OPERATION
from nena_shared.plant.track import PlantBlockingType, Point, TypeAction, VehicleTypeAtPoint
from support.lif_files import action, edge, layout, lif, lif_of, node, use
from support.plants import point

RING = (node("A"), node("B", 3, 4), edge("A B"), edge("B A"))
NO_PARKING = "NO_PARK_POSITION"
"""LIF has no parking positions, so each of its plants gets this warning."""


def model_of(*parts: dict[str, Any]) -> PlantModel:
    return read(lif_of(*parts)).model


def warnings(data: bytes) -> set[tuple[str, str]]:
    found = read(data).warnings
    return {(problem.code, problem.name) for problem in found} - {(NO_PARKING, "plant")}


def texts(data: bytes) -> str:
    return "\n".join(map(str, read(data).warnings))


def refusals(data: bytes, *, strict: bool = False) -> set[tuple[str, str]]:
    with pytest.raises(PlantModelError) as caught:
        read(data, strict=strict)
    return {(problem.code, problem.name) for problem in caught.value.problems}


def test_a_right_file_is_read_strictly_and_without_a_warning() -> None:
    report = read(lif_of(*RING), strict=True)
    assert {problem.code for problem in report.warnings} == {NO_PARKING}
    model = report.model
    assert model.name == "plant"
    point = model.point("B")
    assert (point.x_mm, point.y_mm, point.map_id, point.heading_rad) == (3000, 4000, "m", None)
    path = model.path("A-B")
    assert (path.source, path.destination, path.length_mm) == ("A", "B", 5000)
    assert PlantModel.from_json(model.to_json()) == model


def test_heading_applies_to_all_only_if_all_types_agree() -> None:
    one, other = {"vehicleTypeId": "t", "theta": pi / 2}, {"vehicleTypeId": "u", "theta": 0.0}
    alone = model_of(node("A", vehicleTypeNodeProperties=[one]))
    assert alone.point("A").heading_rad == pytest.approx(pi / 2)
    both = model_of(node("A", vehicleTypeNodeProperties=[one, other]))
    assert both.point("A").orientation_deg is None
    assert [each.theta for each in both.point("A").vehicle_types] == [pi / 2, 0.0]


def test_a_path_is_as_fast_as_the_fastest_type_and_open_to_those_named() -> None:
    slow, fast = use("t", maxSpeed=0.5), use("u", maxSpeed=1.5)
    path = model_of(node("A", 0, 0, "t", "u"), node("B", 1, 0, "t", "u"), edge("A B", slow, fast)).path("A-B")
    assert path.max_velocity_mm_s == 1500
    assert (path.is_open_to("t"), path.is_open_to("u"), path.is_open_to("v")) == (True, True, False)
    assert model_of(*RING).path("A-B").max_velocity_mm_s == 100_000


def test_station_has_the_operations_of_its_nodes() -> None:
    picks = [{"vehicleTypeId": "t", "actions": [action("pick"), action("startCharging")]}]
    station = {"stationId": "S", "interactionNodeIds": ["A", "B"], "stationHeight": 1.5}
    model = model_of(node("A", vehicleTypeNodeProperties=picks), node("B", 4, 2), station)
    assert model.access_points("S", "pick") == ("A",)
    assert model.access_points("S", "Charge") == ("A",)
    assert model.access_points("S", "NOP") == ("A", "B")
    location = model.location("S")
    assert (location.x_mm, location.y_mm) == (2000, 1000)
    assert location.properties["lif:stationHeight"] == "1.5"


def test_a_station_is_where_the_file_has_it() -> None:
    place = {"x": -1, "y": 2.5, "theta": 0}
    station = {"stationId": "S", "interactionNodeIds": ["A"], "stationPosition": place}
    location = model_of(node("A"), station).location("S")
    assert (location.x_mm, location.y_mm) == (-1000, 2500)


def test_nodes_keep_their_ids_where_other_kinds_have_them_too() -> None:
    station = {"stationId": "A", "interactionNodeIds": ["A"]}
    data = lif_of(node("A"), node("A-B"), node("B"), edge("A B"), edge("B A"), station)
    assert {("RENAMED", "A"), ("RENAMED", "A-B")} <= warnings(data)
    model = read(data).model
    assert model.path("edge:A-B").properties["lif:id"] == "A-B"
    assert model.location("station:A").links[0].point == "A"


def test_two_layouts_are_two_layers_with_ways_between() -> None:
    lower = layout(node("A"), edge("A B"), layoutName="Ground", layoutLevelId="0")
    upper = layout(node("B", 0, 0, mapId="n"), edge("B A"), layoutId="up")
    model = read(lif(lower, upper), strict=True).model
    assert [layer.name for layer in model.visual_layout.layers] == ["Ground", "up"]
    assert [point.layout.layer_id for point in model.points] == [0, 1]
    assert [point.map_id for point in model.points] == ["m", "n"]
    assert model.path("A-B").length_mm == 1


def test_a_cubic_bezier_curve_is_driven_and_drawn_as_one() -> None:
    places = [(0, 0), (0, 2), (2, 4), (4, 4)]
    trajectory = {
        "degree": 3,
        "knotVector": [0, 0, 0, 0, 1, 1, 1, 1],
        "controlPoints": [{"x": x, "y": y} for x, y in places],
    }
    path = model_of(node("A"), node("B", 4, 4), edge("A B", use(trajectory=trajectory))).path("A-B")
    assert path.layout.connection_type is ConnectionType.BEZIER
    assert [(each.x_mm, each.y_mm) for each in path.layout.control_points] == [(0, 2000), (2000, 4000)]
    assert 5657 < path.length_mm < 8000


def test_a_quarter_circle_has_its_length() -> None:
    trajectory = {
        "degree": 2,
        "knotVector": [0, 0, 0, 1, 1, 1],
        "controlPoints": [{"x": 1, "y": 0}, {"x": 1, "y": 1, "weight": 0.5**0.5}, {"x": 0, "y": 1}],
    }
    parts = (node("A", 1, 0), node("B", 0, 1), edge("A B", use(trajectory=trajectory)))
    path = read(lif_of(*parts), strict=True).model.path("A-B")
    assert path.length_mm == pytest.approx(1000 * pi / 2, abs=1)
    assert path.layout.connection_type is ConnectionType.POLYPATH


KNOT_FAULTS = [[0, 1], [0, 1, 0, 1], [0.5, 0.5, 0.5, 0.5]]


@pytest.mark.parametrize("knots", KNOT_FAULTS)
def test_invalid_trajectory_is_omitted(knots: list[float]) -> None:
    trajectory = {"knotVector": knots, "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": 4}]}
    data = lif_of(node("A"), node("B", 3, 4), edge("A B", use(trajectory=trajectory)), edge("B A"))
    assert ("NOT_LIF", "A-B") in warnings(data)
    (only,) = read(data).model.path("A-B").vehicle_types
    assert only.trajectory is None
    assert ("NOT_LIF", "A-B") in refusals(data, strict=True)


def test_knots_above_one_are_scaled() -> None:
    trajectory = {"knotVector": [0, 0, 9, 9], "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": 4}]}
    data = lif_of(node("A"), node("B", 3, 4), edge("A B", use(trajectory=trajectory)), edge("B A"))
    kept = read(data).model.path("A-B").vehicle_types[0].trajectory
    assert kept is not None
    assert list(kept.knot_vector) == [0, 0, 1, 1]
    assert "scaled" in texts(data)


def _without(key: str) -> bytes:
    whole = layout(*RING)
    del whole[key]
    return lif(whole)


DEPARTURES = {
    "no stations": (_without("stations"), "stations: is missing"),
    "number as text": (lif_of(node("A"), node("B", "3.5"), edge("A B"), edge("B A")), "valid number"),  # type: ignore[arg-type]  # the fault
    "boolean required": (
        lif_of(
            node(
                "A",
                vehicleTypeNodeProperties=[
                    {
                        "vehicleTypeId": "t",
                        "actions": [{"actionType": "beep", "blockingType": "NONE", "required": True}],
                    }
                ],
            )
        ),
        "'required' of actions is read as",
    ),
    "draft version": (lif(layout(*RING), version="0.11.0"), "never published"),
    "unknown field": (lif_of(node("A", colour="red")), "unknown field 'colour'"),
    "no map": (lif_of(node("A", mapId=None)), "has no mapId"),
    "a type twice": (lif_of(node("A", 0, 0, "t", "t")), "2 times"),
    "closed end": (lif_of(node("A"), node("B"), edge("A B", use("u"))), "is not allowed on its node"),
    "half a load": (
        lif_of(
            *RING[:3],
            edge(
                "B A",
                use(loadRestriction={"loaded": False, "unloaded": True, "loadSetNames": ["pallet"]}),
            ),
        ),
        "forbids loads",
    ),
    "heading above pi": (
        lif_of(node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "theta": 4}])),
        "pi",
    ),
    "an edge of the other layout": (
        lif(layout(node("A"), edge("B A"), edge("A B")), layout(node("B"), layoutId="up")),
        "another layout",
    ),
    "action without requirement": (
        lif_of(*RING[:3], edge("B A", use(actions=[{"actionType": "beep", "blockingType": "NONE"}]))),
        "no requirementType",
    ),
    "a station nowhere": (
        lif_of(node("A"), {"stationId": "S", "interactionNodeIds": []}),
        "no interaction node",
    ),
    "trajectory elsewhere": (
        lif_of(
            *RING[:3],
            edge(
                "B A",
                use(
                    trajectory={
                        "knotVector": [0, 0, 1, 1],
                        "controlPoints": [{"x": 3, "y": 4}, {"x": 1, "y": 0}],
                    }
                ),
            ),
        ),
        "does not end at node 'A'",
    ),
}


@pytest.mark.parametrize("fault", DEPARTURES)
def test_deviation_of_real_files_is_a_warning_or_strictly_an_error(fault: str) -> None:
    data, text = DEPARTURES[fault]
    assert text in texts(data)
    with pytest.raises(PlantModelError) as caught:
        read(data, strict=True)
    assert text in str(caught.value)


def _spoiled(**changes: Any) -> bytes:
    """Return a file of which these objects have other values; None removes the field, ... makes it null."""
    acting = {"actions": [action("beep", blockingType="SOFT")]}
    of_node: dict[str, Any] = {"vehicleTypeNodeProperties": [{"vehicleTypeId": "t", "theta": 1.0, **acting}]}
    objects: dict[str, dict[str, Any]] = {
        "node": node("A", **of_node),
        "edge": edge("A B", use(orientationType="GLOBAL", maxSpeed=2.0)),
        "station": {"stationId": "S", "interactionNodeIds": ["A"], "stationHeight": 1.0},
    }
    whole = layout(objects["node"], node("B", 3, 4), objects["edge"], edge("B A"), objects["station"])
    content = json.loads(lif())
    objects |= {
        "file": content,
        "meta": content["metaInformation"],
        "layout": whole,
        "at_node": objects["node"]["vehicleTypeNodeProperties"][0],
        "on_edge": objects["edge"]["vehicleTypeEdgeProperties"][0],
        "action": objects["node"]["vehicleTypeNodeProperties"][0]["actions"][0],
    }
    content["layouts"] = [whole]
    for name, values in changes.items():
        objects[name].update({key: None if value is ... else value for key, value in values.items()})
        for key in [key for key, value in values.items() if value is None]:
            del objects[name][key]
    return json.dumps(content).encode()


@pytest.mark.parametrize(
    "changes",
    [
        {"meta": {"lifVersion": version}}
        for version in ("v1.0.0", "1.0.0-beta", "1.0", "1", 1.0, "", "LIF", "1.0.0 draft", None, ...)
    ]
    + [
        {"layout": {"layoutVersion": None}},
        {"layout": {"layoutVersion": ...}},
        {"layout": {"layoutVersion": 3}},
        {"layout": {"layoutName": ..., "layoutLevelId": ..., "layoutDescription": ...}},
        {"layout": {"stations": ...}},
        {"meta": {"creator": None, "exportTimestamp": ...}},
        {"file": {"metaInformation": None}},
        {"at_node": {"actions": ...}},
        {"at_node": {"theta": ...}},
        {"at_node": {"theta": ""}},
        {"at_node": {"theta": "1.0"}},
        {"action": {"actionParameters": ...}},
        {"action": {"blockingType": "Soft"}},
        {"action": {"blockingType": None}},
        {"action": {"requirementType": "conditional"}},
        {"on_edge": {"orientationType": "global"}},
        {"on_edge": {"rotationAtStartNodeAllowed": "both", "rotationAtEndNodeAllowed": "Both"}},
        {"on_edge": {"maxSpeed": "2.0"}},
        {"on_edge": {"rotationAllowed": "false"}},
        {"on_edge": {"trajectory": ..., "loadRestriction": ..., "minHeight": ..., "actions": ...}},
        {"on_edge": {"maxSpeed": None, "maxspeed": 2.0}},
        {"station": {"stationHeight": "1.0"}},
        {"station": {"stationPosition": ..., "stationName": ...}},
        {"station": {"stationHeight": None, "stationHeight ": 1.0}},
        {"node": {"mapId": None, "nodePosition": {"x": 0.0, "y": 0.0, "mapId": "m"}}},
        {"node": {"nodeId": None, "NodeId": "A"}},
        {"node": {"nodeId": None, "node_id": "A"}},
    ],
)
def test_deviation_with_one_meaning_is_read_with_a_warning(changes: dict[str, Any]) -> None:
    right, found = read(_spoiled()), read(_spoiled(**changes))
    assert {each.code for each in found.warnings} - {each.code for each in right.warnings} == {"NOT_LIF"}
    assert {code for code, _ in refusals(_spoiled(**changes), strict=True)} == {"NOT_LIF"}
    assert [(each.name, each.map_id) for each in found.model.points] == [("A", "m"), ("B", "m")]
    assert len(found.model.locations) == (0 if changes == {"layout": {"stations": ...}} else 1)
    on_edge = found.model.path("A-B").vehicle_types
    assert on_edge == right.model.path("A-B").vehicle_types
    if "at_node" not in changes and "action" not in changes:
        assert found.model.point("A").vehicle_types == right.model.point("A").vehicle_types


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"on_edge": {"orientationType": "SIDEWAYS"}}, "orientationType"),
        ({"on_edge": {"maxSpeed": "fast"}}, "maxSpeed"),
        ({"on_edge": {"maxSpeed": "1,5"}}, "maxSpeed"),
        ({"node": {"nodeId": ...}}, "nodeId"),
        ({"file": {"layouts": ...}}, "layouts"),
        ({"layout": {"edges": ...}}, "edges"),
        ({"station": {"interactionNodeIds": ...}}, "interactionNodeIds"),
        ({"node": {"nodePosition": ...}}, "nodePosition"),
        ({"action": {"actionType": None}}, "actionType"),
        ({"edge": {"endNodeId": None}}, "endNodeId"),
        ({"meta": {"lifVersion": "v3.0"}}, "lifVersion"),
    ],
)
def test_value_without_a_certain_meaning_is_refused_by_name(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(PlantModelError, match=field):
        read(_spoiled(**changes))


def test_single_of_a_node_is_no_blocking_type_of_1_0() -> None:
    data = _spoiled(action={"blockingType": "SINGLE"})
    assert ("NOT_LIF", "A") in warnings(data)
    assert ("NOT_LIF", "A") in refusals(data, strict=True)


def test_thousands_of_equal_faults_are_one_warning() -> None:
    data = lif_of(*(node(f"n{i}", str(i)) for i in range(50)))  # type: ignore[arg-type]  # the fault
    (found,) = [each for each in read(data).warnings if each.code == "NOT_LIF"]
    assert "found 50 times" in found.text


def test_headings_in_degrees_are_turned_all_together() -> None:
    uses = [[{"vehicleTypeId": "t", "theta": theta}] for theta in (90, 3)]
    data = lif_of(*(node(f"n{i}", vehicleTypeNodeProperties=each) for i, each in enumerate(uses)))
    report = read(data)
    assert [point.orientation_deg for point in report.model.points] == pytest.approx([90, 3])
    assert "HEADINGS_IN_DEGREES" in {problem.code for problem in report.warnings}
    assert ("HEADINGS_IN_DEGREES", "") in refusals(data, strict=True)


def test_a_finding_quotes_the_value() -> None:
    with pytest.raises(PlantModelError) as caught:
        read(lif_of(node("A", nodePosition={"x": "0,5", "y": 0.0})))
    assert [each.text.partition("first at ")[2] for each in caught.value.problems] == [
        'layouts.0.nodes.0.nodePosition.x (received "0,5"))'
    ]


@pytest.mark.parametrize(
    ("data", "code", "name"),
    [
        (b"", "MALFORMED_JSON", ""),
        (b'{"layouts": NaN}', "MALFORMED_JSON", ""),
        (b"[" * 300 + b"]" * 300, "LIMIT_EXCEEDED", ""),
        (b"[]", "NOT_LIF", ""),
        (b'{"metaInformation": {}}', "NOT_LIF", ""),
        (lif(version="10.0"), "UNSUPPORTED_VERSION", ""),
        (lif(version="0.5.0"), "UNSUPPORTED_VERSION", ""),
        (lif(version="2.0.0"), "NOT_LIF", ""),
        (lif_of(node("A"), node("A")), "DUPLICATE_NAME", "A"),
        (lif_of(*RING, edge("A B")), "DUPLICATE_NAME", "A-B"),
        (lif_of(node("A"), edge("A B")), "UNKNOWN_REFERENCE", "A-B"),
        (lif_of({"stationId": "S", "interactionNodeIds": ["A"]}), "UNKNOWN_REFERENCE", "S"),
        (lif_of(node("A", vehicleTypeNodeProperties=[])), "NO_VEHICLE_TYPE", "A"),
        (lif_of(*RING[:3], edge("B A", vehicleTypeEdgeProperties=[])), "NO_VEHICLE_TYPE", "B-A"),
    ],
)
def test_unusable_file_is_refused(data: bytes, code: str, name: str) -> None:
    assert (code, name) in refusals(data)


@pytest.mark.parametrize("limits", [JsonLimits(size_bytes=100), JsonLimits(values=10)])
def test_files_beyond_the_limits_are_refused(limits: JsonLimits) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(lif_of(*RING), limits=limits)
    assert [problem.code for problem in caught.value.problems] == ["LIMIT_EXCEEDED"]


def test_unsupported_content_is_reported_once() -> None:
    heights = use(minHeight=0.1, rotationAtEndNodeAllowed="CW", reentryAllowed=False)
    data = lif_of(node("A"), node("B"), edge("A B", heights), edge("B A", heights))
    found = [problem.text for problem in read(data).warnings if problem.code == "NOT_HEEDED"]
    assert [text.split(" (")[0] for text in found] == [
        "reentryAllowed false",
        "rotationAtEndNodeAllowed",
    ]
    assert all("found 2 times" in text for text in found)


def test_type_that_cannot_reach_every_point_is_reported() -> None:
    both = ("t", "u")
    data = lif_of(
        node("A", 0, 0, *both),
        node("B", 1, 0, *both),
        edge("A B", use("t"), use("u")),
        edge("B A", use("t")),
    )
    found = [each.text for each in read(data).warnings if each.code == "NOT_STRONGLY_CONNECTED"]
    assert len(found) == 1
    assert "type 'u'" in found[0]


def doing(name: str, x_mm: int, *actions_by_type: str) -> Point:
    """Make a point at which each vehicle type does what one text names."""
    uses = tuple(
        VehicleTypeAtPoint(
            vehicle_type_id=f"t{number}",
            actions=tuple(
                TypeAction(action_type=each, blocking_type=PlantBlockingType.HARD) for each in actions.split()
            ),
        )
        for number, actions in enumerate(actions_by_type)
    )
    return point(name, x_mm, vehicle_types=uses)


POINTS = {
    each.name: each
    for each in (doing("A", 1000, "pick", "pick drop"), doing("B", 4001, "drop"), point("C", 0))
}


def maker(*taken: str) -> StationMaker:
    return StationMaker(POINTS, Names([*POINTS, *taken]))


def station(name: str, *nodes: str, **more: Any) -> Station:
    return Station(station_id=name, interaction_node_ids=nodes, **more)


def test_link_allows_operations_of_any_vehicle_type() -> None:
    made = maker()
    location = made.location(station("S", "A", "B", "C", "A"), 3)
    links = {link.point: set(link.allowed_operations) for link in location.links}
    (kind,) = made.types
    assert list(links) == ["A", "B", "C"]
    assert links["A"] == set(kind.allowed_operations)
    assert len(links["A"]) == 2
    assert links["B"] < links["A"]
    assert links["C"] == {NO_OPERATION}, "a link without operations would allow all of the type's"
    assert location.layout.layer_id == 3


def test_stations_with_the_same_operations_are_of_one_type() -> None:
    made = maker()
    types = [made.location(station(*each), 0).type for each in (("S", "A"), ("T", "A", "B"), ("U", "B"))]
    assert types[0] == types[1] != types[2]
    assert [each.name for each in made.types] == [types[0], types[2]]


def test_object_with_a_taken_id_is_renamed_and_keeps_its_id() -> None:
    location = maker().location(station("A", "B"), 0)
    assert (location.name, location.properties["lif:id"]) == ("station:A", "A")


@pytest.mark.parametrize(
    ("nodes", "position", "place"),
    [
        ("AB", None, (2500, 0)),
        ("AAB", None, (2500, 0)),
        ("", None, (0, 0)),
        ("AB", StationPosition(x=1.2345, y=-2.0), (1234, -2000)),
    ],
)
def test_where_it_is(nodes: str, position: StationPosition | None, place: tuple[int, int]) -> None:
    location = maker().location(station("S", *nodes, station_position=position), 0)
    assert (location.x_mm, location.y_mm) == place
    assert ("lif:stationPosition" in location.properties) is (position is not None)


def test_missing_field_becomes_no_property() -> None:
    bare = maker().location(station("S"), 0)
    assert bare.properties == {"lif:id": "S"}
    whole = maker().location(
        station("S", station_name="Dock", station_description="by the door", station_height=0.4), 0
    )
    assert whole.properties == {
        "lif:id": "S",
        "lif:name": "Dock",
        "lif:description": "by the door",
        "lif:stationHeight": "0.4",
    }


def test_first_object_keeps_its_id_and_others_get_kind_and_number() -> None:
    names = Names(["A"])
    assert names.allocate(ObjectKind.PATH, "B", "edge") == "B"
    assert names.renamed == []
    assert names.allocate(ObjectKind.PATH, "A", "edge") == "edge:A"
    assert names.allocate(ObjectKind.LOCATION, "A", "edge") == "edge2:A"
    assert [(each.kind, each.name) for each in names.renamed] == [
        (ObjectKind.PATH, "A"),
        (ObjectKind.LOCATION, "A"),
    ]
    assert "'edge2:A'" in names.renamed[1].text


@given(st.lists(st.sampled_from(["A", "B", "edge:A", "edge2:A", "edge:edge:A"])))
def test_allocated_names_are_unique(wanted: list[str]) -> None:
    names = Names(["A"])
    given_names = [names.allocate(ObjectKind.PATH, each, "edge") for each in wanted]
    assert len({"A", *given_names}) == len(wanted) + 1
    renamed = [one for one, other in zip(wanted, given_names, strict=True) if one != other]
    assert [each.name for each in names.renamed] == renamed
