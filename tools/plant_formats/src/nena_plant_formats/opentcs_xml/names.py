"""The names of each value of a plant model in openTCS's XML, in the JSON of its web API, and in NeNa."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

NEEDED: Final = ...
"""In place of a default: hosts must send the value."""


class Value(NamedTuple):
    """A value of an object, by its names in JSON, the plant model and XML; dots lead into inner objects."""

    json: str
    model: str
    default: Any = NEEDED
    """What openTCS takes if hosts leave the value out, and shows if the model has none."""
    xml: str = ""
    """Empty: as in JSON."""


class Part(NamedTuple):
    """Objects within an object, by their names in JSON, XML and the plant model."""

    json: str
    tag: str
    model: str
    """Empty: the object itself, which has what openTCS has in an object of its own."""
    kind: type
    """``dict``: one object; ``list``: objects; ``str``: names."""


NAME: Final = Value("name", "name")
POSITION: Final = tuple(
    Value(f"position.{axis}", f"{axis}_mm", 0, f"position{axis.upper()}") for axis in "xyz"
)
LABEL: Final = (
    Value("labelOffset.x", "label_offset_x_px", -10, "labelOffsetX"),
    Value("labelOffset.y", "label_offset_y_px", -20, "labelOffsetY"),
    Value("layerId", "layer_id", 0),
)
X_Y: Final = Value("x", "x_mm"), Value("y", "y_mm")
BOX: Final = (
    Value("length", "length_mm", 1000),
    Value("width", "width_mm", 1000),
    Value("height", "height_mm", 1000),
    Value("referenceOffset.x", "reference_offset_x_mm", 0, "referenceOffsetX"),
    Value("referenceOffset.y", "reference_offset_y_mm", 0, "referenceOffsetY"),
)
VALUES: Final[Mapping[str, tuple[Value, ...]]] = {
    "model": (NAME,),
    "point": (
        NAME,
        *POSITION,
        Value("vehicleOrientationAngle", "orientation_deg", "NaN"),
        Value("type", "type", "HALT_POSITION"),
    ),
    "path": (
        NAME,
        Value("srcPointName", "source", NEEDED, "sourcePoint"),
        Value("destPointName", "destination", NEEDED, "destinationPoint"),
        Value("length", "length_mm", 1),
        Value("maxVelocity", "max_velocity_mm_s", 0),
        Value("maxReverseVelocity", "max_reverse_velocity_mm_s", 0),
        Value("locked", "locked", default=False),
    ),
    "peripheralOperation": (
        Value("operation", "name", NEEDED, "name"),
        Value("locationName", "location"),
        Value("executionTrigger", "execution_trigger", "AFTER_ALLOCATION"),
        Value("completionRequired", "completion_required", default=False),
    ),
    "vehicle": (
        NAME,
        Value("energyLevelCritical", "energy_thresholds.critical", 30),
        Value("energyLevelGood", "energy_thresholds.good", 90),
        Value("energyLevelFullyRecharged", "energy_thresholds.fully_recharged", 90),
        Value("energyLevelSufficientlyRecharged", "energy_thresholds.sufficiently_recharged", 30),
        Value("maxVelocity", "max_velocity_mm_s", 1000),
        Value("maxReverseVelocity", "max_reverse_velocity_mm_s", 1000),
        Value("envelopeKey", "envelope_key", None),
    ),
    "locationType": (NAME,),
    "location": (
        NAME,
        *POSITION,
        Value("typeName", "type", NEEDED, "type"),
        Value("locked", "locked", default=False),
    ),
    "link": (Value("pointName", "point", NEEDED, "point"),),
    "block": (NAME, Value("type", "type", "SINGLE_VEHICLE_ONLY")),
    "vehicleEnvelope": (Value("envelopeKey", "key", NEEDED, "key"),),
    "vertex": X_Y,
    "maxVehicleBoundingBox": BOX,
    "boundingBox": BOX,
    "pointLayout": LABEL,
    "pathLayout": (
        Value("connectionType", "connection_type", "DIRECT"),
        Value("layerId", "layer_id", 0),
    ),
    "controlPoint": X_Y,
    "vehicleLayout": (Value("routeColor", "color", "#00FF00", "color"),),
    "locationTypeLayout": (Value("locationRepresentation", "representation", "NONE"),),
    "locationLayout": (
        *LABEL[:2],
        Value("locationRepresentation", "representation", "DEFAULT"),
        LABEL[2],
    ),
    "blockLayout": (Value("color", "color", "#FF0000"),),
    "visualLayout": (
        NAME,
        Value("scaleX", "scale_x_mm_per_px", 50.0),
        Value("scaleY", "scale_y_mm_per_px", 50.0),
    ),
    "layer": (
        *(Value(name, name) for name in ("id", "ordinal", "visible", "name")),
        Value("groupId", "group_id"),
    ),
    "layerGroup": tuple(Value(name, name) for name in ("id", "name", "visible")),
}
"""The values of the objects, by the tags of their XML elements."""

ENVELOPES: Final = Part("vehicleEnvelopes", "vehicleEnvelope", "envelopes", list)
OPERATIONS: Final = Part("allowedOperations", "allowedOperation", "allowed_operations", str)
PARTS: Final[Mapping[str, tuple[Part, ...]]] = {
    "model": (
        Part("points", "point", "points", list),
        Part("paths", "path", "paths", list),
        Part("vehicles", "vehicle", "vehicles", list),
        Part("locationTypes", "locationType", "location_types", list),
        Part("locations", "location", "locations", list),
        Part("blocks", "block", "blocks", list),
        Part("visualLayout", "visualLayout", "visual_layout", dict),
    ),
    "point": (
        Part("maxVehicleBoundingBox", "maxVehicleBoundingBox", "max_vehicle_bounding_box", dict),
        ENVELOPES,
        Part("layout", "pointLayout", "layout", dict),
    ),
    "path": (
        Part("peripheralOperations", "peripheralOperation", "peripheral_operations", list),
        ENVELOPES,
        Part("layout", "pathLayout", "layout", dict),
    ),
    "pathLayout": (Part("controlPoints", "controlPoint", "control_points", list),),
    "vehicle": (
        Part("boundingBox", "boundingBox", "bounding_box", dict),
        Part("layout", "vehicleLayout", "", dict),
    ),
    "vehicleEnvelope": (Part("vertices", "vertex", "vertices", list),),
    "locationType": (
        OPERATIONS,
        Part(
            "allowedPeripheralOperations", "allowedPeripheralOperation", "allowed_peripheral_operations", str
        ),
        Part("layout", "locationTypeLayout", "", dict),
    ),
    "location": (Part("links", "link", "links", list), Part("layout", "locationLayout", "layout", dict)),
    "link": (OPERATIONS,),
    "block": (Part("memberNames", "member", "members", str), Part("layout", "blockLayout", "", dict)),
    "visualLayout": (
        Part("layers", "layer", "layers", list),
        Part("layerGroups", "layerGroup", "layer_groups", list),
    ),
}
"""The objects within objects, by the tags of their XML elements."""
WITH_PROPERTIES: Final = frozenset(
    {"model", "point", "path", "vehicle", "locationType", "location", "block", "visualLayout"}
)
