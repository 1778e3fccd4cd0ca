"""Read plant models in openTCS XML, formats 0.0.2 to 7.0.0, and collect all errors and warnings."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import hypot
from types import MappingProxyType
from typing import Any, Final

from nena_plant_formats.exchange import ImportReport
from nena_plant_formats.opentcs_xml.document import (
    COLOR,
    DEFAULT_LIMITS,
    INTEGER,
    Findings,
    FormatVersion,
    Limits,
    XmlObject,
    parse,
)
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError
from nena_shared.plant.model import (
    Block,
    BlockType,
    EnergyThresholds,
    Layer,
    LayerGroup,
    Link,
    Location,
    LocationLayout,
    LocationType,
    PlantModel,
    Vehicle,
    VisualLayout,
)
from nena_shared.plant.track import (
    BoundingBox,
    ConnectionType,
    Envelope,
    LabelLayout,
    LayoutPoint,
    Path,
    PathLayout,
    PeripheralOperation,
    PlantVertex,
    Point,
)
from nena_shared.plant_terms import ExecutionTrigger, PointType


def read(data: bytes, *, limits: Limits = DEFAULT_LIMITS) -> ImportReport:
    """Read a plant model in openTCS's XML, formats 0.0.2 to 7.0.0.

    Raises PlantModelError with all problems if the file is not a plant model, has an unsupported version,
    exceeds a limit or is inconsistent.
    """
    element = parse(data, limits)
    name = element.get("name", "")
    # Removed, because everything left unread is reported.
    findings = Findings(FormatVersion.parse(element.attrib.pop("version", ""), name))
    root = XmlObject(element, ObjectKind.MODEL, name, findings)
    model = _read_model(root)
    root.finish()
    errors = (*findings.errors, *find_errors(model))
    if errors:
        raise PlantModelError(errors)
    return ImportReport(model, (*findings.warnings, *findings.ignored(), *find_warnings(model)))


def _read_model(root: XmlObject) -> PlantModel:
    drawing = read_drawing(root.objects("visualLayout", ObjectKind.VISUAL_LAYOUT))
    track = TrackReader(drawing)
    points = tuple(track.point(obj) for obj in root.objects("point", ObjectKind.POINT))
    paths = tuple(track.path(obj) for obj in root.objects("path", ObjectKind.PATH))
    types = root.objects("locationType", ObjectKind.LOCATION_TYPE)
    locations = root.objects("location", ObjectKind.LOCATION)
    track.warn_of_differences(root, paths)
    return PlantModel(
        name=root.text("name", root.if_old("")),
        points=points,
        paths=paths,
        location_types=tuple(read_location_type(obj, drawing) for obj in types),
        locations=tuple(read_location(obj, drawing, same_frame=not track.displaced) for obj in locations),
        blocks=tuple(read_block(obj, drawing) for obj in root.objects("block", ObjectKind.BLOCK)),
        vehicles=tuple(read_vehicle(obj, drawing) for obj in root.objects("vehicle", ObjectKind.VEHICLE)),
        visual_layout=drawing.visual_layout,
        properties=root.properties(),
    )


@dataclass(frozen=True, slots=True)
class Drawn:
    """Drawing of one object: position in mm of the layout's frame, control points in its pixels."""

    position_mm: tuple[int, int] | None = None
    label: LabelLayout = field(default_factory=LabelLayout)
    connection_type: ConnectionType = ConnectionType.DIRECT
    control_points_px: tuple[tuple[int, int], ...] = ()
    representation: str | None = None
    color: str | None = None


@dataclass(frozen=True, slots=True)
class Drawing:
    """The visual layout, and the drawings that old formats keep there, by object name."""

    visual_layout: VisualLayout = field(default_factory=VisualLayout)
    _elements: Mapping[str, Drawn] = field(default_factory=dict)

    def of(self, obj: XmlObject, tag: str) -> Drawn:
        """Return the drawing of an object; newer formats keep it in the child element `tag`."""
        if obj.findings.version.has_layout_elements:
            return self._elements.get(obj.name, Drawn())
        drawn = [_drawn_by_child(child, tag) for child in obj.children(tag)]
        return drawn[0] if drawn else Drawn()


