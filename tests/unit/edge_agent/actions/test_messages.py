"""Values of an order in the fields of a message: one rule, and nothing that an order could do with it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import JsonValue

from nena_edge_agent.actions.messages import (
    ArrayShape,
    FieldError,
    Record,
    Scalar,
    ScalarKind,
    UnknownTypeError,
    class_of,
    conform_value,
    fill_template,
    make_message,
    matches,
    message_type,
    placeholder_name,
    read_fields,
    service_type,
    shape_problems,
    template_problems,
    value_at,
)
from nena_shared.vda5050.factsheet import ValueDataType

VALUES: dict[str, JsonValue] = {"height": 1.5, "name": "box", "on": True, "none": None, "list": [1, 2]}


@pytest.mark.parametrize(
    ("template", "expected"),
    [
        ("{height}", 1.5),
        ("{list}", [1, 2]),
        ("raise {height} of {name}", "raise 1.5 of box"),
        ("on: {on}", "on: true"),
        ("{none}", None),
        ("say {none}.", "say ."),
        ("{{name}}", "{name}"),
        (7, 7),
        ({"a": "{height}", "b": {"c": "{none}"}}, {"a": 1.5, "b": {}}),
        (["{name}", "{none}", "{on}"], ["box", True]),
    ],
)
def test_placeholders_are_replaced_by_values(template: JsonValue, expected: JsonValue) -> None:
    assert fill_template(template, VALUES) == expected


@pytest.mark.parametrize(
    ("template", "problem"),
    [
        ({"data": "{hight}"}, "fields.data: unknown parameter 'hight'; known: height, name"),
        ({"a": ["x", "{"]}, "fields.a.1: a lone '{'"),
        ("{name.__class__}", "a lone '{'"),
        ("{name!r}", "a lone '{'"),
        ("{0}", "a lone '{'"),
    ],
)
def test_an_invalid_template_is_reported_with_its_location(template: JsonValue, problem: str) -> None:
    assert next(template_problems(template, ["height", "name"], "fields")).startswith(
        problem if problem.startswith("fields") else f"fields: {problem}"
    )


@given(st.text("{}ab1. _", max_size=20))
def test_a_value_is_not_parsed_as_a_template(value: str) -> None:
    assert fill_template("<{name}>", {"name": value}) == f"<{value}>"
    assert fill_template("{name}", {"name": value}) == value


def test_a_text_that_is_a_single_placeholder_is_recognised() -> None:
    assert placeholder_name("{height}") == "height"
    assert placeholder_name("{height} m") is None


POSE = "geometry_msgs/msg/PoseStamped"
TYPES = {"height": ValueDataType.NUMBER, "name": ValueDataType.STRING, "count": ValueDataType.INTEGER}


@pytest.mark.parametrize(
    ("type_name", "fields", "problem"),
    [
        ("std_msgs/msg/String", {"dat": "x"}, "fields.dat: std_msgs/msg/String has no such field, only data"),
        ("std_msgs/msg/String", {"data": 5}, "fields.data: 5 is not a string"),
        (
            "std_msgs/msg/String",
            {"data": "{height}"},
            "fields.data: must be a string, but the parameter 'height' is of",
        ),
        (
            "std_msgs/msg/Float64",
            {"data": "{name}"},
            "fields.data: must be a number, but the parameter 'name' is of",
        ),
        ("std_msgs/msg/Float64", {"data": "{height} m"}, "fields.data: '{height} m' is not a number"),
        ("std_msgs/msg/UInt8", {"data": 256}, "fields.data: 256 is not an integer from 0 to 255"),
        ("std_msgs/msg/Bool", {"data": 1}, "fields.data: 1 is not true or false"),
        (
            POSE,
            {"pose": {"position": {"X": 1.0}}},
            "fields.pose.position.X: geometry_msgs/msg/Point has no such",
        ),
        (POSE, {"pose": 3}, "fields.pose: 3 is not a table of the fields position, orientation"),
        ("sensor_msgs/msg/JointState", {"name": ["a", 1]}, "fields.name.1: 1 is not a string"),
        (
            "geometry_msgs/msg/PoseWithCovariance",
            {"covariance": [1.0]},
            "fields.covariance: [1.0] is not an array of 36",
        ),
    ],
)
def test_an_invalid_message_is_reported_with_the_path_of_the_field(
    type_name: str, fields: JsonValue, problem: str
) -> None:
    assert next(shape_problems(fields, message_type(type_name), TYPES, "fields")).startswith(problem)


@pytest.mark.parametrize(
    ("type_name", "fields"),
    [
        ("std_msgs/msg/Float64", {"data": "{height}"}),
        ("std_msgs/msg/Float64", {"data": "{count}"}),
        ("std_msgs/msg/String", {"data": "raise {height} of {name}"}),
        ("sensor_msgs/msg/JointState", {"position": ["{height}", 1, 2.5]}),
        (POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1}}}),
        ("std_msgs/msg/Empty", {}),
    ],
)
def test_valid_messages_are_accepted(type_name: str, fields: JsonValue) -> None:
    assert not list(shape_problems(fields, message_type(type_name), TYPES, "fields"))


def made(type_name: str, fields: JsonValue) -> Any:
    record = message_type(type_name)
    return make_message(conform_value(fields, record, "fields"), record)


def test_integers_are_converted_for_float_fields() -> None:
    pose = made(POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"x": 3, "y": 2**40}}})

    assert (pose.pose.position.x, pose.pose.position.y) == (3.0, float(2**40))
    assert type(pose.pose.position.x) is float
    assert pose.header.frame_id == "map"


def test_arrays_nested_messages_and_octets_are_transmitted() -> None:
    assert list(made("sensor_msgs/msg/JointState", {"position": [1, 2]}).position) == [1.0, 2.0]
    path = made("nav_msgs/msg/Path", {"poses": [{"pose": {"position": {"y": 1}}}]})
    assert path.poses[0].pose.position.y == 1.0
    assert made("std_msgs/msg/Byte", {"data": 7}).data == b"\x07"


@pytest.mark.parametrize("number", [math.nan, math.inf, True, "1", None])
def test_nan_and_infinity_are_refused(number: Any) -> None:
    with pytest.raises(FieldError, match=r"^fields\.data"):
        made("std_msgs/msg/Float64", {"data": number})


@pytest.mark.parametrize(
    "name", ["std_msgs/String", "std_msgs/srv/String", "String", "std_msgs/msg/..", "os/msg/Path"]
)
def test_an_unknown_message_type_is_refused_with_a_remedy(name: str) -> None:
    with pytest.raises(UnknownTypeError, match=r"is not a type name|source its workspace"):
        message_type(name)


def test_a_type_missing_in_its_package_is_refused() -> None:
    with pytest.raises(UnknownTypeError, match="type 'std_msgs/msg/Strin' is not installed"):
        message_type("std_msgs/msg/Strin")


def test_shapes_follow_the_type_definitions() -> None:
    pose = message_type("geometry_msgs/msg/PoseWithCovariance")
    solid = message_type("shape_msgs/msg/SolidPrimitive")

    assert isinstance(pose.fields["pose"], Record)
    assert pose.fields["covariance"] == ArrayShape(Scalar(ScalarKind.NUMBER), exactly=36)
    assert solid.fields["dimensions"] == ArrayShape(Scalar(ScalarKind.NUMBER), most=3)
    assert message_type("std_msgs/msg/Int8").fields["data"] == Scalar(ScalarKind.INTEGER, low=-128, high=127)


def test_a_service_has_a_request_and_a_response() -> None:
    request, response = service_type("std_srvs/srv/SetBool")

    assert list(request.fields) == ["data"]
    assert list(response.fields) == ["success", "message"]


def test_a_message_is_read_as_plain_data() -> None:
    path = class_of("nav_msgs/msg/Path")()
    path.poses = [class_of("geometry_msgs/msg/PoseStamped")()]
    covariance = class_of("geometry_msgs/msg/PoseWithCovariance")()
    octets = class_of("std_msgs/msg/ByteMultiArray")()
    octets.data = [b"\x05"]

    assert read_fields(path)["poses"][0]["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    assert read_fields(covariance)["covariance"] == [0.0] * 36
    assert read_fields(octets)["data"] == [5]


MESSAGE = {
    "data": "done",
    "level": 2,
    "ratio": 0.10000000149,
    "pose": {"x": 1.0, "frame": "map"},
    "tags": ["a"],
}


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ({}, True),
        ({"data": "done"}, True),
        ({"data": "don"}, False),
        ({"data": ["failed", "done"]}, True),
        ({"data": []}, False),
        ({"level": 2}, True),
        ({"level": True}, False),
        ({"ratio": 0.1}, True),
        ({"ratio": 0.2}, False),
        ({"pose": {"x": 1}}, True),
        ({"pose": {"x": 1, "frame": ["odom", "map"]}}, True),
        ({"pose": {"y": 1}}, False),
        ({"tags": ["a"]}, True),
        ({"tags": ["b"]}, False),
        ({"tags": "a"}, False),
        ({"absent": 1}, False),
    ],
)
def test_a_message_matches_the_expected_values(wanted: JsonValue, *, expected: bool) -> None:
    assert matches(MESSAGE, wanted) is expected


@pytest.mark.parametrize(
    ("path", "value"), [("data", "done"), ("pose.frame", "map"), ("pose.z", None), ("data.x", None)]
)
def test_a_field_is_found_by_its_path(path: str, value: Any) -> None:
    assert value_at(MESSAGE, path) == value
