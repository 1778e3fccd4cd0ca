"""How objects are drawn. Up to format 0.0.3 the visual layout holds it all, later each object its part."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from nena_shared.plant.geometry import LabelLayout
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.xml_object import COLOR, INTEGER, XmlObject
from nena_shared.plant.path import ConnectionType
from nena_shared.plant.visual_layout import Layer, LayerGroup, VisualLayout


@dataclass(frozen=True, slots=True)
class Drawn:
    """How one object is drawn: positions in mm of the layout's own frame, control points in its pixels."""

    position_mm: tuple[int, int] | None = None
    label: LabelLayout = field(default_factory=LabelLayout)
    connection_type: ConnectionType = ConnectionType.DIRECT
    control_points_px: tuple[tuple[int, int], ...] = ()
    representation: str | None = None
    color: str | None = None


@dataclass(frozen=True, slots=True)
class Drawing:
    """The visual layout, and what old formats keep in it for each object by name."""

    visual_layout: VisualLayout = field(default_factory=VisualLayout)
    _elements: Mapping[str, Drawn] = field(default_factory=dict)

    def of(self, obj: XmlObject, tag: str) -> Drawn:
        """Return how an object is drawn; `tag` is the child that says so in newer formats."""
        if obj.notes.version.has_layout_elements:
            return self._elements.get(obj.name, Drawn())
        drawn = [_drawn_by_child(child, tag) for child in obj.children(tag)]
        return drawn[0] if drawn else Drawn()


def read_drawing(layouts: Iterator[XmlObject]) -> Drawing:
    """Read the first visual layout; a second one is reported and passed over."""
    drawing: Drawing | None = None
    for layout in layouts:
        if drawing is None:
            drawing = _drawing(layout)
        else:
            layout.warn("DRAWING_DROPPED", "only the first visual layout is used")
    return drawing or Drawing()


def _drawing(layout: XmlObject) -> Drawing:
    elements = dict(_layout_elements(layout)) if layout.notes.version.has_layout_elements else {}
    visual_layout = VisualLayout(
        name=layout.text("name"),
        scale_x_mm_per_px=layout.scale("scaleX", 50.0),
        scale_y_mm_per_px=layout.scale("scaleY", 50.0),
        layers=tuple(_layer(child) for child in layout.children("layer")),
        layer_groups=tuple(_layer_group(child) for child in layout.children("layerGroup")),
        properties=layout.properties(),
    )
    return Drawing(visual_layout, elements)


def _layer(child: XmlObject) -> Layer:
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
    """Read pointLayout, pathLayout, locationLayout, vehicleLayout and the like, in formats from 0.0.4 on."""
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
                label=_label(child),
                representation=child.optional_text("locationRepresentation"),
            )
        case _:
            return Drawn(
                representation=child.optional_text("locationRepresentation"), color=child.color("color")
            )


def _position_mm(child: XmlObject) -> tuple[int, int] | None:
    x, y = ("xPosition", "yPosition") if child.notes.is_old else ("positionX", "positionY")
    if child.notes.version >= FormatVersion.V7_0_0 or not (child.has(x) and child.has(y)):
        return None
    return child.integer(x), child.integer(y)


def _label(child: XmlObject) -> LabelLayout:
    old = child.notes.is_old
    x, y = ("xLabelOffset", "yLabelOffset") if old else ("labelOffsetX", "labelOffsetY")
    return LabelLayout(
        label_offset_x_px=child.integer(x, -10),
        label_offset_y_px=child.integer(y, -20),
        layer_id=child.integer("layerId", 0),
    )


def _layout_elements(layout: XmlObject) -> Iterator[tuple[str, Drawn]]:
    """Yield what a layout of format 0.0.2 or 0.0.3 says for each object."""
    for element in layout.children("modelLayoutElement"):
        name = element.text("visualizedObjectName")
        layer_id = element.integer("layer", 0)
        try:
            yield name, _drawn_by_properties(element.properties(), layer_id)
        except ValueError as error:
            element.warn("DRAWING_DROPPED", f"{name!r} is drawn in the default way: {error}")


def _drawn_by_properties(values: Mapping[str, str], layer_id: int) -> Drawn:
    position = tuple(_integer(values[key]) for key in ("POSITION_X", "POSITION_Y") if key in values)
    color = values.get("ROUTE_COLOR") or values.get("COLOR")
    if color is not None and COLOR.fullmatch(color) is None:
        msg = f"{color!r} is no colour #RRGGBB"
        raise ValueError(msg)
    return Drawn(
        position_mm=(position[0], position[1]) if len(position) == len("xy") else None,
        label=LabelLayout(
            label_offset_x_px=_integer(values.get("LABEL_OFFSET_X", "-10")),
            label_offset_y_px=_integer(values.get("LABEL_OFFSET_Y", "-20")),
            layer_id=layer_id,
        ),
        connection_type=ConnectionType(values.get("CONN_TYPE", "DIRECT")),
        control_points_px=_pixels(values.get("CONTROL_POINTS", "")),
        color=color,
    )


def _pixels(text: str) -> tuple[tuple[int, int], ...]:
    """Parse `x,y;x,y`; raises ValueError."""
    pairs = (pair.split(",") for pair in text.split(";") if pair.strip())
    return tuple((_integer(x), _integer(y)) for x, y in pairs)


def _integer(text: str) -> int:
    if INTEGER.fullmatch(text.strip()) is None:
        msg = f"{text!r} is no whole number"
        raise ValueError(msg)
    return int(text)
