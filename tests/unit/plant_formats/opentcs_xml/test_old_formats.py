"""Formats 0.0.2 to 6.0.0 as far as they differ from 7.0.0."""

from typing import Any

import pytest

from nena_plant_formats.opentcs_xml import read
from nena_shared.plant import (
    BlockType,
    ConnectionType,
    EnergyThresholds,
    ExecutionTrigger,
    LayoutPoint,
    PlantModel,
    PlantModelError,
    PlantVertex,
    PointType,
)
from support.plants import opentcs_xml


def drawn_in_layout(version: str, *, b_y: int = 0) -> bytes:
    """Make a model of format 0.0.2 or 0.0.3, where the layout holds all that is drawn."""
    extra = ' id="7" routingCost="1"' if version == "0.0.2" else ""
    block_type = "" if version == "0.0.2" else ' type="SAME_DIRECTION_ONLY"'
    body = f"""
    <point name="A" xPosition="0" yPosition="0" zPosition="0" vehicleOrientationAngle="0.0"
           type="REPORT_POSITION">
      <outgoingPath name="AB"/></point>
    <point name="B" xPosition="3000" yPosition="0"><outgoingPath name="BA"/></point>
    <path name="AB" sourcePoint="A" destinationPoint="B" length="3100" maxVelocity="800"
          maxReverseVelocity="0"{extra}/>
    <path name="BA" sourcePoint="B" destinationPoint="A"/>
    <vehicle name="V" length="1400" energyLevelCritical="30" energyLevelGood="90"
             energyLevelFullyRecharged="30"
             energyLevelSufficientlyRecharged="90" maxVelocity="1000" maxReverseVelocity="1000"/>
    <locationType name="T"><allowedOperation name="Charge"/></locationType>
    <location name="L" xPosition="1" yPosition="2" type="T"><link point="A"/></location>
    <block name="X"{block_type}/>
    <group name="G"/>
    <visualLayout name="VL" scaleX="10.0" scaleY="10.0">
      <modelLayoutElement visualizedObjectName="A" layer="0"><property name="POSITION_X" value="0"/>
        <property name="POSITION_Y" value="1"/>
        <property name="LABEL_OFFSET_X" value="30"/></modelLayoutElement>
      <modelLayoutElement visualizedObjectName="B" layer="0"><property name="POSITION_X" value="3000"/>
        <property name="POSITION_Y" value="{b_y}"/></modelLayoutElement>
      <modelLayoutElement visualizedObjectName="L" layer="2"><property name="POSITION_X" value="500"/>
        <property name="POSITION_Y" value="600"/></modelLayoutElement>
      <modelLayoutElement visualizedObjectName="AB" layer="0"><property name="CONN_TYPE" value="BEZIER"/>
        <property name="CONTROL_POINTS" value="100,-20;200,-20"/></modelLayoutElement>
      <modelLayoutElement visualizedObjectName="V" layer="0"><property name="ROUTE_COLOR" value="#FF0000"/>
      </modelLayoutElement>
      <modelLayoutElement visualizedObjectName="X" layer="0"><property name="COLOR" value="#00FF00"/>
      </modelLayoutElement>
      <modelLayoutElement visualizedObjectName="BA" layer="0"><property name="CONTROL_POINTS" value="a,b"/>
      </modelLayoutElement>
    </visualLayout>
    """
    return opentcs_xml(body, version)