def read_drawing(layouts: Iterator[XmlObject]) -> Drawing:
    """Read the first visual layout; others are ignored with a warning."""
    drawing: Drawing | None = None
    for layout in layouts:
        if drawing is None:
            drawing = _read_drawing(layout)
        else:
            # Files of 0.0.3 and older may have several.
            layout.warn("DRAWING_DROPPED", "only the first visual layout is used")
    return drawing or Drawing()


def _read_drawing(layout: XmlObject) -> Drawing:
    elements = dict(_layout_elements(layout)) if layout.findings.version.has_layout_elements else {}
    visual_layout = VisualLayout(
        name=layout.text("name"),
        scale_x_mm_per_px=layout.scale("scaleX", 50.0),
        scale_y_mm_per_px=layout.scale("scaleY", 50.0),
        layers=tuple(_read_layer(child) for child in layout.children("layer")),
        layer_groups=tuple(_layer_group(child) for child in layout.children("layerGroup")),
        properties=layout.properties(),
    )
    return Drawing(visual_layout, elements)


def _read_layer(child: XmlObject) -> Layer:
    return Layer(
        id=child.integer("id"),
        ordinal=child.integer("ordinal"),
        name=child.text("name"),
        visible=child.boolean("visible", default=True),
        group_id=child.integer("groupId", 0),
    )


def _layer_group(child: XmlObject) -> LayerGroup:
    return LayerGroup(
        id=child.integer("id"), name=child.text("name"), visible=child.boolean("visible", default=True)
    )


def _drawn_by_child(child: XmlObject, tag: str) -> Drawn:
    """Read pointLayout, pathLayout, locationLayout, vehicleLayout etc. of formats since 0.0.4."""
    match tag:
        case "pathLayout":
            return Drawn(
                label=LabelLayout(layer_id=child.integer("layerId", 0)),
                connection_type=child.choice("connectionType", ConnectionType, ConnectionType.DIRECT),
                control_points_px=tuple(
                    (point.integer("x"), point.integer("y")) for point in child.children("controlPoint")
                ),
            )
        case "pointLayout" | "locationLayout":
            return Drawn(
                position_mm=_position_mm(child),
                label=_read_label(child),
                representation=child.optional_text("locationRepresentation"),
            )
        case _:
            return Drawn(
                representation=child.optional_text("locationRepresentation"), color=child.color("color")
            )


def _position_mm(child: XmlObject) -> tuple[int, int] | None:
    x, y = ("xPosition", "yPosition") if child.findings.is_old else ("positionX", "positionY")
    # 7.0.0 has no positions of its own in the layout; a left-over is reported as ignored.
    if child.findings.version >= FormatVersion.V7_0_0 or not (child.has(x) and child.has(y)):
        return None
    return child.integer(x), child.integer(y)


def _read_label(child: XmlObject) -> LabelLayout:
    old = child.findings.is_old
    x, y = ("xLabelOffset", "yLabelOffset") if old else ("labelOffsetX", "labelOffsetY")
    return LabelLayout(
        label_offset_x_px=child.integer(x, -10),
        label_offset_y_px=child.integer(y, -20),
        layer_id=child.integer("layerId", 0),
    )


def _layout_elements(layout: XmlObject) -> Iterator[tuple[str, Drawn]]:
    """Yield the drawing of each object in a layout of format 0.0.2 or 0.0.3."""
    for element in layout.children("modelLayoutElement"):
        name = element.text("visualizedObjectName")
        layer_id = element.integer("layer", 0)
        try:
            yield name, _drawn_by_properties(element.properties(), layer_id)
        # Drawings are decoration: a wrong one must not make the model unreadable.
        except ValueError as error:
            element.warn("DRAWING_DROPPED", f"{name!r} is drawn with defaults: {error}")


