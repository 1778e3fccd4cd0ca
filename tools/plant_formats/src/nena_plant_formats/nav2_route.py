"""Read and write route graphs of Nav2 (nav2_route, GeoJSON), in the frame of one map."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from math import dist
from typing import Any, Final

from nena_plant_formats.exchange import ExportReport, refusal
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.geometry import MapTransform, PlantPlace
from nena_shared.plant.model import PlantModel, map_transforms
from nena_shared.plant.track import MM_PER_M, DirectedEdge, Point

NOT_EXPORTED: Final = "NOT_EXPORTED"
DECIMALS: Final = 4
"""Decimals of coordinates in metres."""


def write(model: PlantModel, *, map_id: str | None = None, frame: str = "map") -> ExportReport:
    """Return the route graph of a map, including points without a mapId; ``map_id`` None: the only map.

    IDs are numbers, nodes first, in the order of the model; names are in ``metadata``. Raises PlantModelError
    if ``map_id`` is required, or has no points.
    """
    chosen = map_id if map_id is not None else _only_map(model)
    points = [point for point in model.points if point.map_id in (None, chosen)]
    if not points:
        problem = f"no point is on the map {chosen!r}"
        raise PlantModelError([PlantProblem("NO_POINTS", ObjectKind.MODEL, model.name, problem)])
    transform = map_transforms(model).get(chosen or "", MapTransform())
    ids = {each.name: number for number, each in enumerate(points)}
    places = {point.name: _place_on_map(point, transform) for point in points}
    edges = [
        edge for edge in model.edges() if {edge.source, edge.destination} <= ids.keys() and _is_usable(edge)
    ]
    features = [
        *(_node_feature(ids[point.name], point, places[point.name], frame) for point in points),
        *(_edge_feature(len(points) + number, each, ids, places) for number, each in enumerate(edges)),
    ]
    collection = {"type": "FeatureCollection", "name": model.name, "features": features}
    data = json.dumps(collection, indent=2, ensure_ascii=False).encode() + b"\n"
    return ExportReport(data, tuple(_find_losses(model, ids)))


def _only_map(model: PlantModel) -> str | None:
    found = sorted({point.map_id for point in model.points if point.map_id is not None})
    if len(found) > 1:
        problem = f"its points are on several maps, name one: {', '.join(found)}"
        raise PlantModelError([PlantProblem("SEVERAL_MAPS", ObjectKind.MODEL, model.name, problem)])
    return found[0] if found else None


def _is_usable(edge: DirectedEdge) -> bool:
    """Return whether Nav2 may drive an edge; it cannot drive one backwards."""
    return edge.is_forward and not edge.path.locked


def _place_on_map(point: Point, transform: MapTransform) -> list[float]:
    found = transform.to_map(PlantPlace(point.x_m, point.y_m))
    return [round(found.x_m, DECIMALS), round(found.y_m, DECIMALS)]


def _node_feature(number: int, point: Point, place: list[float], frame: str) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"id": number, "frame": frame, "metadata": {"name": point.name}},
        "geometry": {"type": "Point", "coordinates": place},
    }


def _edge_feature(
    number: int, edge: DirectedEdge, ids: dict[str, int], places: dict[str, list[float]]
) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {
            "id": number,
            "startid": ids[edge.source],
            "endid": ids[edge.destination],
            # As in openTCS: the length is the cost, and may differ from the distance.
            "cost": edge.path.length_m,
            # In m/s: speed_limit is a percentage in nav2_route.
            "metadata": {"name": edge.id, "abs_speed_limit": edge.max_velocity_m_s},
        },
        "geometry": {
            "type": "MultiLineString",
            "coordinates": [[places[edge.source], places[edge.destination]]],
        },
    }


def _find_losses(model: PlantModel, ids: dict[str, int]) -> Iterator[PlantProblem]:
    for point in model.points:
        if point.name not in ids:
            text = f"on the map {point.map_id!r}"
            yield PlantProblem(NOT_EXPORTED, ObjectKind.POINT, point.name, text)
    for edge in model.edges():
        if edge.path.locked:
            yield PlantProblem(NOT_EXPORTED, ObjectKind.PATH, edge.path.name, "locked")
        elif not edge.is_forward:
            text = "backward driving, which route graphs do not have"
            yield PlantProblem(NOT_EXPORTED, ObjectKind.PATH, edge.path.name, text)
        elif not {edge.source, edge.destination} <= ids.keys():
            yield PlantProblem(NOT_EXPORTED, ObjectKind.PATH, edge.path.name, "leads to another map")
        elif any(each.trajectory for each in edge.path.vehicle_types):
            text = "its trajectory: the edge is straight"
            yield PlantProblem(NOT_EXPORTED, ObjectKind.PATH, edge.path.name, text)


NOT_HEEDED: Final = "NOT_HEEDED"
_READ: Final = {"name", "abs_speed_limit"}
"""Metadata that have a place in plant models."""


def to_nena(content: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[PlantProblem, ...]]:
    """Return a route graph as NeNa's JSON, yet to be checked, and what is lost.

    A cost is read as the path's length, as it is written, if it is not less than the distance of the nodes.
    Raises PlantModelError for GeoJSON that is no route graph of one frame.
    """
    found = content["features"] if isinstance(content["features"], list) else []
    features = [each for each in found if isinstance(each, dict)]
    edges = [each for each in features if {"startid", "endid"} <= _part(each, "properties").keys()]
    nodes = {
        str(_part(each, "properties").get("id")): each
        for each in features
        if _part(each, "geometry").get("type") == "Point"
    }
    if not nodes:
        text = "this is GeoJSON without points; in a route graph of Nav2, they are the nodes"
        raise refusal("NOT_A_PLANT_MODEL", text)
    if len(nodes) + len(edges) < len(features):
        text = "each feature must be a Point with an id of its own, or have startid and endid"
        raise refusal("BAD_VALUE", f"{len(features) - len(nodes) - len(edges)} features are neither: {text}")
    frames = sorted({str(_part(each, "properties").get("frame", "map")) for each in nodes.values()})
    if len(frames) > 1:
        raise refusal(
            "SEVERAL_MAPS", f"its nodes are in the frames {', '.join(frames)}; write one file for each"
        )
    names = {key: _name_of(each) or key for key, each in nodes.items()}
    places = {key: _place_of(each) for key, each in nodes.items()}
    points = [
        {
            "name": names[key],
            **dict(zip(("xMm", "yMm"), (round(MM_PER_M * each) for each in place), strict=True)),
        }
        for key, place in places.items()
    ]
    model = {
        "name": str(content.get("name") or "route graph"),
        "points": points,
        "paths": [_path_of(each, names, places) for each in edges],
    }
    return model, tuple(_find_import_losses(nodes.values(), edges))


def _part(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    part = content.get(key)
    return part if isinstance(part, dict) else {}


def _metadata(feature: Mapping[str, Any]) -> Mapping[str, Any]:
    return _part(_part(feature, "properties"), "metadata")


def _name_of(feature: Mapping[str, Any]) -> str:
    name = _metadata(feature).get("name")
    return name if isinstance(name, str) else ""


def _place_of(node: Mapping[str, Any]) -> tuple[float, float]:
    match node["geometry"].get("coordinates"):
        case [int() | float() as x, int() | float() as y, *_]:
            return float(x), float(y)
        case other:
            raise refusal(
                "BAD_VALUE", f"the coordinates of a node are {other!r}; they must be x and y in metres"
            )


def _path_of(
    edge: Mapping[str, Any], names: Mapping[str, str], places: Mapping[str, tuple[float, float]]
) -> dict[str, Any]:
    properties = edge["properties"]
    ends = [str(properties[key]) for key in ("startid", "endid")]
    length = dist(places[ends[0]], places[ends[1]]) if places.keys() >= set(ends) else 0.0
    cost, speed = properties.get("cost"), _metadata(edge).get("abs_speed_limit")
    if isinstance(cost, int | float):
        length = max(length, cost)
    source, destination = (names.get(end, end) for end in ends)
    path = {
        "name": _name_of(edge) or f"{source} --- {destination}",
        "source": source,
        "destination": destination,
        "lengthMm": max(1, round(MM_PER_M * length)),
    }
    return path if not isinstance(speed, int | float) else path | {"maxVelocityMmS": round(MM_PER_M * speed)}


def _find_import_losses(
    nodes: Iterable[Mapping[str, Any]], edges: Iterable[Mapping[str, Any]]
) -> Iterator[PlantProblem]:
    """Yield what has no place in plant models, once for each kind."""
    lost = Counter[str]()
    for each in chain(nodes, edges):
        lost.update(f"metadata {key!r}" for key in _metadata(each).keys() - _READ)
        lost.update(key for key in ("operations", "overridable") if _part(each, "properties").get(key))
    for each in edges:
        shape = _part(each, "geometry")
        lines = (
            shape.get("coordinates") if shape.get("type") == "MultiLineString" else [shape.get("coordinates")]
        )
        if any(isinstance(line, list) and len(line) > len(("start", "end")) for line in lines or ()):
            lost["bends: the path is straight, as it is for Nav2's route server"] += 1
    for what, times in sorted(lost.items()):
        yield PlantProblem(NOT_HEEDED, ObjectKind.MODEL, "", f"{what} (found {times} times)")
