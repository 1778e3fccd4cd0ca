"""Differences of LIF 2.0.0 from 1.0.0: origins, mobile robot types, and their properties.

Files of 2.0.0 are converted to the objects of `document` and back; everything else is the same for both
versions. Omitted fields stay omitted when the file is written again.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Final

from pydantic import Field, JsonValue, field_validator
from pydantic_core import from_json

from nena_plant_formats.lif.document import (
    Layout,
    LifEdge,
    LifFile,
    LifNode,
    LifRecord,
    LifVersion,
    MetaInformation,
    Position,
    Station,
    StationPosition,
    without_none,
)
from nena_shared.plant.track import (
    Coordinate,
    DeviationBounds,
    LineGuidance,
    LoadRestriction,
    PathCorridor,
    PathOrientationType,
    PathTrajectory,
    PlantBlockingType,
    PlantRecord,
    RequirementType,
    RotationAllowed,
    Speed,
    TypeAction,
    TypeActionParameter,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

DEFAULT_ORIGIN_ID: Final = "origin"
"""ID of the origin for layouts without one, as in LIF 1.0."""


class FacilityInformation(LifRecord):
    """Facility ID, creator, export time and format version of the file (metaInformation)."""

    lif_id: str
    creator: str
    export_timestamp: str
    lif_version: str


class MobileRobotType(LifRecord):
    """A series of a manufacturer, named as in topics and factsheets."""

    manufacturer: str
    series_name: str


class RobotActionParameter(LifRecord):
    """A fixed parameter of an action."""

    key: str
    value: JsonValue

    @field_validator("value")
    @classmethod
    def _not_null(cls, value: JsonValue) -> JsonValue:
        # LIF 2.0 lists strings, numbers, booleans, arrays and objects.
        if value is None:
            raise ValueError("must not be null")
        return value


class RobotAction(LifRecord):
    """An action that is required or feasible."""

    action_type: str
    action_descriptor: str | None = None
    blocking_type: PlantBlockingType
    action_parameters: tuple[RobotActionParameter, ...] = ()


class MobileRobotTypeNodeProperty(LifRecord):
    """How mobile robots of some types may use a node."""

    mobile_robot_types: tuple[MobileRobotType, ...]
    theta: float | None = None
    allowed_deviation_xy: Annotated[DeviationBounds | None, Field(alias="allowedDeviationXY")] = None
    load_restriction: LoadRestriction | None = None
    required_actions: tuple[RobotAction, ...] = ()
    feasible_actions: tuple[RobotAction, ...] = ()
    forbidden_action_types: tuple[str, ...] = ()


class MobileRobotTypeEdgeProperty(LifRecord):
    """How mobile robots of some types may use an edge."""

    mobile_robot_types: tuple[MobileRobotType, ...]
    orientation_type: PathOrientationType = PathOrientationType.TANGENTIAL
    # LIF's default; that of VDA 5050 3.0 is false.
    reach_orientation_before_entering: bool = True
    mobile_robot_orientations: tuple[float, ...] = ()
    rotation_at_start_node_allowed: RotationAllowed = RotationAllowed.BOTH
    rotation_at_end_node_allowed: RotationAllowed = RotationAllowed.BOTH
    maximum_speed: Speed | None = None
    maximum_rotation_speed: Speed | None = None
    minimum_load_handling_device_height: Coordinate | None = None
    maximum_mobile_robot_height: Coordinate | None = None
    load_restriction: LoadRestriction | None = None
    required_actions: tuple[RobotAction, ...] = ()
    feasible_actions: tuple[RobotAction, ...] = ()
    forbidden_action_types: tuple[str, ...] = ()
    trajectory: PathTrajectory | None = None
    physical_line_guided_property: LineGuidance | None = None
    reentry_allowed: bool = True
    corridor: PathCorridor | None = None


class OriginNode(LifRecord):
    """A node: a position at which mobile robots can be."""

    node_id: str = Field(min_length=1)
    node_descriptor: str | None = None
    map_id: str
    node_position: Position
    mobile_robot_type_node_properties: tuple[MobileRobotTypeNodeProperty, ...]


class OriginEdge(LifRecord):
    """A directed connection of two nodes; the end may be in another layout or origin."""

    edge_id: str = Field(min_length=1)
    # 0045: no longer in the text of 2.0, but in its schema and examples, like layoutName.
    edge_name: str | None = None
    edge_descriptor: str | None = None
    start_node_id: str
    end_node_id: str
    mobile_robot_type_edge_properties: tuple[MobileRobotTypeEdgeProperty, ...]


class OriginStation(LifRecord):
    """A station, served from its interaction nodes."""

    station_id: str = Field(min_length=1)
    interaction_node_ids: tuple[str, ...]
    station_name: str | None = None
    station_type: str | None = None
    station_descriptor: str | None = None
    station_height: float | None = None
    station_position: StationPosition | None = None


class OriginLayout(LifRecord):
    """A level of a plant, or part of a level, in the frame of its origin."""

    layout_id: str
    layout_name: str | None = None
    layout_version: str
    layout_level_id: str | None = None
    layout_descriptor: str | None = None
    nodes: tuple[OriginNode, ...]
    edges: tuple[OriginEdge, ...]
    stations: tuple[OriginStation, ...] = ()


class Origin(LifRecord):
    """A frame shared by several layouts."""

    origin_id: str
    origin_descriptor: str | None = None
    layouts: tuple[OriginLayout, ...]


class OriginsFile(LifRecord):
    """A LIF 2.0 file; IDs are unique per kind of object."""

    meta_information: FacilityInformation
    origins: tuple[Origin, ...]


_Renamed = Mapping[str, str]
_LAYOUT: Final[_Renamed] = {"layout_descriptor": "layout_description"}
_NODE: Final[_Renamed] = {"node_descriptor": "node_description"}
_EDGE: Final[_Renamed] = {"edge_descriptor": "edge_description"}
_STATION: Final[_Renamed] = {"station_descriptor": "station_description"}
_ACTION: Final[_Renamed] = {"action_descriptor": "action_description"}
_USE: Final[_Renamed] = {
    "maximum_speed": "max_speed",
    "maximum_rotation_speed": "max_rotation_speed",
    "minimum_load_handling_device_height": "min_height",
    "maximum_mobile_robot_height": "max_height",
    "physical_line_guided_property": "line_guidance",
}
"""Names of 2.0 fields in the objects of `document`; all others are unchanged."""


def _set_fields(record: PlantRecord, renamed: _Renamed, *without: str) -> dict[str, Any]:
    """Return the fields set in a record, with their names in the other version."""
    return {
        renamed.get(name, name): getattr(record, name)
        for name in type(record).model_fields
        if name in record.model_fields_set and name not in without
    }


def to_layouts(file: OriginsFile) -> LifFile:
    """Convert a 2.0.0 file to the objects of `document`, with one entry per mobile robot type."""
    return LifFile(
        meta_information=MetaInformation(
            **_set_fields(file.meta_information, {"lif_id": "project_identification"})
        ),
        layouts=tuple(
            _convert_layout(origin, layout) for origin in file.origins for layout in origin.layouts
        ),
        # Manufacturers may have dots too, so some IDs cannot be split again at the first one.
        manufacturers={
            type_id(each): each.manufacturer
            for each in robot_types(file)
            if _split_vehicle_type(type_id(each), {}) != (each.manufacturer, each.series_name)
        },
    )


def robot_types(file: OriginsFile) -> Iterator[MobileRobotType]:
    """Yield every occurrence of a mobile robot type in a file."""
    for layout in (each for origin in file.origins for each in origin.layouts):
        for node in layout.nodes:
            for at_node in node.mobile_robot_type_node_properties:
                yield from at_node.mobile_robot_types
        for edge in layout.edges:
            for on_edge in edge.mobile_robot_type_edge_properties:
                yield from on_edge.mobile_robot_types


def type_id(robot_type: MobileRobotType) -> str:
    """Return the vehicle type in LIF 1.0's suggested form, `manufacturer.seriesName`."""
    return ".".join(filter(None, (robot_type.manufacturer, robot_type.series_name)))


