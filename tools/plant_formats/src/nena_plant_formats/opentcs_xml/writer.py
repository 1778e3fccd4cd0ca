"""Write plant models as openTCS XML 7.0.0 (openTCS 6.7 and 7.x), in the model's order."""

import re
from collections import defaultdict
from collections.abc import Iterator
from operator import attrgetter
from typing import Any, Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from nena_plant_formats.exchange import ExportReport
from nena_plant_formats.lif.losses import rules_of_types
from nena_plant_formats.opentcs_xml.names import PARTS, VALUES, WITH_PROPERTIES, Part
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import Layer, LayerGroup, PlantModel
from nena_shared.plant_terms import ExecutionTrigger

Value = str | bool | float | None


def add(parent: Element, tag: str, **attributes: Value) -> Element:
    """Add an element; attributes that are None are omitted."""
    written = {name: _text_of(value) for name, value in attributes.items() if value is not None}
    return SubElement(parent, tag, written)


def _text_of(value: str | bool | float) -> str:  # noqa: FBT001 - one of the values
    return str(value).lower() if isinstance(value, bool) else str(value)


UNKNOWN_ANGLE: Final = "NaN"
"""7.0.0 requires a heading of each point; this stands for any."""


def _add_object(parent: Element, tag: str, written: Any) -> None:  # noqa: ANN401 - of the plant model
    """Add an object, by the tag of its element."""
    values = {value.xml or value.json: attrgetter(value.model)(written) for value in VALUES[tag]}
    if tag == "point" and values["vehicleOrientationAngle"] is None:
        values["vehicleOrientationAngle"] = UNKNOWN_ANGLE
    _add_parts(add(parent, tag, **values), written)


def _add_parts(element: Element, written: Any) -> None:  # noqa: ANN401
    """Add the objects within an object: its layout behind its properties."""
    *parts, last = (*PARTS.get(element.tag, ()), None)
    if parts and parts[-1].json == "layout":
        last = parts.pop()
    for part in parts:
        _add_part(element, part, written)
    for key, value in written.properties.items() if element.tag in WITH_PROPERTIES else ():
        add(element, "property", name=key, value=value)
    if last:
        _add_part(element, last, written)


def _add_part(element: Element, part: Part, written: Any) -> None:  # noqa: ANN401
    inner = getattr(written, part.model) if part.model else written
    if part.kind is str:
        for name in inner:
            add(element, part.tag, name=name)
    elif part.kind is list:
        for item in inner:
            _add_object(element, part.tag, item)
    elif part.model or any(attrgetter(value.model)(inner) is not None for value in VALUES[part.tag]):
        _add_object(element, part.tag, inner)


VERSION: Final = "7.0.0"
_NOT_XML: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot represent, not even escaped."""


def write(model: PlantModel) -> ExportReport:
    """Write a plant model. Reading the result returns the same model, except for the losses in the warnings.

    Raises PlantModelError for names and values with characters that XML cannot represent.
    """
    root = Element("model", version=VERSION, name=model.name)
    layers = tuple(_all_layers(model))
    both = {"layers": layers, "layer_groups": tuple(_layer_groups(model, layers))}
    layout = model.visual_layout.model_copy(update=both)
    _add_parts(root, model.model_copy(update={"visual_layout": layout}))
    _convert(root, model)
    if problems := tuple(_find_unwritable(root)):
        raise PlantModelError(problems)
    indent(root, "    ")
    data: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return ExportReport(data + b"\n", tuple(_export_warnings(model)))


def _convert(root: Element, model: PlantModel) -> None:
    """Write what the file format has in another form than the plant model."""
    outgoing: defaultdict[str, list[str]] = defaultdict(list)
    for path in model.paths:
        outgoing[path.source].append(path.name)
    for point, element in zip(model.points, root.iter("point"), strict=True):
        for place, name in enumerate(outgoing[point.name], start=1 + len(point.envelopes)):
            element.insert(place, Element("outgoingPath", name=name))
    for operation in root.iter("peripheralOperation"):
        trigger = operation.attrib["executionTrigger"]
        operation.set("executionTrigger", _TRIGGERS.get(ExecutionTrigger(trigger), trigger))
    layout = model.visual_layout
    for drawn in root.iter("controlPoint"):
        # In pixels of the layout, whose y grows downwards.
        drawn.set("x", str(round(float(drawn.attrib["x"]) / layout.scale_x_mm_per_px)))
        drawn.set("y", str(round(-float(drawn.attrib["y"]) / layout.scale_y_mm_per_px)))


_TRIGGERS: Final = dict.fromkeys(
    (ExecutionTrigger.IMMEDIATE, ExecutionTrigger.BEFORE_ALLOCATION), ExecutionTrigger.AFTER_ALLOCATION
)
"""Triggers that the file format lacks, and the ones that openTCS takes instead."""


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
