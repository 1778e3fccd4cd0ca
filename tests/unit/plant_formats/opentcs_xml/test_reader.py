"""Format 7.0.0, and what holds for all formats."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import pytest

from nena_plant_formats.opentcs_xml import read
from nena_plant_formats.opentcs_xml.document import Findings, FormatVersion, XmlObject
from nena_plant_formats.opentcs_xml.reader import (
    FRAME_TOLERANCE_MM,
    Drawing,
    Drawn,
    path_layout,
    read_vehicle,
    same_place,
)
from nena_shared.plant import (
    Block,
    BlockType,
    BoundingBox,
    ConnectionType,
    EnergyThresholds,
    ExecutionTrigger,
    LabelLayout,
    Layer,
    LayerGroup,
    LayoutPoint,
    Link,
    LocationLayout,
    LocationType,
    ObjectKind,
    PathLayout,
    PlantModel,
    PlantModelError,
    PlantProblem,
    PlantVertex,
    PointType,
    Vehicle,
    VisualLayout,
)
from support.plants import opentcs_xml

POINTS = """
<point name="A" positionX="0" positionY="-5" positionZ="7" vehicleOrientationAngle="90.5"
       type="PARK_POSITION">
  <maxVehicleBoundingBox length="1" width="2" height="3" referenceOffsetX="-4" referenceOffsetY="5"/>
  <vehicleEnvelope key="e"><vertex x="1" y="2"/><vertex x="1" y="2"/></vehicleEnvelope>
  <outgoingPath name="AB"/>
  <property name="k" value="v"/>
  <pointLayout labelOffsetX="3" labelOffsetY="4" layerId="1"/>
</point>
<point name="B" positionX="1000" positionY="0" positionZ="0" vehicleOrientationAngle="NaN"
       type="HALT_POSITION"/>
"""
PATHS = """
<path name="AB" sourcePoint="A" destinationPoint="B" length="1200" maxVelocity="900" maxReverseVelocity="300"
      locked="false">
  <peripheralOperation name="open" locationName="Door" executionTrigger="AFTER_MOVEMENT"
                       completionRequired="true"/>
  <pathLayout connectionType="BEZIER" layerId="1">
    <controlPoint x="3" y="-4"/><controlPoint x="5" y="6"/>
  </pathLayout>
</path>
"""
REST = """
<vehicle name="V" energyLevelCritical="10" energyLevelGood="50" energyLevelFullyRecharged="95"
         energyLevelSufficientlyRecharged="40" maxVelocity="1500" maxReverseVelocity="500" envelopeKey="e">
  <boundingBox length="1200" width="800" height="400" referenceOffsetX="0" referenceOffsetY="0"/>
  <vehicleLayout color="#FF9900"/>
</vehicle>
<locationType name="T">
  <allowedOperation name="Charge"/><allowedPeripheralOperation name="open"/>
  <locationTypeLayout locationRepresentation="WORKING_GENERIC"/>
</locationType>
<location name="Door" positionX="1" positionY="2" positionZ="3" type="T" locked="false">
  <link point="A"><allowedOperation name="Charge"/></link><link point="B"/>
  <locationLayout labelOffsetX="1" labelOffsetY="2" locationRepresentation="NONE" layerId="0"/>
</location>
<block name="X" type="SAME_DIRECTION_ONLY"><member name="A"/><member name="AB"/>
  <blockLayout color="#33CC00"/></block>
<visualLayout name="Layout" scaleX="20.0" scaleY="10.0">
  <layer id="1" ordinal="2" visible="false" name="Top" groupId="3"/>
  <layerGroup id="3" name="All" visible="true"/>
  <property name="vl" value="1"/>
