"""Makes the XML elements of the objects of a plant model, children in the order that format 7.0.0 demands."""

from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

from nena_shared.plant.block import Block
from nena_shared.plant.geometry import BoundingBox, Envelope
from nena_shared.plant.location import Location, LocationType
from nena_shared.plant.path import Path
from nena_shared.plant.point import Point
from nena_shared.plant.vehicle import Vehicle
from nena_shared.plant.visual_layout import Layer, LayerGroup, VisualLayout

Value = str | bool | float | None


def add(parent: Element, tag: str, **attributes: Value) -> Element:
    """Add an element; attributes that are None are left out."""
    written = {name: _text(value) for name, value in attributes.items() if value is not None}
    return SubElement(parent, tag, written)


def _text(value: str | bool | float) -> str:  # noqa: FBT001 - one of the values
    return str(value).lower() if isinstance(value, bool) else str(value)


def add_point(parent: Element, point: Point, outgoing: Iterable[str]) -> None:
    """Add a point with the names of the paths that begin there."""
    element = add(
        parent,
        "point",
        name=point.name,
        positionX=point.x_mm,
        positionY=point.y_mm,
        positionZ=point.z_mm,
        vehicleOrientationAngle="NaN" if point.orientation_deg is None else point.orientation_deg,
        type=point.type,
    )
    _add_bounding_box(element, "maxVehicleBoundingBox", point.max_vehicle_bounding_box)
    _add_envelopes(element, point.envelopes)
    _add_names(element, "outgoingPath", outgoing)
    add_properties(element, point.properties)
    label = point.layout
    add(
        element,
        "pointLayout",
        labelOffsetX=label.label_offset_x_px,
        labelOffsetY=label.label_offset_y_px,
        layerId=label.layer_id,
    )


def add_path(parent: Element, path: Path, layout: VisualLayout) -> None:
    """Add a path; its control points become pixels of the layout."""
    element = add(
        parent,
        "path",
        name=path.name,
        sourcePoint=path.source,
        destinationPoint=path.destination,
        length=path.length_mm,
        maxVelocity=path.max_velocity_mm_s,
        maxReverseVelocity=path.max_reverse_velocity_mm_s,
        locked=path.locked,
    )
    for operation in path.peripheral_operations:
        add(
            element,
            "peripheralOperation",
            name=operation.name,
            locationName=operation.location,
            executionTrigger=operation.execution_trigger,
            completionRequired=operation.completion_required,
        )
    _add_envelopes(element, path.envelopes)
    add_properties(element, path.properties)
    _add_course(element, path, layout)


def add_vehicle(parent: Element, vehicle: Vehicle) -> None:
    """Add a vehicle."""
    thresholds = vehicle.energy_thresholds
    element = add(
        parent,
        "vehicle",
        name=vehicle.name,
        energyLevelCritical=thresholds.critical,
        energyLevelGood=thresholds.good,
        energyLevelFullyRecharged=thresholds.fully_recharged,
        energyLevelSufficientlyRecharged=thresholds.sufficiently_recharged,
        maxVelocity=vehicle.max_velocity_mm_s,
        maxReverseVelocity=vehicle.max_reverse_velocity_mm_s,
        envelopeKey=vehicle.envelope_key,
    )
    _add_bounding_box(element, "boundingBox", vehicle.bounding_box)
    add_properties(element, vehicle.properties)
    _add_color(element, "vehicleLayout", vehicle.color)


def add_location_type(parent: Element, location_type: LocationType) -> None:
    """Add a location type."""
    element = add(parent, "locationType", name=location_type.name)
    _add_names(element, "allowedOperation", location_type.allowed_operations)
    _add_names(element, "allowedPeripheralOperation", location_type.allowed_peripheral_operations)
    add_properties(element, location_type.properties)
    if location_type.representation is not None:
        add(element, "locationTypeLayout", locationRepresentation=location_type.representation)


def add_location(parent: Element, location: Location) -> None:
    """Add a location with its links."""
    element = add(
        parent,
        "location",
        name=location.name,
        positionX=location.x_mm,
        positionY=location.y_mm,
        positionZ=location.z_mm,
        type=location.type,
        locked=location.locked,
    )
    for link in location.links:
        _add_names(add(element, "link", point=link.point), "allowedOperation", link.allowed_operations)
    add_properties(element, location.properties)
    layout = location.layout
    add(
        element,
        "locationLayout",
        labelOffsetX=layout.label_offset_x_px,
        labelOffsetY=layout.label_offset_y_px,
        locationRepresentation=layout.representation,
        layerId=layout.layer_id,
    )


def add_block(parent: Element, block: Block) -> None:
    """Add a block."""
    element = add(parent, "block", name=block.name, type=block.type)
    _add_names(element, "member", block.members)
    add_properties(element, block.properties)
    _add_color(element, "blockLayout", block.color)


def add_visual_layout(
    parent: Element, layout: VisualLayout, layers: Iterable[Layer], groups: Iterable[LayerGroup]
) -> None:
    """Add the visual layout with these layers and groups."""
    scales = (layout.scale_x_mm_per_px, layout.scale_y_mm_per_px)
    element = add(parent, "visualLayout", name=layout.name, scaleX=scales[0], scaleY=scales[1])
    for layer in layers:
        add(
            element,
            "layer",
            id=layer.id,
            ordinal=layer.ordinal,
            visible=layer.visible,
            name=layer.name,
            groupId=layer.group_id,
        )
    for group in groups:
        add(element, "layerGroup", id=group.id, name=group.name, visible=group.visible)
    add_properties(element, layout.properties)


def add_properties(parent: Element, properties: Mapping[str, str]) -> None:
    """Add the properties of an object."""
    for key, value in properties.items():
        add(parent, "property", name=key, value=value)


def _add_bounding_box(parent: Element, tag: str, box: BoundingBox) -> None:
    add(
        parent,
        tag,
        length=box.length_mm,
        width=box.width_mm,
        height=box.height_mm,
        referenceOffsetX=box.reference_offset_x_mm,
        referenceOffsetY=box.reference_offset_y_mm,
    )


def _add_envelopes(parent: Element, envelopes: Iterable[Envelope]) -> None:
    for envelope in envelopes:
        element = add(parent, "vehicleEnvelope", key=envelope.key)
        for vertex in envelope.vertices:
            add(element, "vertex", x=vertex.x_mm, y=vertex.y_mm)


def _add_course(parent: Element, path: Path, layout: VisualLayout) -> None:
    drawn = path.layout
    element = add(parent, "pathLayout", connectionType=drawn.connection_type, layerId=drawn.layer_id)
    for point in drawn.control_points:
        # The layout's y grows downwards.
        x_px, y_px = point.x_mm / layout.scale_x_mm_per_px, -point.y_mm / layout.scale_y_mm_per_px
        add(element, "controlPoint", x=round(x_px), y=round(y_px))


def _add_names(parent: Element, tag: str, names: Iterable[str]) -> None:
    for name in names:
        add(parent, tag, name=name)


def _add_color(parent: Element, tag: str, color: str | None) -> None:
    if color is not None:
        add(parent, tag, color=color)