def _drawn_by_properties(values: Mapping[str, str], layer_id: int) -> Drawn:
    position = tuple(_parse_integer(values[key]) for key in ("POSITION_X", "POSITION_Y") if key in values)
    color = values.get("ROUTE_COLOR") or values.get("COLOR")
    if color is not None and COLOR.fullmatch(color) is None:
        raise ValueError(f"{color!r} is not a #RRGGBB colour")
    return Drawn(
        position_mm=(position[0], position[1]) if len(position) == len("xy") else None,
        label=LabelLayout(
            label_offset_x_px=_parse_integer(values.get("LABEL_OFFSET_X", "-10")),
            label_offset_y_px=_parse_integer(values.get("LABEL_OFFSET_Y", "-20")),
            layer_id=layer_id,
        ),
        connection_type=ConnectionType(values.get("CONN_TYPE", "DIRECT")),
        control_points_px=_parse_pixels(values.get("CONTROL_POINTS", "")),
        color=color,
    )


def _parse_pixels(text: str) -> tuple[tuple[int, int], ...]:
    """Parse `x,y;x,y`; raises ValueError."""
    pairs = (pair.split(",") for pair in text.split(";") if pair.strip())
    return tuple((_parse_integer(x), _parse_integer(y)) for x, y in pairs)


def _parse_integer(text: str) -> int:
    if INTEGER.fullmatch(text.strip()) is None:
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)


FRAME_TOLERANCE_MM: Final = 1
"""Maximum distance between model and drawn position of an object that count as equal."""

# BEZIER is one cubic curve, BEZIER_3 two that join at the third point.
_CONTROL_POINTS: Final[Mapping[ConnectionType, int]] = MappingProxyType(
    {
        ConnectionType.BEZIER: 2,
        ConnectionType.BEZIER_3: 5,
    }
)


def same_place(model_mm: tuple[int, int], drawn_mm: tuple[int, int]) -> bool:
    """Return whether a position in the model equals one in the layout."""
    return all(
        abs(model - drawn) <= FRAME_TOLERANCE_MM for model, drawn in zip(model_mm, drawn_mm, strict=True)
    )


def path_layout(path: XmlObject, drawn: Drawn, layout: VisualLayout, *, same_frame: bool) -> PathLayout:
    """Return the path's layout with control points in mm of the plant frame.

    Control points belong to the layout's frame. If the path's ends lie elsewhere there than in the model
    (`same_frame` is false), or their number does not fit the curve, they are dropped with a warning.
    """
    reason = _reason_to_drop(drawn, same_frame=same_frame)
    if reason:
        path.warn("CONTROL_POINTS_DROPPED", f"{reason}; the path is drawn as a straight line")
        return PathLayout(layer_id=drawn.label.layer_id)
    return PathLayout(
        connection_type=drawn.connection_type,
        control_points=tuple(
            # The layout's y grows downwards.
            LayoutPoint(x_mm=x * layout.scale_x_mm_per_px, y_mm=-y * layout.scale_y_mm_per_px)
            for x, y in drawn.control_points_px
        ),
        layer_id=drawn.label.layer_id,
    )


def _reason_to_drop(drawn: Drawn, *, same_frame: bool) -> str:
    found = len(drawn.control_points_px)
    wanted = _CONTROL_POINTS.get(drawn.connection_type, found)
    if found != wanted:
        return f"{drawn.connection_type} needs {wanted} control points and has {found}"
    if found and not same_frame:
        return (
            "its end points lie elsewhere in the drawing than in the model, so its control points do not fit"
        )
    return ""


_POSITION: Final = ("positionX", "positionY", "positionZ")
_OLD_POSITION: Final = ("xPosition", "yPosition", "zPosition")
_OLD_POINT_TYPES: Final = MappingProxyType({"REPORT_POSITION": PointType.HALT_POSITION})
_OLD_TRIGGERS: Final = MappingProxyType({"BEFORE_MOVEMENT": ExecutionTrigger.AFTER_ALLOCATION})