def drawn_at_objects(version: str, **changes: Any) -> bytes:
    """Make a model of format 0.0.4 to 6.0.0, where each object contains its own drawing."""
    old = "xPosition yPosition zPosition xLabelOffset yLabelOffset"
    new = "positionX positionY positionZ labelOffsetX labelOffsetY"
    names = dict(zip("xyzab", (new if version == "6.0.0" else old).split(), strict=True))
    values = {"drawn_b": 3000, "type": "HALT_POSITION", "trigger": "AFTER_ALLOCATION", **names, **changes}
    body = """
    <point name="A" {x}="0" {y}="0" {z}="0" vehicleOrientationAngle="NaN" type="{type}">
      <outgoingPath name="AB"/><pointLayout {x}="0" {y}="0" {a}="5" {b}="6" layerId="1"/></point>
    <point name="B" {x}="3000" {y}="0" {z}="0" vehicleOrientationAngle="NaN" type="HALT_POSITION">
      <pointLayout {x}="{drawn_b}" {y}="0" {a}="5" {b}="6" layerId="1"/></point>
    <path name="AB" sourcePoint="A" destinationPoint="B" length="3100" maxVelocity="800"
          maxReverseVelocity="300" locked="false">
      <peripheralOperation name="open" locationName="L" executionTrigger="{trigger}"/>
      <pathLayout connectionType="POLYPATH" layerId="0"><controlPoint x="30" y="-10"/></pathLayout></path>
    <locationType name="T"><allowedOperation name="Charge"/></locationType>
    <location name="L" {x}="1" {y}="2" {z}="0" type="T" locked="false"><link point="A"/>
      <locationLayout {x}="1" {y}="2" {a}="5" {b}="6" locationRepresentation="DEFAULT"/></location>
    <visualLayout name="VL" scaleX="50.0" scaleY="50.0"/>
    """.format(**values)
    return opentcs_xml(body, version)


def codes(data: bytes) -> set[tuple[str, str]]:
    return {(problem.code, problem.name) for problem in read(data).warnings}


@pytest.mark.parametrize("version", ["0.0.2", "0.0.3"])
def test_the_layout_element_holds_the_drawing(version: str) -> None:
    model = read(drawn_in_layout(version)).model
    assert model.point("A").layout.label_offset_x_px == 30
    assert model.path("AB").layout.connection_type is ConnectionType.BEZIER
    assert model.path("AB").layout.control_points == (
        LayoutPoint(x_mm=1000, y_mm=200),
        LayoutPoint(x_mm=2000, y_mm=200),
    )
    assert model.vehicle("V").color == "#FF0000"
    assert model.blocks_by_name["X"].color == "#00FF00"
    assert model.location("L").layout.position == PlantVertex(x_mm=500, y_mm=600)
    assert model.location("L").layout.layer_id == 2
    assert PlantModel.from_json(model.to_json()) == model


@pytest.mark.parametrize("version", ["0.0.2", "0.0.3"])
def test_values_missing_in_old_formats(version: str) -> None:
    model = read(drawn_in_layout(version)).model
    assert model.point("A").type is PointType.HALT_POSITION
    assert model.point("B").orientation_deg is None
    assert model.vehicle("V").bounding_box.length_mm == 1400
    assert model.vehicle("V").energy_thresholds == EnergyThresholds(
        critical=30, good=90, sufficiently_recharged=30, fully_recharged=90
    )
    back = model.path("BA")
    assert (back.length_mm, back.max_velocity_mm_s, back.max_reverse_velocity_mm_s) == (3000, 1000, 0)
    assert back.locked is False
    assert "max_velocity_mm_s" not in back.model_fields_set, "it limits nothing"


def test_the_block_type_is_optional_in_the_oldest_format_only() -> None:
    oldest = read(drawn_in_layout("0.0.2")).model
    assert oldest.blocks_by_name["X"].type is BlockType.SINGLE_VEHICLE_ONLY
    with pytest.raises(PlantModelError, match="'block' needs attribute 'type'"):
        read(opentcs_xml('<block name="X"/>', "0.0.3"))


def test_all_oddities_of_an_old_file_are_reported() -> None:
    assert codes(drawn_in_layout("0.0.2")) == {
        ("VALUE_REPLACED", "A"),
        ("DEFAULTED", "BA"),
        ("DRAWN_ELSEWHERE", "L"),
        ("DRAWING_DROPPED", "VL"),
        ("THRESHOLDS_SWAPPED", "V"),
        ("IGNORED", ""),
        ("NO_PARK_POSITION", "test"),
    }
    ignored = [
        problem.text for problem in read(drawn_in_layout("0.0.2")).warnings if problem.code == "IGNORED"
    ]
    assert ignored == [
        "element 'group' in 'model' is ignored (found 1 times)",
        "attribute 'id' of element 'path' is ignored (found 1 times)",
        "attribute 'routingCost' of element 'path' is ignored (found 1 times)",
    ]


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("#FF0000", "red"),
        ('"BEZIER"', '"SPIRAL"'),
        ("100,-20;", "100;"),
        ('_X" value="30"', '_X" value="1e3"'),
    ],
)
def test_an_object_with_an_odd_drawing_is_drawn_in_the_default_way(right: str, wrong: str) -> None:
    data = drawn_in_layout("0.0.3").replace(right.encode(), wrong.encode())
    dropped = [problem for problem in read(data).warnings if problem.code == "DRAWING_DROPPED"]
    assert len(dropped) == 2
    assert all(problem.name == "VL" for problem in dropped)


