"""Write plant models as route graphs of Nav2 (nav2_route, GeoJSON), in the frame of one map."""

import json
from collections.abc import Iterator
from typing import Any, Final

from nena_plant_formats.exchange import ExportReport
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.geometry import MapTransform, PlantPlace
from nena_shared.plant.model import PlantModel, map_transforms
from nena_shared.plant.track import DirectedEdge, Point

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