</visualLayout>
<property name="author" value="me"/>
"""


def model(body: str = POINTS + PATHS + REST) -> PlantModel:
    return read(opentcs_xml(body)).model


def problems(body: str, version: str = "7.0.0") -> list[PlantProblem]:
    with pytest.raises(PlantModelError) as caught:
        read(opentcs_xml(body, version))
    return list(caught.value.problems)


def warnings(body: str) -> list[tuple[str, str]]:
    return [(problem.code, problem.name) for problem in read(opentcs_xml(body)).warnings]


def test_complete_model_has_no_warnings() -> None:
    assert warnings(POINTS + PATHS + REST) == []


def test_points() -> None:
    a, b = model().points
    assert (a.name, a.x_mm, a.y_mm, a.z_mm, a.orientation_deg) == ("A", 0, -5, 7, 90.5)
    assert a.type is PointType.PARK_POSITION
    assert a.max_vehicle_bounding_box == BoundingBox(
        length_mm=1, width_mm=2, height_mm=3, reference_offset_x_mm=-4, reference_offset_y_mm=5
    )
    assert a.envelopes[0].key == "e"
    assert a.envelopes[0].vertices == (PlantVertex(x_mm=1, y_mm=2), PlantVertex(x_mm=1, y_mm=2))
    assert a.properties == {"k": "v"}
    assert (a.layout.label_offset_x_px, a.layout.label_offset_y_px, a.layout.layer_id) == (3, 4, 1)
    assert b.orientation_deg is None
    assert b.max_vehicle_bounding_box == BoundingBox()


def test_paths() -> None:
    (path,) = model().paths
    assert (path.source, path.destination, path.length_mm) == ("A", "B", 1200)
    assert (path.max_velocity_mm_s, path.max_reverse_velocity_mm_s, path.locked) == (900, 300, False)
    assert path.peripheral_operations[0].execution_trigger is ExecutionTrigger.AFTER_MOVEMENT
    assert path.peripheral_operations[0].completion_required
    assert path.peripheral_operations[0].location == "Door"


def test_control_points_are_pixels_with_y_downwards() -> None:
    (path,) = model().paths
    assert path.layout.connection_type is ConnectionType.BEZIER
    assert path.layout.control_points == (
        LayoutPoint(x_mm=60, y_mm=40),
        LayoutPoint(x_mm=100, y_mm=-60),
    )


def test_everything_else() -> None:
    read_model = model()
    (vehicle,) = read_model.vehicles
    (location,) = read_model.locations
    assert vehicle.energy_thresholds == EnergyThresholds(
        critical=10, good=50, sufficiently_recharged=40, fully_recharged=95
    )
    assert (vehicle.max_velocity_mm_s, vehicle.max_reverse_velocity_mm_s) == (1500, 500)
    assert (vehicle.bounding_box.length_mm, vehicle.envelope_key, vehicle.color) == (1200, "e", "#FF9900")
    assert read_model.location_types == (
        LocationType(
            name="T",
            allowed_operations=("Charge",),
            allowed_peripheral_operations=("open",),
            representation="WORKING_GENERIC",
        ),
    )
    assert (location.x_mm, location.y_mm, location.z_mm, location.type) == (1, 2, 3, "T")
    assert (location.x_m, location.y_m) == (0.001, 0.002)
    assert location.links == (Link(point="A", allowed_operations=("Charge",)), Link(point="B"))
    assert location.layout == LocationLayout(
        label_offset_x_px=1, label_offset_y_px=2, layer_id=0, representation="NONE"
    )
    assert read_model.blocks == (
        Block(name="X", type=BlockType.SAME_DIRECTION_ONLY, members=("A", "AB"), color="#33CC00"),
    )
    assert read_model.visual_layout.name == "Layout"
    assert read_model.visual_layout.layers == (Layer(id=1, ordinal=2, visible=False, name="Top", group_id=3),)
    assert read_model.visual_layout.layer_groups == (LayerGroup(id=3, name="All"),)
    assert read_model.visual_layout.properties == {"vl": "1"}
    assert read_model.properties == {"author": "me"}


def test_all_errors_are_found_at_once_and_name_their_objects() -> None:
    body = """
    <point name="A" positionX="1.5" positionY="0" positionZ="0" vehicleOrientationAngle="north" type="SOFA"/>
    <point name="A" positionX="0" positionZ="0" vehicleOrientationAngle="inf" type="HALT_POSITION"/>
    <path name="P" sourcePoint="A" destinationPoint="Z" length="0" maxVelocity="-1" maxReverseVelocity="0"
          locked="yes"/>
    <vehicle name="V" energyLevelCritical="101" energyLevelGood="102" energyLevelFullyRecharged="30"
             energyLevelSufficientlyRecharged="90" maxVelocity="1"/>
    <location name="L" positionX="0" positionY="0" positionZ="0" type="Nothing" locked="false">
      <link point="Y"/></location>
    <block type="HOUSE"><member name="Q"/></block>
    <visualLayout name="VL" scaleX="0" scaleY="NaN"/>
    """
    found = [(problem.code, problem.name, problem.text) for problem in problems(body)]
    expected = [
        ("BAD_VALUE", "VL", "scaleX"),
        ("BAD_VALUE", "VL", "scaleY"),
        ("BAD_VALUE", "A", "'1.5'"),
        ("BAD_VALUE", "A", "'north'"),
        ("BAD_VALUE", "A", "HALT_POSITION, PARK_POSITION"),
        ("MISSING_ATTRIBUTE", "A", "'positionY'"),
        ("BAD_VALUE", "A", "'inf'"),
        ("BAD_VALUE", "P", "at least 1"),
        ("BAD_VALUE", "P", "maxVelocity"),
        ("BAD_VALUE", "P", "'yes'"),
        ("BAD_VALUE", "V", "between 0 and 100"),
        ("BAD_VALUE", "V", "energyLevelGood"),
        ("THRESHOLDS_CROSSED", "V", "sufficiently recharged 90 % is above fully recharged 30 %"),
        ("MISSING_ATTRIBUTE", "V", "maxReverseVelocity"),
        ("MISSING_ATTRIBUTE", "", "needs a name"),
        ("BAD_VALUE", "", "SINGLE_VEHICLE_ONLY"),
        ("DUPLICATE_NAME", "A", "2 objects"),
        ("UNKNOWN_REFERENCE", "P", "point 'Z'"),
        ("UNKNOWN_REFERENCE", "L", "location type 'Nothing'"),
        ("UNKNOWN_REFERENCE", "L", "point 'Y'"),
        ("UNKNOWN_REFERENCE", "?", "'Q'"),
    ]
    for code, name, part in expected:
        assert any(f[:2] == (code, name) and part in f[2] for f in found), (code, name, part, found)
    assert len(found) == len(expected)


def test_names_keep_their_spaces() -> None:
    name = "Enschede "
    body = POINTS + PATHS + REST.replace('"Door"', f'"{name}"')
    body = body.replace('locationName="Door"', f'locationName="{name}"')
    assert model(body).location(name).name == name
    assert ("SUSPICIOUS_NAME", name) in warnings(body)


def test_outgoing_paths_are_not_trusted() -> None:
    body = POINTS.replace('<outgoingPath name="AB"/>', '<outgoingPath name="BA"/>') + PATHS + REST
    report = read(opentcs_xml(body))
    (warning,) = report.warnings
    assert (warning.code, warning.name) == ("OUTGOING_PATHS_DIFFER", "A")
    assert "['AB', 'BA']" in warning.text
    assert [path.name for path in report.model.paths] == ["AB"]


def test_ignored_content_is_reported_once() -> None:
    path = PATHS.replace("<pathLayout", '<tunnel/><pathLayout wet="1"').replace(
        "<path ", '<path mood="good" '
    )
    body = POINTS + path + REST + "<weather/>"
    report = read(opentcs_xml(body))
    assert [(problem.code, problem.kind, problem.text) for problem in report.warnings] == [
        ("IGNORED", "model", "element 'weather' in 'model' is ignored (found 1 times)"),
        ("IGNORED", "path", "attribute 'mood' of element 'path' is ignored (found 1 times)"),
        ("IGNORED", "path", "attribute 'wet' of element 'pathLayout' is ignored (found 1 times)"),
        ("IGNORED", "path", "element 'tunnel' in 'path' is ignored (found 1 times)"),
    ]


def test_of_two_properties_with_one_name_the_last_counts() -> None:
    body = POINTS + PATHS + REST + '<property name="author" value="you"/>'
    assert model(body).properties == {"author": "you"}
    assert warnings(body) == [("DUPLICATE_PROPERTY", "test")]


@pytest.mark.parametrize(
    ("connection", "points"), [("BEZIER", 1), ("BEZIER", 3), ("BEZIER_3", 2), ("BEZIER", 0)]
)
def test_a_curve_with_the_wrong_number_of_control_points_becomes_a_line(connection: str, points: int) -> None:
    start, end = PATHS.index("<pathLayout"), PATHS.index("</path>")
    layout = f'<pathLayout connectionType="{connection}">' + '<controlPoint x="1" y="1"/>' * points
    body = POINTS + PATHS[:start] + layout + "</pathLayout>" + PATHS[end:] + REST
    assert model(body).paths[0].layout.connection_type is ConnectionType.DIRECT
    assert warnings(body) == [("CONTROL_POINTS_DROPPED", "AB")]


def test_invalid_colour_is_dropped() -> None:
    body = POINTS + PATHS + REST.replace("#FF9900", "orange")
    assert model(body).vehicles[0].color is None
    assert warnings(body) == [("DRAWING_DROPPED", "V")]


def test_a_scale_beyond_all_bounds_is_refused() -> None:
    (problem,) = problems(POINTS + PATHS + REST.replace('scaleX="20.0"', 'scaleX="1e308"'))
    assert (problem.code, problem.name) == ("BAD_VALUE", "Layout")


def test_second_layout_is_ignored() -> None:
    body = POINTS + PATHS + REST + '<visualLayout name="Other" scaleX="1" scaleY="1"/>'
    assert model(body).visual_layout.name == "Layout"
    assert ("DRAWING_DROPPED", "Other") in warnings(body)


SCALED = VisualLayout(scale_x_mm_per_px=50.0, scale_y_mm_per_px=20.0)


def drawn(kind: ConnectionType, points: int, *, same_frame: bool = True) -> tuple[PathLayout, list[str]]:
    """Return the course of a path with so many control points, and the findings about it."""
    obj = XmlObject(Element("path"), ObjectKind.PATH, "P", Findings(FormatVersion.V6_0_0))
    pixels = tuple((number + 1, 10 * (number + 1)) for number in range(points))
    as_drawn = Drawn(label=LabelLayout(layer_id=4), connection_type=kind, control_points_px=pixels)
    made = path_layout(obj, as_drawn, SCALED, same_frame=same_frame)
    assert made.layer_id == 4
    return made, [each.text for each in obj.findings.warnings]


def test_pixels_become_millimetres_and_y_points_up() -> None:
    made, said = drawn(ConnectionType.BEZIER, 2)
    assert [(each.x_mm, each.y_mm) for each in made.control_points] == [(50.0, -200.0), (100.0, -400.0)]
    assert (made.connection_type, said) == (ConnectionType.BEZIER, [])


@pytest.mark.parametrize(
    ("kind", "points", "kept"),
    [
        (ConnectionType.BEZIER, 2, True),
        (ConnectionType.BEZIER, 1, False),
        (ConnectionType.BEZIER, 5, False),
        (ConnectionType.BEZIER_3, 5, True),
        (ConnectionType.BEZIER_3, 2, False),
        (ConnectionType.POLYPATH, 0, True),
        (ConnectionType.POLYPATH, 7, True),
        (ConnectionType.DIRECT, 0, True),
    ],
)
def test_a_curve_needs_its_number_of_control_points(
    kind: ConnectionType,
    points: int,
    kept: bool,  # noqa: FBT001 - an example
) -> None:
    made, said = drawn(kind, points)
    assert made.connection_type is (kind if kept else ConnectionType.DIRECT)
    assert len(made.control_points) == (points if kept else 0)
    assert bool(said) is not kept


def test_control_points_of_another_frame_are_dropped_and_none_are_not_missed() -> None:
    made, (said,) = drawn(ConnectionType.BEZIER, 2, same_frame=False)
    assert made == PathLayout(layer_id=4)
    assert "drawn as a straight line" in said
    made, said_of_none = drawn(ConnectionType.ELBOW, 0, same_frame=False)
    assert (made.connection_type, said_of_none) == (ConnectionType.ELBOW, [])


@pytest.mark.parametrize(
    ("off", "same"), [(0, True), (FRAME_TOLERANCE_MM, True), (FRAME_TOLERANCE_MM + 1, False)]
)
def test_places_a_millimetre_apart_are_the_same(off: int, same: bool) -> None:  # noqa: FBT001 - an example
    assert same_place((10, 20), (10 + off, 20)) is same
    assert same_place((10, 20), (10, 20 - off)) is same


NEW, OLD = FormatVersion.V7_0_0, FormatVersion.V0_0_4
SPEEDS = {"maxVelocity": "1000", "maxReverseVelocity": "500"}
LEVELS = {
    "energyLevelCritical": "10",
    "energyLevelGood": "80",
    "energyLevelSufficientlyRecharged": "40",
    "energyLevelFullyRecharged": "95",
}


def vehicle(version: FormatVersion, **attributes: str) -> tuple[Vehicle, Findings]:
    element = Element("vehicle", {"name": "V", **attributes})
    if not version.is_old:
        SubElement(element, "boundingBox", length="900", width="600", height="400")
    findings = Findings(version)
    return read_vehicle(XmlObject(element, ObjectKind.VEHICLE, "V", findings), Drawing()), findings


def levels(made: Vehicle) -> tuple[int, int, int, int]:
    found = made.energy_thresholds
    return found.critical, found.good, found.sufficiently_recharged, found.fully_recharged


@pytest.mark.parametrize("version", [NEW, OLD])
def test_complete_vehicle_has_no_warnings(version: FormatVersion) -> None:
    length = {"length": "900"} if version is OLD else {}
    made, findings = vehicle(version, **SPEEDS, **LEVELS, **length)
    assert levels(made) == (10, 80, 40, 95)
    assert (made.max_velocity_mm_s, made.max_reverse_velocity_mm_s) == (1000, 500)
    assert made.bounding_box.length_mm == 900
    assert (findings.errors, findings.warnings) == ([], [])


def test_omissions_are_reported_for_old_files_and_errors_in_new_ones() -> None:
    made, findings = vehicle(OLD)
    assert levels(made) == (30, 90, 30, 90)
    assert made.bounding_box.length_mm == 1000
    assert [each.code for each in findings.warnings] == ["DEFAULTED"] * 6
    assert findings.errors == []

    _, findings = vehicle(NEW)
    assert [each.code for each in findings.errors] == ["MISSING_ATTRIBUTE"] * 6


@pytest.mark.parametrize(
    ("crossed", "right"),
    [
        ({"energyLevelCritical": "81"}, (80, 81, 40, 95)),
        ({"energyLevelFullyRecharged": "39"}, (10, 80, 39, 40)),
    ],
)
def test_swapped_levels_are_corrected_in_old_files_and_refused_in_new_ones(
    crossed: dict[str, str], right: tuple[int, int, int, int]
) -> None:
    made, findings = vehicle(OLD, **SPEEDS, **LEVELS | crossed)
    assert levels(made) == right
    assert ([each.code for each in findings.warnings], findings.errors) == (["THRESHOLDS_SWAPPED"], [])

    _, findings = vehicle(NEW, **SPEEDS, **LEVELS | crossed)
    assert ([each.code for each in findings.errors], findings.warnings) == (["THRESHOLDS_CROSSED"], [])


@pytest.mark.parametrize("level", ["-1", "101"])
def test_a_level_is_a_percentage(level: str) -> None:
    _, findings = vehicle(NEW, **SPEEDS, **LEVELS | {"energyLevelGood": level})
    assert "BAD_VALUE" in [each.code for each in findings.errors]
