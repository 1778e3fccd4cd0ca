"""Writes plant models in openTCS's XML, format 7.0.0 (openTCS 6.7 and 7.x), in the model's own order."""

import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element, indent, tostring

from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem
from nena_shared.plant.model import PlantModel
from nena_shared.plant.opentcs_xml.elements import (
    add_block,
    add_location,
    add_location_type,
    add_path,
    add_point,
    add_properties,
    add_vehicle,
    add_visual_layout,
)
from nena_shared.plant.reports import ExportReport
from nena_shared.plant.visual_layout import Layer, LayerGroup

VERSION: Final = "7.0.0"
_NOT_XML: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold, not even escaped."""


def write(model: PlantModel) -> ExportReport:
    """Write a plant model; reading the result gives the same model, save what the warnings name.

    Raises PlantModelError for names and values with characters that XML cannot hold.
    """
    root = Element("model", version=VERSION, name=model.name)
    _add_objects(root, model)
    layers = tuple(_layers(model))
    add_visual_layout(root, model.visual_layout, layers, _layer_groups(model, layers))
    add_properties(root, model.properties)
    if problems := tuple(_unwritable(root)):
        raise PlantModelError(problems)
    indent(root, "    ")
    data: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return ExportReport(data + b"\n", tuple(_losses(model)))


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


def _layers(model: PlantModel) -> Iterator[Layer]:
    """Yield the layers, also those that are used and described nowhere; openTCS needs at least one."""
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


def _losses(model: PlantModel) -> Iterator[Problem]:
    if any(point.vehicle_types for point in model.points) or any(path.vehicle_types for path in model.paths):
        text = "rules for vehicle types (LIF) are left out: what is closed for some types will be open to all"
        yield Problem("NOT_EXPORTED", ObjectKind.MODEL, model.name, text)
    for location in model.locations:
        if location.layout.position is not None:
            text = "it is drawn at another place than it has; the drawing will show it where it is"
            yield Problem("NOT_EXPORTED", ObjectKind.LOCATION, location.name, text)


def _unwritable(root: Element) -> Iterator[Problem]:
    """Yield each object whose names or values XML cannot hold."""
    for element in root.iter():
        for attribute, value in element.items():
            if _NOT_XML.search(value):
                text = f"{attribute} of element {element.tag!r} has a character that XML cannot hold"
                yield Problem("UNWRITABLE_TEXT", ObjectKind.MODEL, value, text)