def _split_vehicle_type(vehicle_type: str, manufacturers: Mapping[str, str]) -> tuple[str, str]:
    """Return manufacturer and series; the manufacturer is empty if the vehicle type contains none."""
    manufacturer = manufacturers.get(vehicle_type)
    if manufacturer is None or not vehicle_type.startswith(manufacturer):
        manufacturer = vehicle_type.partition(".")[0] if "." in vehicle_type else ""
    return manufacturer, vehicle_type.removeprefix(manufacturer).removeprefix("." if manufacturer else "")


def _convert_layout(origin: Origin, layout: OriginLayout) -> Layout:
    return Layout(
        **_set_fields(layout, _LAYOUT, "nodes", "edges", "stations"),
        origin_id=origin.origin_id,
        origin_descriptor=origin.origin_descriptor,
        nodes=tuple(map(_convert_node, layout.nodes)),
        edges=tuple(map(_convert_edge, layout.edges)),
        stations=tuple(Station(**_set_fields(station, _STATION)) for station in layout.stations),
    )


def _convert_node(node: OriginNode) -> LifNode:
    uses = tuple(_at_point(each) for each in node.mobile_robot_type_node_properties)
    return LifNode(
        **_set_fields(node, _NODE, "mobile_robot_type_node_properties"),
        vehicle_type_node_properties=tuple(use for each in uses for use in each),
    )