class TrackReader:
    """Read points, then paths: the drawing of a path depends on its end points."""

    def __init__(self, drawing: Drawing) -> None:
        self._read_drawing = drawing
        self._positions_mm: dict[str, tuple[int, int]] = {}
        self._outgoing: dict[str, set[str]] = {}
        self.displaced: set[str] = set()
        """Points that are drawn away from their model position, or not at all."""

    def point(self, obj: XmlObject) -> Point:
        """Read a point."""
        drawn = self._read_drawing.of(obj, "pointLayout")
        x_mm, y_mm, z_mm = position_mm(obj)
        self._positions_mm[obj.name] = (x_mm, y_mm)
        # Redundant in the format: the paths count, and a difference is only a warning.
        self._outgoing[obj.name] = {child.text("name") for child in obj.children("outgoingPath")}
        # Since 7.0.0, model and drawing have the same positions.
        drawn_mm = (x_mm, y_mm) if obj.findings.version is FormatVersion.V7_0_0 else drawn.position_mm
        if drawn_mm is None or not same_place((x_mm, y_mm), drawn_mm):
            self.displaced.add(obj.name)
        return Point(
            name=obj.name or "?",
            x_mm=x_mm,
            y_mm=y_mm,
            z_mm=z_mm,
            orientation_deg=obj.angle("vehicleOrientationAngle"),
            type=obj.choice("type", PointType, obj.if_old(PointType.HALT_POSITION), renamed=_OLD_POINT_TYPES),
            max_vehicle_bounding_box=bounding_box(obj, "maxVehicleBoundingBox"),
            envelopes=_read_envelopes(obj),
            properties=obj.properties(),
            layout=drawn.label,
        )

    def path(self, obj: XmlObject) -> Path:
        """Read a path, after its points."""
        source, destination = obj.text("sourcePoint"), obj.text("destinationPoint")
        drawn = self._read_drawing.of(obj, "pathLayout")
        return Path(
            name=obj.name or "?",
            source=source,
            destination=destination,
            length_mm=self._length_mm(obj, source, destination),
            **given_speeds(obj, max_velocity_mm_s="maxVelocity"),
            # No default above 0: it would open the path to driving backwards.
            max_reverse_velocity_mm_s=obj.integer("maxReverseVelocity", obj.if_old(0), minimum=0),
            locked=obj.boolean("locked", obj.if_old(value=False)),
            peripheral_operations=tuple(
                _peripheral_operation(child) for child in obj.children("peripheralOperation")
            ),
            envelopes=_read_envelopes(obj),
            properties=obj.properties(),
            layout=path_layout(
                obj,
                drawn,
                self._read_drawing.visual_layout,
                same_frame=self.displaced.isdisjoint((source, destination)),
            ),
        )

    def warn_of_differences(self, model: XmlObject, paths: Iterable[Path]) -> None:
        """Report contradictions: wrong outgoingPath elements, and a drawing in another frame."""
        actual: dict[str, set[str]] = {}
        for path in paths:
            actual.setdefault(path.source, set()).add(path.name)
        for point, listed in self._outgoing.items():
            if listed != (expected := actual.get(point, set())):
                text = f"outgoingPath elements and paths differ in {sorted(listed ^ expected)}"
                model.findings.warn("OUTGOING_PATHS_DIFFER", ObjectKind.POINT, point, text)
        if self.displaced and model.findings.version is not FormatVersion.V7_0_0:
            text = f"{len(self.displaced)} of {len(self._positions_mm)} points are not drawn where they are"
            model.warn("FRAMES_DIFFER", f"{text}, or not at all; the model's positions are used")

    def _length_mm(self, obj: XmlObject, source: str, destination: str) -> int:
        ends = (self._positions_mm.get(source), self._positions_mm.get(destination))
        if obj.has("length") or not obj.findings.is_old or ends[0] is None or ends[1] is None:
            return obj.integer("length", obj.if_old(1), minimum=1)
        distance = hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1])
        obj.warn("DEFAULTED", "length is missing; the distance of the end points is used")
        return max(1, round(distance))


