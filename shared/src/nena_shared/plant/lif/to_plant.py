"""Makes a plant model of a LIF file that has been checked."""

from collections.abc import Mapping, Sequence
from math import degrees, hypot
from typing import Final, TypeVar

from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import MM_PER_M, BoundingBox, LabelLayout
from nena_shared.plant.lif import curve, properties
from nena_shared.plant.lif.document import Edge, Layout, LifFile, Node
from nena_shared.plant.lif.names import Names
from nena_shared.plant.lif.stations import StationMaker
from nena_shared.plant.model import PlantModel
from nena_shared.plant.path import ConnectionType, ControlPoint, Path, PathLayout
from nena_shared.plant.point import Point
from nena_shared.plant.vehicle_type import Trajectory, VehicleTypeAtPoint, VehicleTypeOnPath
from nena_shared.plant.visual_layout import Layer, LayerGroup, VisualLayout

UNLIMITED_SPEED_MM_S: Final = 100_000
"""Of a path on which at least one vehicle type may drive as fast as it can."""

UNLIMITED_SIZE: Final = BoundingBox(length_mm=1_000_000, width_mm=1_000_000, height_mm=1_000_000)
"""Of vehicles at points: LIF has no limits for them."""

Use = TypeVar("Use", VehicleTypeAtPoint, VehicleTypeOnPath)

_PIECES: Final = 16
"""In so many straight pieces a curve is drawn that is no cubic Bezier curve."""


def to_plant(file: LifFile, names: Names) -> PlantModel:
    """Return the plant model; nodes keep their ids as names, for robots are told them."""
    meta = file.meta_information
    points = {
        node.node_id: _point(node, layer)
        for layer, layout in enumerate(file.layouts)
        for node in layout.nodes
    }
    paths = [
        _path(edge, layer, points, names)
        for layer, layout in enumerate(file.layouts)
        for edge in layout.edges
    ]
    maker = StationMaker(points, names)
    locations = [
        maker.location(station, layer)
        for layer, layout in enumerate(file.layouts)
        for station in layout.stations
    ]
    return PlantModel(
        name=meta.project_identification,
        points=tuple(points.values()),
        paths=tuple(paths),
        location_types=maker.types,
        locations=tuple(locations),
        visual_layout=_visual_layout(file.layouts),
        properties={properties.CREATOR: meta.creator, properties.EXPORT_TIMESTAMP: meta.export_timestamp},
    )


def _point(node: Node, layer: int) -> Point:
    types = _first_of_each(node.vehicle_type_node_properties)
    headings = {use.theta for use in types}
    theta = headings.pop() if len(headings) == 1 else None
    return Point(
        name=node.node_id,
        x_mm=round(node.node_position.x * MM_PER_M),
        y_mm=round(node.node_position.y * MM_PER_M),
        orientation_deg=None if theta is None else degrees(theta),
        max_vehicle_bounding_box=UNLIMITED_SIZE,
        properties=_given(
            {
                keys.VDA5050_MAP_ID: node.map_id,
                properties.NAME: node.node_name,
                properties.DESCRIPTION: node.node_description,
            }
        ),
        layout=LabelLayout(layer_id=layer),
        vehicle_types=types,
    )


def _path(edge: Edge, layer: int, points: dict[str, Point], names: Names) -> Path:
    types = tuple(map(_with_usable_trajectory, _first_of_each(edge.vehicle_type_edge_properties)))
    trajectory = next((use.trajectory for use in types if use.trajectory), None)
    a, b = points[edge.start_node_id], points[edge.end_node_id]
    length_m = curve.length(trajectory) if trajectory else hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    name = names.take(ObjectKind.PATH, edge.edge_id, "edge")
    return Path(
        name=name,
        source=edge.start_node_id,
        destination=edge.end_node_id,
        length_mm=max(1, round(length_m * MM_PER_M)),
        max_velocity_mm_s=_speed_mm_s(types),
        properties=_given(
            {
                properties.ID: edge.edge_id if name != edge.edge_id else None,
                properties.NAME: edge.edge_name,
                properties.DESCRIPTION: edge.edge_description,
            }
        ),
        layout=_course(trajectory, layer),
        vehicle_types=types,
    )


def _first_of_each(uses: Sequence[Use]) -> tuple[Use, ...]:
    """Return one use for each vehicle type, the first."""
    found: dict[str, Use] = {}
    for use in uses:
        found.setdefault(use.vehicle_type_id, use)
    return tuple(found.values())


def _with_usable_trajectory(use: VehicleTypeOnPath) -> VehicleTypeOnPath:
    """Leave a trajectory out that cannot be followed, and scale one whose knots are not in 0 to 1."""
    if use.trajectory is None:
        return use
    usable = None if curve.fault(use.trajectory) else curve.scaled(use.trajectory)
    return use.model_copy(update={"trajectory": usable})


def _speed_mm_s(uses: Sequence[VehicleTypeOnPath]) -> int:
    """Return the highest speed that any vehicle type may drive; the router goes by that of each."""
    speeds = [UNLIMITED_SPEED_MM_S if use.max_speed is None else use.max_speed * MM_PER_M for use in uses]
    return round(max(speeds))


def _course(trajectory: Trajectory | None, layer: int) -> PathLayout:
    if trajectory is None:
        return PathLayout(layer_id=layer)
    if curve.is_cubic_bezier(trajectory):
        kind, places = ConnectionType.BEZIER, [(point.x, point.y) for point in trajectory.control_points]
    else:
        kind, places = ConnectionType.POLYPATH, list(curve.places(trajectory, _PIECES))
    return PathLayout(
        connection_type=kind,
        control_points=tuple(ControlPoint(x_mm=x * MM_PER_M, y_mm=y * MM_PER_M) for x, y in places[1:-1]),
        layer_id=layer,
    )


def _visual_layout(layouts: Sequence[Layout]) -> VisualLayout:
    """Return a layer for each layout; what else LIF says of it is kept in properties."""
    return VisualLayout(
        layers=tuple(
            Layer(id=number, ordinal=number, name=layout.layout_name or layout.layout_id)
            for number, layout in enumerate(layouts)
        ),
        layer_groups=(LayerGroup(id=0, name="Layouts"),),
        properties=_given(
            {
                f"{properties.LAYOUT}.{number}.{key}": value
                for number, layout in enumerate(layouts)
                for key, value in (
                    ("id", layout.layout_id),
                    ("name", layout.layout_name),
                    ("version", layout.layout_version),
                    ("levelId", layout.layout_level_id),
                    ("description", layout.layout_description),
                )
            }
        ),
    )


def _given(values: Mapping[str, str | None]) -> dict[str, str]:
    return {key: value for key, value in values.items() if value is not None}