def test_control_points_of_another_frame_are_dropped() -> None:
    data = drawn_in_layout("0.0.3", b_y=2)
    assert read(data).model.path("AB").layout.control_points == ()
    assert read(data).model.path("AB").layout.connection_type is ConnectionType.DIRECT
    assert {("CONTROL_POINTS_DROPPED", "AB"), ("FRAMES_DIFFER", "test")} <= codes(data)
    assert read(data).model.location("L").layout.position is None


@pytest.mark.parametrize("version", ["0.0.4", "0.0.5", "6.0.0"])
def test_objects_say_themselves_how_they_are_drawn(version: str) -> None:
    report = read(drawn_at_objects(version))
    model = report.model
    assert (model.point("B").x_mm, model.location("L").y_mm) == (3000, 2)
    assert (model.point("A").layout.label_offset_x_px, model.point("A").layout.layer_id) == (5, 1)
    assert model.path("AB").layout.control_points == (LayoutPoint(x_mm=1500, y_mm=500),)
    assert [problem.code for problem in report.warnings] == ["NO_PARK_POSITION"]


@pytest.mark.parametrize("version", ["0.0.4", "0.0.5", "6.0.0"])
@pytest.mark.parametrize(("drawn_b", "kept"), [(3001, True), (3002, False), (2998, False)])
def test_a_frame_may_be_a_millimetre_off(version: str, drawn_b: int, kept: bool) -> None:  # noqa: FBT001 - example
    data = drawn_at_objects(version, drawn_b=drawn_b)
    assert bool(read(data).model.path("AB").layout.control_points) is kept
    assert (("CONTROL_POINTS_DROPPED", "AB") in codes(data)) is not kept


def test_values_of_0_0_4_without_a_counterpart_are_replaced() -> None:
    data = drawn_at_objects("0.0.4", type="REPORT_POSITION", trigger="BEFORE_MOVEMENT")
    model = read(data).model
    assert model.point("A").type is PointType.HALT_POSITION
    assert model.path("AB").peripheral_operations[0].execution_trigger is ExecutionTrigger.AFTER_ALLOCATION
    assert {("VALUE_REPLACED", "A"), ("VALUE_REPLACED", "AB")} <= codes(data)


@pytest.mark.parametrize("version", ["0.0.5", "6.0.0"])
def test_and_are_errors_in_newer_formats(version: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(drawn_at_objects(version, type="REPORT_POSITION", trigger="BEFORE_MOVEMENT"))
    assert [(problem.code, problem.name) for problem in caught.value.problems] == [
        ("BAD_VALUE", "A"),
        ("BAD_VALUE", "AB"),
    ]


@pytest.mark.parametrize("version", ["0.0.3", "0.0.4", "0.0.5"])
def test_missing_energy_levels_and_speeds_are_defaulted_with_a_warning(version: str) -> None:
    report = read(opentcs_xml('<vehicle name="V"/>', version))
    (vehicle,) = report.model.vehicles
    assert vehicle.energy_thresholds == EnergyThresholds()
    assert (vehicle.max_velocity_mm_s, vehicle.max_reverse_velocity_mm_s) == (1000, 1000)
    assert len([problem for problem in report.warnings if problem.code == "DEFAULTED"]) == 6


def test_newer_formats_need_them() -> None:
    with pytest.raises(PlantModelError) as caught:
        read(opentcs_xml('<vehicle name="V"/>', "6.0.0"))
    assert {problem.code for problem in caught.value.problems} == {"MISSING_ATTRIBUTE"}