def position_mm(obj: XmlObject, *, optional: bool = False) -> tuple[int, int, int]:
    """Read a position in mm of the plant frame; if `optional`, formats before 6.0.0 may leave it out."""
    x, y, z = _OLD_POSITION if obj.findings.is_old else _POSITION
    default = obj.if_old(0)
    xy_default = default if optional else None
    return obj.integer(x, xy_default), obj.integer(y, xy_default), obj.integer(z, default)


def bounding_box(obj: XmlObject, tag: str) -> BoundingBox:
    """Read a bounding box; the default is one metre in each direction."""
    boxes = [
        BoundingBox(
            length_mm=child.integer("length", minimum=1),
            width_mm=child.integer("width", minimum=1),
            height_mm=child.integer("height", minimum=1),
            reference_offset_x_mm=child.integer("referenceOffsetX", 0),
            reference_offset_y_mm=child.integer("referenceOffsetY", 0),
        )
        for child in obj.children(tag)
    ]
    return boxes[0] if boxes else BoundingBox()


def given_speeds(obj: XmlObject, **attributes: str) -> dict[str, Any]:
    """Return speeds in mm/s by field; those missing in old formats keep the model's default instead of 0."""
    speeds: dict[str, Any] = {}
    for name, attribute in attributes.items():
        if obj.findings.is_old and not obj.has(attribute):
            # openTCS reads 0, which is hardly meant; 1000 is its own default for new objects.
            obj.warn("DEFAULTED", f"{attribute} is missing; 1000 mm/s is used")
        else:
            speeds[name] = obj.integer(attribute, minimum=0)
    return speeds


def _read_envelopes(obj: XmlObject) -> tuple[Envelope, ...]:
    return tuple(
        Envelope(
            key=child.text("key"),
            vertices=tuple(
                PlantVertex(x_mm=vertex.integer("x"), y_mm=vertex.integer("y"))
                for vertex in child.children("vertex")
            ),
        )
        for child in obj.children("vehicleEnvelope")
    )


def _peripheral_operation(child: XmlObject) -> PeripheralOperation:
    return PeripheralOperation(
        name=child.text("name"),
        location=child.text("locationName"),
        execution_trigger=child.choice(
            "executionTrigger", ExecutionTrigger, ExecutionTrigger.AFTER_ALLOCATION, renamed=_OLD_TRIGGERS
        ),
        completion_required=child.boolean("completionRequired", default=False),
    )


def read_location_type(obj: XmlObject, drawing: Drawing) -> LocationType:
    """Read a location type."""
    return LocationType(
        name=obj.name or "?",
        allowed_operations=_read_names(obj, "allowedOperation"),
        allowed_peripheral_operations=_read_names(obj, "allowedPeripheralOperation"),
        properties=obj.properties(),
        representation=drawing.of(obj, "locationTypeLayout").representation,
    )


def read_location(obj: XmlObject, drawing: Drawing, *, same_frame: bool) -> Location:
    """Read a location; `same_frame`: drawing and model agree on the positions of points."""
    drawn = drawing.of(obj, "locationLayout")
    x_mm, y_mm, z_mm = position_mm(obj, optional=True)
    return Location(
        name=obj.name or "?",
        type=obj.text("type"),
        x_mm=x_mm,
        y_mm=y_mm,
        z_mm=z_mm,
        locked=obj.boolean("locked", obj.if_old(value=False)),
        links=tuple(_read_link(child) for child in obj.children("link")),
        properties=obj.properties(),
        layout=LocationLayout(
            **dict(drawn.label),
            representation=drawn.representation,
            position=_drawn_elsewhere(obj, (x_mm, y_mm), drawn, same_frame=same_frame),
        ),
    )


