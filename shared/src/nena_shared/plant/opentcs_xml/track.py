"""Reads points and paths."""

from collections.abc import Iterable
from math import hypot
from types import MappingProxyType
from typing import Final

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import BoundingBox, Envelope, Vertex
from nena_shared.plant.opentcs_xml.course import course, same_place
from nena_shared.plant.opentcs_xml.drawing import Drawing
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.path import ExecutionTrigger, Path, PeripheralOperation
from nena_shared.plant.point import Point, PointType

_POSITION: Final = ("positionX", "positionY", "positionZ")
_OLD_POSITION: Final = ("xPosition", "yPosition", "zPosition")
_OLD_POINT_TYPES: Final = MappingProxyType({"REPORT_POSITION": PointType.HALT_POSITION})
_OLD_TRIGGERS: Final = MappingProxyType({"BEFORE_MOVEMENT": ExecutionTrigger.AFTER_ALLOCATION})


class TrackReader:
    """Reads the points first, then the paths between them: the drawn course of a path depends on its ends."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self._positions_mm: dict[str, tuple[int, int]] = {}
        self._outgoing: dict[str, set[str]] = {}
        self.displaced: set[str] = set()
        """The points that the drawing shows elsewhere than the model, or not at all."""

    def point(self, obj: XmlObject) -> Point:
        """Read one point."""
        drawn = self._drawing.of(obj, "pointLayout")
        x_mm, y_mm, z_mm = position_mm(obj)
        self._positions_mm[obj.name] = (x_mm, y_mm)
        self._outgoing[obj.name] = {child.text("name") for child in obj.children("outgoingPath")}
        drawn_mm = (x_mm, y_mm) if obj.notes.version is FormatVersion.V7_0_0 else drawn.position_mm
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
            envelopes=_envelopes(obj),
            properties=obj.properties(),
            layout=drawn.label,
        )

    def path(self, obj: XmlObject) -> Path:
        """Read one path; its points must have been read."""
        source, destination = obj.text("sourcePoint"), obj.text("destinationPoint")
        drawn = self._drawing.of(obj, "pathLayout")
        return Path(
            name=obj.name or "?",
            source=source,
            destination=destination,
            length_mm=self._length_mm(obj, source, destination),
            max_velocity_mm_s=speed_mm_s(obj, "maxVelocity", 1000),
            max_reverse_velocity_mm_s=obj.integer("maxReverseVelocity", obj.if_old(0), minimum=0),
            locked=obj.boolean("locked", obj.if_old(value=False)),
            peripheral_operations=tuple(
                _peripheral_operation(child) for child in obj.children("peripheralOperation")
            ),
            envelopes=_envelopes(obj),
            properties=obj.properties(),
            layout=course(
                obj,
                drawn,
                self._drawing.visual_layout,
                same_frame=self.displaced.isdisjoint((source, destination)),
            ),
        )

    def warn_of_differences(self, model: XmlObject, paths: Iterable[Path]) -> None:
        """Note where the file contradicts itself: outgoingPath elements, and a drawing in another frame."""
        actual: dict[str, set[str]] = {}
        for path in paths:
            actual.setdefault(path.source, set()).add(path.name)
        for point, listed in self._outgoing.items():
            if listed != (expected := actual.get(point, set())):
                text = f"its outgoingPath elements and the paths differ in {sorted(listed ^ expected)}"
                model.notes.warn("OUTGOING_PATHS_DIFFER", ObjectKind.POINT, point, text)
        if self.displaced and model.notes.version is not FormatVersion.V7_0_0:
            text = f"{len(self.displaced)} of {len(self._positions_mm)} points are not drawn where they are"
            model.warn("FRAMES_DIFFER", f"{text}, or not at all; the model's positions count")

    def _length_mm(self, obj: XmlObject, source: str, destination: str) -> int:
        ends = (self._positions_mm.get(source), self._positions_mm.get(destination))
        if obj.has("length") or not obj.notes.is_old or ends[0] is None or ends[1] is None:
            return obj.integer("length", obj.if_old(1), minimum=1)
        distance = hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1])
        obj.warn("DEFAULTED", "length is missing, the distance of the end points is used")
        return max(1, round(distance))


def position_mm(obj: XmlObject, *, optional: bool = False) -> tuple[int, int, int]:
    """Read a position in mm of the plant frame; if `optional`, formats before 6.0.0 may leave it out."""
    x, y, z = _OLD_POSITION if obj.notes.is_old else _POSITION
    default = obj.if_old(0)
    xy_default = default if optional else None
    return obj.integer(x, xy_default), obj.integer(y, xy_default), obj.integer(z, default)


def bounding_box(obj: XmlObject, tag: str) -> BoundingBox:
    """Read a bounding box; formats that have none give the default of a metre in each direction."""
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


def speed_mm_s(obj: XmlObject, attribute: str, default: int) -> int:
    """Read a speed in mm/s; a missing one in old formats is hardly meant as 0, so `default` is used."""
    if obj.notes.is_old and not obj.has(attribute):
        obj.warn("DEFAULTED", f"{attribute} is missing, {default} mm/s is used")
    return obj.integer(attribute, obj.if_old(default), minimum=0)


def _envelopes(obj: XmlObject) -> tuple[Envelope, ...]:
    return tuple(
        Envelope(
            key=child.text("key"),
            vertices=tuple(
                Vertex(x_mm=vertex.integer("x"), y_mm=vertex.integer("y"))
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
