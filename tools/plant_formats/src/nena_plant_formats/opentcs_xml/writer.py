"""Write plant models as openTCS XML 7.0.0 (openTCS 6.7 and 7.x), in the model's order."""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from nena_plant_formats.exchange import ExportReport
from nena_plant_formats.lif.losses import rules_of_types
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import (
    Block,
    Layer,
    LayerGroup,
    Location,
    LocationType,
    PlantModel,
    Vehicle,
    VisualLayout,
)
from nena_shared.plant.track import BoundingBox, Envelope, Path, Point
from nena_shared.plant_terms import ExecutionTrigger

Value = str | bool | float | None


def add(parent: Element, tag: str, **attributes: Value) -> Element:
    """Add an element; attributes that are None are omitted."""
    written = {name: _text_of(value) for name, value in attributes.items() if value is not None}
    return SubElement(parent, tag, written)


def _text_of(value: str | bool | float) -> str:  # noqa: FBT001 - one of the values
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
        # 7.0.0 requires the attribute; NaN stands for any heading.
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
    """Add a path; its control points are converted to pixels of the layout."""
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
            executionTrigger=_TRIGGERS.get(operation.execution_trigger, operation.execution_trigger),
            completionRequired=operation.completion_required,
        )
    _add_envelopes(element, path.envelopes)
    add_properties(element, path.properties)
    _add_path_layout(element, path, layout)


_TRIGGERS: Final = dict.fromkeys(
    (ExecutionTrigger.IMMEDIATE, ExecutionTrigger.BEFORE_ALLOCATION), ExecutionTrigger.AFTER_ALLOCATION
)
"""Triggers that the file format lacks, and the ones that openTCS takes instead."""


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


def _add_path_layout(parent: Element, path: Path, layout: VisualLayout) -> None:
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


VERSION: Final = "7.0.0"
_NOT_XML: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot represent, not even escaped."""


def write(model: PlantModel) -> ExportReport:
    """Write a plant model. Reading the result returns the same model, except for the losses in the warnings.

    Raises PlantModelError for names and values with characters that XML cannot represent.
    """
    root = Element("model", version=VERSION, name=model.name)
    _add_objects(root, model)
    layers = tuple(_all_layers(model))
    add_visual_layout(root, model.visual_layout, layers, _layer_groups(model, layers))
    add_properties(root, model.properties)
    if problems := tuple(_find_unwritable(root)):
        raise PlantModelError(problems)
    indent(root, "    ")
    data: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return ExportReport(data + b"\n", tuple(_export_warnings(model)))


def _add_objects(root: Element, model: PlantModel) -> None:
    outgoing: defaultdict[str, list[str]] = defaultdict(list)
    for path in model.paths:
        outgoing[path.source].append(path.name)
    for point in model.points:
        add_point(root, point, outgoing[point.name])
    for path in model.paths:
        add_path(root, path, model.visual_layout)
    for vehicle in model.vehicles:
        add_vehicle(root, vehicle)
    for location_type in model.location_types:
        add_location_type(root, location_type)
    for location in model.locations:
        add_location(root, location)
    for block in model.blocks:
        add_block(root, block)


def _all_layers(model: PlantModel) -> Iterator[Layer]:
    """Yield the layers, including those that are used but not defined; openTCS requires at least one."""
    layers = model.visual_layout.layers
    yield from layers
    used = {
        *(point.layout.layer_id for point in model.points),
        *(path.layout.layer_id for path in model.paths),
        *(location.layout.layer_id for location in model.locations),
    }
    missing = used - {layer.id for layer in layers}
    for number in sorted(missing or ({0} if not layers else ())):
        yield Layer(id=number, ordinal=number, name=f"Layer {number}")


def _layer_groups(model: PlantModel, layers: tuple[Layer, ...]) -> Iterator[LayerGroup]:
    groups = model.visual_layout.layer_groups
    yield from groups
    for number in sorted({layer.group_id for layer in layers} - {group.id for group in groups}):
        yield LayerGroup(id=number, name=f"Group {number}")


def _export_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    if any(point.vehicle_types for point in model.points) or any(path.vehicle_types for path in model.paths):
        text = "rules per vehicle type (LIF) are lost: elements closed to some types become open to all"
        yield PlantProblem("NOT_EXPORTED", ObjectKind.MODEL, model.name, text)
        for what, times in rules_of_types(model):
            if times:
                text = f"LIF: {what} ({times} times): not representable in openTCS"
                yield PlantProblem("NOT_EXPORTED", ObjectKind.MODEL, model.name, text)
    for path in model.paths:
        for operation in path.peripheral_operations:
            if operation.execution_trigger in _TRIGGERS:
                text = f"trigger {operation.execution_trigger} of {operation.name!r} becomes AFTER_ALLOCATION"
                yield PlantProblem("NOT_EXPORTED", ObjectKind.PATH, path.name, text)
    for location in model.locations:
        if location.layout.position is not None:
            text = "its separate position in the drawing is lost"
            yield PlantProblem("NOT_EXPORTED", ObjectKind.LOCATION, location.name, text)


def _find_unwritable(root: Element) -> Iterator[PlantProblem]:
    """Yield a problem for each attribute that XML cannot represent."""
    for element in root.iter():
        # ElementTree would write them, and no parser would read the file again.
        for attribute, value in element.items():
            if _NOT_XML.search(value):
                text = f"{attribute} of element {element.tag!r} has a character that XML cannot represent"
                yield PlantProblem("UNWRITABLE_TEXT", ObjectKind.MODEL, value, text)