def read_block(obj: XmlObject, drawing: Drawing) -> Block:
    """Read a block."""
    optional_type = obj.findings.version is FormatVersion.V0_0_2
    return Block(
        name=obj.name or "?",
        type=obj.choice("type", BlockType, BlockType.SINGLE_VEHICLE_ONLY if optional_type else None),
        members=_read_names(obj, "member"),
        properties=obj.properties(),
        color=drawing.of(obj, "blockLayout").color,
    )


def _read_link(child: XmlObject) -> Link:
    return Link(point=child.text("point"), allowed_operations=_read_names(child, "allowedOperation"))


def _read_names(obj: XmlObject, tag: str) -> tuple[str, ...]:
    return tuple(child.text("name") for child in obj.children(tag))


def _drawn_elsewhere(
    obj: XmlObject, model_mm: tuple[int, int], drawn: Drawn, *, same_frame: bool
) -> PlantVertex | None:
    """Return the drawn position of a location, if it differs from the model in the same frame."""
    if drawn.position_mm is None or same_place(model_mm, drawn.position_mm) or not same_frame:
        return None
    obj.warn(
        "DRAWN_ELSEWHERE",
        f"the model has it at {model_mm} mm, the drawing at {drawn.position_mm} mm; it is drawn there",
    )
    return PlantVertex(x_mm=drawn.position_mm[0], y_mm=drawn.position_mm[1])


def read_vehicle(obj: XmlObject, drawing: Drawing) -> Vehicle:
    """Read a vehicle."""
    return Vehicle(
        name=obj.name or "?",
        bounding_box=_bounding_box(obj),
        energy_thresholds=_read_thresholds(obj),
        **given_speeds(obj, max_velocity_mm_s="maxVelocity", max_reverse_velocity_mm_s="maxReverseVelocity"),
        envelope_key=obj.optional_text("envelopeKey"),
        properties=obj.properties(),
        color=drawing.of(obj, "vehicleLayout").color,
    )


def _bounding_box(obj: XmlObject) -> BoundingBox:
    """Read the size; formats before 6.0.0 have only a length."""
    if obj.findings.is_old:
        return BoundingBox(length_mm=obj.integer("length", 1000, minimum=1))
    return bounding_box(obj, "boundingBox")


def _read_thresholds(obj: XmlObject) -> EnergyThresholds:
    # openTCS's own defaults for new vehicles; missing ones of an old file it reads as 0.
    critical = _read_energy_level(obj, "energyLevelCritical", 30)
    good = _read_energy_level(obj, "energyLevelGood", 90)
    sufficient = _read_energy_level(obj, "energyLevelSufficientlyRecharged", 30)
    full = _read_energy_level(obj, "energyLevelFullyRecharged", 90)
    critical, good = _in_order(obj, "critical", critical, "good", good)
    sufficient, full = _in_order(obj, "sufficiently recharged", sufficient, "fully recharged", full)
    return EnergyThresholds(
        critical=critical, good=good, sufficiently_recharged=sufficient, fully_recharged=full
    )


def _read_energy_level(obj: XmlObject, attribute: str, default: int) -> int:
    if obj.findings.is_old and not obj.has(attribute):
        obj.warn("DEFAULTED", f"{attribute} is missing; {default} % is used")
    return obj.integer(attribute, obj.if_old(default), minimum=0, maximum=100)


def _in_order(obj: XmlObject, low_name: str, low: int, high_name: str, high: int) -> tuple[int, int]:
    """Return lower and higher threshold; old formats may have them swapped, newer ones must not."""
    if low <= high:
        return low, high
    text = f"energy thresholds are swapped: {low_name} {low} % is above {high_name} {high} %"
    if obj.findings.is_old:
        # A real plant of format 0.0.2 has fully recharged at 30 % and sufficiently at 90 %.
        obj.warn("THRESHOLDS_SWAPPED", f"{text}; corrected")
    else:
        obj.error("THRESHOLDS_CROSSED", text)
    return high, low
