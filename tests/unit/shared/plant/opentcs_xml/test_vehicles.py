from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import pytest

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.opentcs_xml.drawing import Drawing
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.notes import Notes
from nena_shared.plant.opentcs_xml.vehicles import read_vehicle
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.vehicle import Vehicle

NEW, OLD = FormatVersion.V7_0_0, FormatVersion.V0_0_4
SPEEDS = {"maxVelocity": "1000", "maxReverseVelocity": "500"}
LEVELS = {
    "energyLevelCritical": "10",
    "energyLevelGood": "80",
    "energyLevelSufficientlyRecharged": "40",
    "energyLevelFullyRecharged": "95",
}


def vehicle(version: FormatVersion, **attributes: str) -> tuple[Vehicle, Notes]:
    element = Element("vehicle", {"name": "V", **attributes})
    if not version.is_old:
        SubElement(element, "boundingBox", length="900", width="600", height="400")
    notes = Notes(version)
    return read_vehicle(XmlObject(element, ObjectKind.VEHICLE, "V", notes), Drawing()), notes


def levels(made: Vehicle) -> tuple[int, int, int, int]:
    found = made.energy_thresholds
    return found.critical, found.good, found.sufficiently_recharged, found.fully_recharged


@pytest.mark.parametrize("version", [NEW, OLD])
def test_a_whole_vehicle_has_nothing_to_be_told(version: FormatVersion) -> None:
    length = {"length": "900"} if version is OLD else {}
    made, notes = vehicle(version, **SPEEDS, **LEVELS, **length)
    assert levels(made) == (10, 80, 40, 95)
    assert (made.max_velocity_mm_s, made.max_reverse_velocity_mm_s) == (1000, 500)
    assert made.bounding_box.length_mm == 900
    assert (notes.errors, notes.warnings) == ([], [])


def test_what_old_files_leave_out_is_told_and_new_ones_need_it() -> None:
    made, notes = vehicle(OLD)
    assert levels(made) == (30, 90, 30, 90)
    assert made.bounding_box.length_mm == 1000
    assert [each.code for each in notes.warnings] == ["DEFAULTED"] * 6
    assert notes.errors == []

    _, notes = vehicle(NEW)
    assert [each.code for each in notes.errors] == ["MISSING_ATTRIBUTE"] * 6


@pytest.mark.parametrize(
    ("crossed", "right"),
    [
        ({"energyLevelCritical": "81"}, (80, 81, 40, 95)),
        ({"energyLevelFullyRecharged": "39"}, (10, 80, 39, 40)),
    ],
)
def test_crossed_levels_are_swapped_in_old_files_and_refused_in_new_ones(
    crossed: dict[str, str], right: tuple[int, int, int, int]
) -> None:
    made, notes = vehicle(OLD, **SPEEDS, **LEVELS | crossed)
    assert levels(made) == right
    assert ([each.code for each in notes.warnings], notes.errors) == (["THRESHOLDS_SWAPPED"], [])

    _, notes = vehicle(NEW, **SPEEDS, **LEVELS | crossed)
    assert ([each.code for each in notes.errors], notes.warnings) == (["THRESHOLDS_CROSSED"], [])


def test_equal_levels_are_in_order() -> None:
    _, notes = vehicle(NEW, **SPEEDS, **LEVELS | {"energyLevelCritical": "80"})
    assert notes.errors == []


@pytest.mark.parametrize("level", ["-1", "101"])
def test_a_level_is_a_percentage(level: str) -> None:
    _, notes = vehicle(NEW, **SPEEDS, **LEVELS | {"energyLevelGood": level})
    assert "BAD_VALUE" in [each.code for each in notes.errors]
