"""LIF 2.0.0: detected, read, written unchanged, and converted to and from 1.0.0."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from math import pi
from pathlib import Path
from typing import Any

import pytest

from nena_plant_formats import files, opentcs_xml
from nena_plant_formats.files import PlantFormat
from nena_plant_formats.lif import LifVersion, read, write
from nena_plant_formats.lif.losses import export_warnings
from nena_plant_formats.lif.mobile_robots import OriginsFile
from nena_shared.plant import PlantModel, PlantModelError
from nena_shared.plant.track import DeviationBounds, RequirementType
from support.lif_files import (
    action,
    edge,
    layout,
    lif_2_0,
    lif_2_0_of,
    lif_of,
    node,
    origin,
    robot_action,
    robot_edge,
    robot_node,
    robot_types,
    use,
)
from support.reference import reference_dir

NOW = datetime(2026, 11, 20, 10, 0, tzinfo=UTC)
EXAMPLES = 25


def examples() -> tuple[Path, ...]:
    found = tuple(sorted(reference_dir("lif-2.0").glob("*.lif.json")))
    assert len(found) == EXAMPLES
    return found


def written(model: PlantModel, version: LifVersion = LifVersion.V2_0) -> dict[str, Any]:
    return dict(json.loads(write(model, version, at=NOW).data))


def without_header(file: dict[str, Any]) -> dict[str, Any]:
    """Return a file without who wrote it and when, which no export can keep."""
    header = dict(file["metaInformation"])
    del header["creator"], header["exportTimestamp"]
    return {**file, "metaInformation": header}


def refusal(data: bytes, *, strict: bool = False) -> str:
    with pytest.raises(PlantModelError) as caught:
        read(data, strict=strict)
    return str(caught.value)


def codes(data: bytes) -> set[str]:
    return {problem.code for problem in read(data).warnings} - {"NO_PARK_POSITION", "NOT_STRONGLY_CONNECTED"}


def losses(data: bytes, version: LifVersion) -> list[str]:
    found = export_warnings(read(data).model, version)
    return [each.text.removesuffix(": not representable in LIF") for each in found]


def test_all_examples_are_valid_and_round_trip() -> None:
    for example in examples():
        content = json.loads(example.read_bytes())
        report = files.read(example.read_bytes(), strict=True)
        again = write(report.model, LifVersion.V2_0, at=NOW)
        assert without_header(json.loads(again.data)) == without_header(content), example.name
        assert again.warnings == (), example.name


def test_examples_come_back_from_own_json_with_the_same_meaning() -> None:
    """Defaults that a file leaves out are then written out."""
    for example in examples():
        content = without_header(json.loads(example.read_bytes()))
        model = PlantModel.from_json(files.read(example.read_bytes()).model.to_json())
        again = without_header(written(model))
        missing = {"creator": "", "exportTimestamp": ""}
        for each in (content, again):
            each["metaInformation"] |= missing
        assert OriginsFile.model_validate(again) == OriginsFile.model_validate(content), example.name


def test_examples_written_as_1_0_are_valid_and_list_losses() -> None:
    lossless = 0
    for example in examples():
        model = files.read(example.read_bytes()).model
        report = write(model, LifVersion.V1_0, at=NOW)
        again = read(report.data, strict=True).model
        lossless += not report.warnings
        assert [each.name for each in again.paths] == [each.name for each in model.paths], example.name
        if not report.warnings:
            assert again.points == model.points, example.name
            assert again.locations == model.locations, example.name
    assert lossless == 16


def test_the_form_is_that_of_the_stated_version() -> None:
    assert files.format_of(lif_2_0_of(robot_node("A"))) is PlantFormat.LIF
    assert files.format_of(b'{"metaInformation": {}}') is PlantFormat.LIF
    assert "origins: is missing" in refusal(
        json.dumps({**json.loads(lif_of()), **json.loads(lif_2_0())}).encode().replace(b'"origins"', b'"x"')
    )
    mixed = json.loads(lif_2_0_of(robot_node("A")))
    mixed["metaInformation"]["lifVersion"] = "1.0.0"
    told = refusal(json.dumps(mixed).encode())
    assert "layouts: is missing, but the file has 'origins'" in told
    assert "correct lifVersion, which is '1.0.0'" in told
    for silent in (None, "", "two"):
        mixed["metaInformation"]["lifVersion"] = silent
        assert "NOT_LIF" in codes(json.dumps(mixed).encode())
        assert "lifVersion" in refusal(json.dumps(mixed).encode(), strict=True)


@pytest.mark.parametrize("version", ["3.0.0", "20.0", "v3", "0.9"])
def test_unknown_version_error_lists_known_ones(version: str) -> None:
    told = refusal(lif_2_0(origin(layout(robot_node("A"))), version=version))
    assert f"lifVersion {version!r} is not supported; save the file as 1.0.0 or 2.0.0" in told
    assert "UNSUPPORTED_VERSION" in told


def test_a_newer_minor_version_is_read_with_a_warning() -> None:
    newer = lif_2_0(origin(layout(robot_node("A", newField=1))), version="2.1.0")
    assert {"NOT_LIF", "IGNORED"} <= codes(newer)
    assert "lifVersion 2.1.0 is newer" in refusal(newer, strict=True)


def test_types_that_share_an_entry_are_apart_in_the_model_and_together_in_the_file() -> None:
    data = lif_2_0_of(robot_node("A", 0, 0, "ACME.T1 ACME.T2", theta=1.0))
    (point,) = read(data).model.points
    assert [(each.vehicle_type_id, each.theta) for each in point.vehicle_types] == [
        ("ACME.T1", 1.0),
        ("ACME.T2", 1.0),
    ]
    (entry,) = written(read(data).model)["origins"][0]["layouts"][0]["nodes"][0][
        "mobileRobotTypeNodeProperties"
    ]
    assert entry["mobileRobotTypes"] == robot_types("ACME.T1 ACME.T2")


@pytest.mark.parametrize(
    ("maker", "series"), [("A.B", "C"), ("A", "B.C"), ("", "C"), ("A", ""), ("", "A.B"), ("A", ".B")]
)
def test_manufacturer_and_series_come_back_whatever_dots_they_have(maker: str, series: str) -> None:
    data = lif_2_0_of(robot_node("A"), robot_node("B"), robot_edge("A B"))
    content = json.loads(
        data.replace(b'"M"', json.dumps(maker).encode()).replace(b'"t"', json.dumps(series).encode())
    )
    model = PlantModel.from_json(read(json.dumps(content).encode()).model.to_json())
    (first, _) = written(model)["origins"][0]["layouts"][0]["nodes"]
    assert first["mobileRobotTypeNodeProperties"][0]["mobileRobotTypes"] == [
        {"manufacturer": maker, "seriesName": series}
    ]


def test_rules_of_both_versions_mean_the_same() -> None:
    rules: dict[str, Any] = {
        "requiredActions": [robot_action("beep", actionDescriptor="d")],
        "feasibleActions": [
            robot_action("pick", blockingType="SINGLE", actionParameters=[{"key": "k", "value": [1]}])
        ],
    }
    ways = robot_edge(
        "A B",
        mobileRobotOrientations=[pi, 0.0],
        reachOrientationBeforeEntering=False,
        maximumSpeed=1.5,
        maximumRotationSpeed=0.5,
        minimumLoadHandlingDeviceHeight=0.1,
        maximumMobileRobotHeight=2.0,
        forbiddenActionTypes=["drop"],
        **rules,
    )
    (rule,) = (
        read(lif_2_0_of(robot_node("A"), robot_node("B", 3, 4), ways), strict=True)
        .model.path("A-B")
        .vehicle_types
    )
    assert (rule.orientations, rule.is_backward, rule.rotation_allowed) == ((pi, 0.0), False, True)
    assert (rule.max_speed, rule.max_rotation_speed, rule.min_height, rule.max_height) == (1.5, 0.5, 0.1, 2.0)
    assert [(each.action_type, each.requirement_type) for each in rule.actions] == [
        ("beep", RequirementType.REQUIRED),
        ("pick", RequirementType.CONDITIONAL),
    ]
    assert (rule.actions[1].action_parameters[0].value, rule.forbidden_action_types) == ("[1]", ("drop",))


def test_a_forbidden_action_is_no_operation_of_a_station_and_a_required_one_cannot_be_forbidden() -> None:
    feasible = [robot_action("pick"), robot_action("drop")]
    station = {"stationId": "S", "interactionNodeIds": ["A"]}
    model = read(
        lif_2_0_of(robot_node("A", feasibleActions=feasible, forbiddenActionTypes=["drop"]), station)
    ).model
    assert (model.access_points("S", "pick"), model.access_points("S", "drop")) == (("A",), ())
    both = robot_node("A", requiredActions=[robot_action("x")], forbiddenActionTypes=["x"])
    assert "action 'x' is both required and forbidden" in refusal(lif_2_0_of(both))


def test_the_length_of_line_guidance_is_that_of_the_path() -> None:
    guided = robot_edge("A B", physicalLineGuidedProperty={"direction": "LEFT", "length": 7.5})
    model = read(lif_2_0_of(robot_node("A"), robot_node("B", 3, 4), guided)).model
    assert model.path("A-B").length_m == 7.5


@pytest.mark.parametrize(
    ("rules", "told"),
    [
        ({"allowedDeviationXY": {"aMinimum": 2, "aMaximum": 1}}, "allows no ellipse: a is at least 2.0"),
        ({"allowedDeviationXY": {"bMinimum": 2, "aMaximum": 1}}, "allows no ellipse: the shorter semi-axis"),
        ({"allowedDeviationXY": {"theta": 2}}, "has the rotation 2.0"),
        ({"theta": 3.2}, "heading 3.2 is not between"),
        (
            {"loadRestriction": {"unloaded": True, "loaded": False, "loadSetNames": ["p"]}},
            "forbids loads",
        ),
        (
            {"feasibleActions": [robot_action("x", actionParameters=[{"key": "k", "value": None}])]},
            "must not be null",
        ),
        ({"colour": 1}, "unknown field 'colour'"),
        ({"actions": []}, "unknown field 'actions'"),
    ],
)
def test_errors_in_nodes_are_reported(rules: dict[str, Any], told: str) -> None:
    assert told in refusal(lif_2_0_of(robot_node("A", **rules)), strict=True)


def test_errors_elsewhere_are_reported() -> None:
    curve = {"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": 4}]}
    both = robot_edge("A B", trajectory=curve, physicalLineGuidedProperty={"length": 5.0})
    assert "a trajectory and a physicalLineGuidedProperty" in refusal(
        lif_2_0_of(robot_node("A"), robot_node("B", 3, 4), both), strict=True
    )
    one = origin(layout(robot_node("A")))
    other = origin(layout(robot_node("B"), layoutId="up"))
    assert "2 origins have the id 'O'" in refusal(lif_2_0(one, other), strict=True)
    alike = robot_node("A")
    alike["mobileRobotTypeNodeProperties"][0]["mobileRobotTypes"] = [
        {"manufacturer": "A", "seriesName": "B.C"},
        {"manufacturer": "A.B", "seriesName": "C"},
    ]
    assert "2 types of mobile robots are called 'A.B.C'" in refusal(lif_2_0_of(alike), strict=True)


def test_degrees_are_recognized_in_lists_of_orientations() -> None:
    model = read(
        lif_2_0_of(robot_node("A"), robot_node("B"), robot_edge("A B", mobileRobotOrientations=[0, "180"]))
    ).model
    assert model.path("A-B").vehicle_types[0].orientations == pytest.approx((0.0, pi))


def test_losses_of_1_0_are_listed_and_omitted() -> None:
    first = robot_node(
        "A",
        allowedDeviationXY={"aMaximum": 1},
        loadRestriction={"unloaded": True, "loaded": False},
        forbiddenActionTypes=["x", "y"],
        feasibleActions=[
            robot_action("pick", blockingType="SINGLE", actionParameters=[{"key": "k", "value": 1}])
        ],
    )
    way = robot_edge(
        "A B",
        mobileRobotOrientations=[0.0, pi],
        corridor={"maximumLeftWidth": 1, "maximumRightWidth": 1},
        physicalLineGuidedProperty={"direction": "LEFT"},
    )
    station = {"stationId": "S", "stationType": "rack", "interactionNodeIds": ["A"]}
    data = lif_2_0(
        origin(layout(first, robot_node("B", 3, 4), way, station)),
        origin(layout(robot_node("C"), layoutId="up"), originId="P"),
    )
    assert losses(data, LifVersion.V2_0) == []
    assert losses(data, LifVersion.V1_0) == [
        "origins beyond the first, whose layouts then use its frame (1 times)",
        "bounds of deviations at nodes (1 times)",
        "load restrictions of nodes (1 times)",
        "forbidden actions, which are omitted (2 times)",
        "orientations beyond the first (1 times)",
        "corridors (1 times)",
        "properties of line guidance (1 times)",
        "blockingType SINGLE, written as HARD (1 times)",
        "action parameter values other than text, written as JSON (1 times)",
        "types of stations (1 times)",
        "unknown heights of stations, written as 0 (1 times)",
    ]
    report = write(read(data).model, at=NOW)
    assert {each.code for each in read(report.data, strict=True).warnings} >= {"NO_PARK_POSITION"}
    (kept,) = json.loads(report.data)["layouts"][0]["nodes"][0]["vehicleTypeNodeProperties"]
    assert kept == {
        "vehicleTypeId": "M.t",
        "actions": [
            {
                "actionType": "pick",
                "blockingType": "HARD",
                "requirementType": "CONDITIONAL",
                "actionParameters": [{"key": "k", "value": "1"}],
            }
        ],
    }


def test_losses_of_opentcs_are_listed() -> None:
    way = robot_edge(
        "A B", corridor={"maximumLeftWidth": 1, "maximumRightWidth": 1}, forbiddenActionTypes=["x"]
    )
    model = read(lif_2_0_of(robot_node("A"), robot_node("B", 3, 4), way)).model
    told = [each.text for each in opentcs_xml.write(model).warnings]
    assert [text.partition(" (")[0] for text in told[1:]] == ["LIF: forbidden actions", "LIF: corridors"]


def test_conversion_from_1_0_to_2_0_lists_losses() -> None:
    some = [
        action("pick"),
        action("beep", requirementType="REQUIRED"),
        action("drop", requirementType="OPTIONAL"),
    ]
    data = lif_of(
        node(
            "A",
            nodeName="bay",
            nodeDescription="of trucks",
            vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "actions": some}],
        ),
        node("B", 3, 4, "A.t"),
        edge("A B", use("A.t", vehicleOrientation=pi, rotationAllowed=True, maxSpeed=2), edgeName="ramp"),
    )
    assert losses(data, LifVersion.V2_0) == [
        "actions that are OPTIONAL or without a requirementType, written as feasible actions (1 times)",
        "names of nodes, which are put in front of the descriptor (1 times)",
        "manufacturers of vehicle types without a dot, written as empty (1 times)",
    ]
    report = write(read(data).model, LifVersion.V2_0, at=NOW)
    assert read(report.data).model.path("A-B").max_velocity_mm_s == 2000
    (hall,) = json.loads(report.data)["origins"][0]["layouts"]
    (first, _), (way,) = hall["nodes"], hall["edges"]
    assert first["nodeDescriptor"] == "bay: of trucks"
    (rules,) = first["mobileRobotTypeNodeProperties"]
    assert [each["actionType"] for each in rules["requiredActions"]] == ["beep"]
    assert [each["actionType"] for each in rules["feasibleActions"]] == ["pick", "drop"]
    assert way["mobileRobotTypeEdgeProperties"] == [
        {
            "mobileRobotTypes": robot_types("A.t"),
            "reachOrientationBeforeEntering": False,
            "mobileRobotOrientations": [pi],
            "maximumSpeed": 2.0,
        }
    ]


def test_fields_of_2_0_in_a_file_of_1_0_are_ignored() -> None:
    odd = edge("A B", use(corridor={"maximumLeftWidth": 1, "maximumRightWidth": 1}, otherOrientations=[1.0]))
    data = lif_of(node("A"), node("B", 3, 4), odd)
    assert codes(data) == {"IGNORED"}
    (rule,) = read(data).model.path("A-B").vehicle_types
    assert (rule.corridor, rule.other_orientations) == (None, ())


def test_a_missing_rule_of_rotation_is_none_in_1_0() -> None:
    way = edge("A B")
    del way["vehicleTypeEdgeProperties"][0]["rotationAllowed"]
    data = lif_of(node("A"), node("B", 3, 4), way)
    assert "rotationAllowed is missing; read as false" in refusal(data, strict=True)
    (kept,) = written(read(data).model, LifVersion.V1_0)["layouts"][0]["edges"]
    assert kept["vehicleTypeEdgeProperties"] == [{"vehicleTypeId": "t", "rotationAllowed": False}]


@pytest.mark.parametrize(
    ("bounds", "wanted", "ellipse"),
    [
        ({}, 0.5, (0.5, 0.5)),
        ({"a_maximum": 0.4, "b_maximum": 0.25}, 0.5, (0.4, 0.25)),
        ({"a_minimum": 0.8}, 0.5, (0.8, 0.5)),
        ({"b_minimum": 0.8}, 0.5, (0.8, 0.8)),
        ({"a_minimum": 0.4, "a_maximum": 0.4, "b_minimum": 0.2, "b_maximum": 0.2}, 0.5, (0.4, 0.2)),
        ({"a_maximum": 0.1, "b_minimum": 0.2}, 0.5, (0.1, 0.1)),
    ],
)
def test_ellipse_is_clamped_to_its_bounds(
    bounds: dict[str, float], wanted: float, ellipse: tuple[float, float]
) -> None:
    assert DeviationBounds(**bounds).ellipse(wanted) == ellipse
