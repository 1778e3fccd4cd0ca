"""Reads location types, locations and blocks."""

from nena_shared.plant.block import Block, BlockType
from nena_shared.plant.geometry import Vertex
from nena_shared.plant.location import Link, Location, LocationLayout, LocationType
from nena_shared.plant.opentcs_xml.course import same_place
from nena_shared.plant.opentcs_xml.drawing import Drawing, Drawn
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.track import position_mm
from nena_shared.plant.opentcs_xml.xml_object import XmlObject


def read_location_type(obj: XmlObject, drawing: Drawing) -> LocationType:
    """Read one location type."""
    return LocationType(
        name=obj.name or "?",
        allowed_operations=_names(obj, "allowedOperation"),
        allowed_peripheral_operations=_names(obj, "allowedPeripheralOperation"),
        properties=obj.properties(),
        representation=drawing.of(obj, "locationTypeLayout").representation,
    )


def read_location(obj: XmlObject, drawing: Drawing, *, same_frame: bool) -> Location:
    """Read one location; `same_frame` says that drawing and model agree on where the points are."""
    drawn = drawing.of(obj, "locationLayout")
    x_mm, y_mm, z_mm = position_mm(obj, optional=True)
    return Location(
        name=obj.name or "?",
        type=obj.text("type"),
        x_mm=x_mm,
        y_mm=y_mm,
        z_mm=z_mm,
        locked=obj.boolean("locked", obj.if_old(value=False)),
        links=tuple(_link(child) for child in obj.children("link")),
        properties=obj.properties(),
        layout=LocationLayout(
            **dict(drawn.label),
            representation=drawn.representation,
            position=_drawn_elsewhere(obj, (x_mm, y_mm), drawn, same_frame=same_frame),
        ),
    )


def read_block(obj: XmlObject, drawing: Drawing) -> Block:
    """Read one block."""
    optional_type = obj.notes.version is FormatVersion.V0_0_2
    return Block(
        name=obj.name or "?",
        type=obj.choice("type", BlockType, BlockType.SINGLE_VEHICLE_ONLY if optional_type else None),
        members=_names(obj, "member"),
        properties=obj.properties(),
        color=drawing.of(obj, "blockLayout").color,
    )


def _link(child: XmlObject) -> Link:
    return Link(point=child.text("point"), allowed_operations=_names(child, "allowedOperation"))


def _names(obj: XmlObject, tag: str) -> tuple[str, ...]:
    return tuple(child.text("name") for child in obj.children(tag))


def _drawn_elsewhere(
    obj: XmlObject, model_mm: tuple[int, int], drawn: Drawn, *, same_frame: bool
) -> Vertex | None:
    """Return where an old drawing shows a location, if that is another place of the same frame."""
    if drawn.position_mm is None or same_place(model_mm, drawn.position_mm) or not same_frame:
        return None
    obj.warn(
        "DRAWN_ELSEWHERE",
        f"the model has it at {model_mm} mm, the drawing at {drawn.position_mm} mm; it is drawn there",
    )
    return Vertex(x_mm=drawn.position_mm[0], y_mm=drawn.position_mm[1])