def _at_point(at_node: MobileRobotTypeNodeProperty) -> Iterator[VehicleTypeAtPoint]:
    common = _set_fields(at_node, {}, "mobile_robot_types", "required_actions", "feasible_actions")
    common["actions"] = tuple(_convert_actions(at_node))
    for each in at_node.mobile_robot_types:
        yield VehicleTypeAtPoint(**{**common, "vehicle_type_id": type_id(each)})


def _convert_edge(edge: OriginEdge) -> LifEdge:
    uses = tuple(_on_path(each) for each in edge.mobile_robot_type_edge_properties)
    return LifEdge(
        **_set_fields(edge, _EDGE, "mobile_robot_type_edge_properties"),
        vehicle_type_edge_properties=tuple(use for each in uses for use in each),
    )


def _on_path(on_edge: MobileRobotTypeEdgeProperty) -> Iterator[VehicleTypeOnPath]:
    other_form = (
        "mobile_robot_types",
        "mobile_robot_orientations",
        "reach_orientation_before_entering",
        "required_actions",
        "feasible_actions",
    )
    common = _set_fields(on_edge, _USE, *other_form)
    # 2.0 has the inverse. Unset stays unset, so that saving a file changes no line (0045).
    if "reach_orientation_before_entering" in on_edge.model_fields_set:
        common["rotation_allowed"] = not on_edge.reach_orientation_before_entering
    if on_edge.mobile_robot_orientations:
        common["vehicle_orientation"], *others = on_edge.mobile_robot_orientations
        common["other_orientations"] = tuple(others)
    common["actions"] = tuple(_convert_actions(on_edge))
    for each in on_edge.mobile_robot_types:
        yield VehicleTypeOnPath(**{**common, "vehicle_type_id": type_id(each)})


def _convert_actions(use: MobileRobotTypeNodeProperty | MobileRobotTypeEdgeProperty) -> Iterator[TypeAction]:
    # CONDITIONAL is the careful choice: it takes an agreement, OPTIONAL none.
    required, feasible = RequirementType.REQUIRED, RequirementType.CONDITIONAL
    for actions, requirement in ((use.required_actions, required), (use.feasible_actions, feasible)):
        for action in actions:
            given = _set_fields(action, _ACTION, "action_parameters")
            if "action_parameters" in action.model_fields_set:
                given["action_parameters"] = tuple(map(_convert_parameter, action.action_parameters))
            yield TypeAction(**given, requirement_type=requirement)


def _convert_parameter(parameter: RobotActionParameter) -> TypeActionParameter:
    value = parameter.value
    if isinstance(value, str):
        return TypeActionParameter(key=parameter.key, value=value)
    # LIF 1.0 has strings only. The flag restores the value in 2.0.
    return TypeActionParameter(key=parameter.key, value=json.dumps(value), is_json=True)


def from_layouts(file: LifFile) -> OriginsFile:
    """Convert a file to 2.0.0; mobile robot types with equal properties share an entry."""
    origins: defaultdict[str, list[Layout]] = defaultdict(list)
    for layout in file.layouts:
        origins[layout.origin_id or DEFAULT_ORIGIN_ID].append(layout)
    meta = file.meta_information
    return OriginsFile(
        meta_information=FacilityInformation(
            **_set_fields(meta, {"project_identification": "lif_id"}, "lif_version"),
            lif_version=LifVersion.V2_0,
        ),
        origins=tuple(
            Origin(
                origin_id=origin_id,
                origin_descriptor=layouts[0].origin_descriptor,
                layouts=tuple(_of_origin(each, file.manufacturers) for each in layouts),
            )
            for origin_id, layouts in origins.items()
        ),
    )


def _inverse_names(renamed: _Renamed) -> _Renamed:
    return {there: here for here, there in renamed.items()}


