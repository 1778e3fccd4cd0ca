"""Reads vehicles."""

from nena_shared.plant.geometry import BoundingBox
from nena_shared.plant.opentcs_xml.drawing import Drawing
from nena_shared.plant.opentcs_xml.track import bounding_box, speed_mm_s
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.vehicle import EnergyThresholds, Vehicle


def read_vehicle(obj: XmlObject, drawing: Drawing) -> Vehicle:
    """Read one vehicle."""
    return Vehicle(
        name=obj.name or "?",
        bounding_box=_bounding_box(obj),
        energy_thresholds=_thresholds(obj),
        max_velocity_mm_s=speed_mm_s(obj, "maxVelocity", 1000),
        max_reverse_velocity_mm_s=speed_mm_s(obj, "maxReverseVelocity", 1000),
        envelope_key=obj.optional_text("envelopeKey"),
        properties=obj.properties(),
        color=drawing.of(obj, "vehicleLayout").color,
    )


def _bounding_box(obj: XmlObject) -> BoundingBox:
    """Read the size; formats before 6.0.0 know only a length."""
    if obj.notes.is_old:
        return BoundingBox(length_mm=obj.integer("length", 1000, minimum=1))
    return bounding_box(obj, "boundingBox")


def _thresholds(obj: XmlObject) -> EnergyThresholds:
    critical = _level(obj, "energyLevelCritical", 30)
    good = _level(obj, "energyLevelGood", 90)
    sufficient = _level(obj, "energyLevelSufficientlyRecharged", 30)
    full = _level(obj, "energyLevelFullyRecharged", 90)
    critical, good = _in_order(obj, "critical", critical, "good", good)
    sufficient, full = _in_order(obj, "sufficiently recharged", sufficient, "fully recharged", full)
    return EnergyThresholds(
        critical=critical, good=good, sufficiently_recharged=sufficient, fully_recharged=full
    )


def _level(obj: XmlObject, attribute: str, default: int) -> int:
    if obj.notes.is_old and not obj.has(attribute):
        obj.warn("DEFAULTED", f"{attribute} is missing, {default} % is used")
    return obj.integer(attribute, obj.if_old(default), minimum=0, maximum=100)


def _in_order(obj: XmlObject, low_name: str, low: int, high_name: str, high: int) -> tuple[int, int]:
    """Return lower and higher threshold; old formats have them crossed at times, newer ones must not."""
    if low <= high:
        return low, high
    text = f"the energy thresholds are crossed: {low_name} {low} % is above {high_name} {high} %"
    if obj.notes.is_old:
        obj.warn("THRESHOLDS_SWAPPED", f"{text}; they are swapped back")
    else:
        obj.error("THRESHOLDS_CROSSED", text)
    return high, low