def _of_origin(layout: Layout, manufacturers: Mapping[str, str]) -> OriginLayout:
    made = OriginLayout(
        **_set_fields(
            layout, _inverse_names(_LAYOUT), "origin_id", "origin_descriptor", "nodes", "edges", "stations"
        ),
        nodes=tuple(_node_of_2_0(node, manufacturers) for node in layout.nodes),
        edges=tuple(_edge_of_2_0(edge, manufacturers) for edge in layout.edges),
    )
    # Left unset, the writer omits the field, which is optional in 2.0.
    if not layout.stations:
        return made
    stations = tuple(
        OriginStation(**_set_fields(station, _inverse_names(_STATION))) for station in layout.stations
    )
    return made.model_copy(update={"stations": stations})


def _node_of_2_0(node: LifNode, manufacturers: Mapping[str, str]) -> OriginNode:
    common = _set_fields(node, _inverse_names(_NODE), "node_name", "vehicle_type_node_properties")
    # 2.0 has no name of a node, and an export must not lose it.
    common["node_descriptor"] = ": ".join(filter(None, (node.node_name, node.node_description))) or None
    uses = ((use.vehicle_type_id, _node_property(use)) for use in node.vehicle_type_node_properties)
    merged = ((_mobile_robot_types(ids, manufacturers), given) for ids, given in _group_equal(uses))
    return OriginNode(
        **common,
        mobile_robot_type_node_properties=tuple(
            MobileRobotTypeNodeProperty(mobile_robot_types=types, **given) for types, given in merged
        ),
    )


def _edge_of_2_0(edge: LifEdge, manufacturers: Mapping[str, str]) -> OriginEdge:
    uses = ((use.vehicle_type_id, _edge_property(use)) for use in edge.vehicle_type_edge_properties)
    merged = ((_mobile_robot_types(ids, manufacturers), given) for ids, given in _group_equal(uses))
    return OriginEdge(
        **_set_fields(edge, _inverse_names(_EDGE), "vehicle_type_edge_properties"),
        mobile_robot_type_edge_properties=tuple(
            MobileRobotTypeEdgeProperty(mobile_robot_types=types, **given) for types, given in merged
        ),
    )


def _group_equal(uses: Iterable[tuple[str, dict[str, Any]]]) -> list[tuple[list[str], dict[str, Any]]]:
    """Group vehicle types by equal properties; return the types and properties of each group."""
    merged: list[tuple[list[str], dict[str, Any]]] = []
    for vehicle_type, given in uses:
        same = next((ids for ids, known in merged if known == given), None)
        if same is None:
            merged.append(([vehicle_type], given))
        else:
            same.append(vehicle_type)
    return merged


def _mobile_robot_types(ids: Iterable[str], manufacturers: Mapping[str, str]) -> tuple[MobileRobotType, ...]:
    split = (_split_vehicle_type(each, manufacturers) for each in ids)
    return tuple(MobileRobotType(manufacturer=maker, series_name=series) for maker, series in split)


def _node_property(use: VehicleTypeAtPoint) -> dict[str, Any]:
    given = _set_fields(use, {}, "vehicle_type_id", "actions")
    return without_none({**given, **_actions_of_2_0(use.actions)})


def _edge_property(use: VehicleTypeOnPath) -> dict[str, Any]:
    other_form = (
        "vehicle_type_id",
        "vehicle_orientation",
        "other_orientations",
        "rotation_allowed",
        "actions",
    )
    given = _set_fields(use, _inverse_names(_USE), *other_form)
    if use.rotation_allowed is not None:
        given["reach_orientation_before_entering"] = not use.rotation_allowed
    if use.orientations:
        given["mobile_robot_orientations"] = use.orientations
    return without_none({**given, **_actions_of_2_0(use.actions)})


def _actions_of_2_0(actions: Iterable[TypeAction]) -> dict[str, tuple[RobotAction, ...]]:
    by_kind: defaultdict[str, tuple[RobotAction, ...]] = defaultdict(tuple)
    for action in actions:
        required = action.requirement_type is RequirementType.REQUIRED
        given = _set_fields(action, _inverse_names(_ACTION), "requirement_type", "action_parameters")
        if action.action_parameters:
            given["action_parameters"] = tuple(
                RobotActionParameter(key=parameter.key, value=json_value(parameter))
                for parameter in action.action_parameters
            )
        by_kind["required_actions" if required else "feasible_actions"] += (RobotAction(**given),)
    return dict(by_kind)


def json_value(parameter: TypeActionParameter) -> JsonValue:
    """Return the value of a fixed parameter; invalid JSON is returned as text."""
    if not parameter.is_json:
        return parameter.value
    try:
        value: JsonValue = from_json(parameter.value, allow_inf_nan=False)
    except ValueError:
        return parameter.value
    # RobotActionParameter refuses null.
    return parameter.value if value is None else value
