"""What the fields of real ROS messages take, and what they are made of."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.message_shape import FieldError, conformed, message, problems
from nena_edge_agent.actions.message_types import message_type
from nena_shared.vda5050.factsheet import ValueDataType

POSE = "geometry_msgs/msg/PoseStamped"
TYPES = {"height": ValueDataType.NUMBER, "name": ValueDataType.STRING, "count": ValueDataType.INTEGER}


@pytest.mark.parametrize(
    ("type_name", "fields", "problem"),
    [
        ("std_msgs/msg/String", {"dat": "x"}, "fields.dat: std_msgs/msg/String has no such field, only data"),
        ("std_msgs/msg/String", {"data": 5}, "fields.data: 5 is not a text"),
        (
            "std_msgs/msg/String",
            {"data": "{height}"},
            "fields.data: takes a text, and the parameter 'height' is of",
        ),
        (
            "std_msgs/msg/Float64",
            {"data": "{name}"},
            "fields.data: takes a number, and the parameter 'name' is of",
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
        ("sensor_msgs/msg/JointState", {"name": ["a", 1]}, "fields.name.1: 1 is not a text"),
        (
            "geometry_msgs/msg/PoseWithCovariance",
            {"covariance": [1.0]},
            "fields.covariance: [1.0] is not an array of 36",
        ),
    ],
)
def test_what_cannot_be_sent_is_found_with_the_path_of_the_field(
    type_name: str, fields: JsonValue, problem: str
) -> None:
    assert next(problems(fields, message_type(type_name), TYPES, "fields")).startswith(problem)


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
def test_what_can_be_sent_is_taken(type_name: str, fields: JsonValue) -> None:
    assert not list(problems(fields, message_type(type_name), TYPES, "fields"))


def made(type_name: str, fields: JsonValue) -> Any:
    record = message_type(type_name)
    return message(conformed(fields, record, "fields"), record)


def test_whole_numbers_become_floats_where_ros_would_send_garbage() -> None:
    pose = made(POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"x": 3, "y": 2**40}}})

    assert (pose.pose.position.x, pose.pose.position.y) == (3.0, float(2**40))
    assert type(pose.pose.position.x) is float
    assert pose.header.frame_id == "map"


def test_arrays_messages_in_arrays_and_octets_arrive() -> None:
    assert list(made("sensor_msgs/msg/JointState", {"position": [1, 2]}).position) == [1.0, 2.0]
    path = made("nav_msgs/msg/Path", {"poses": [{"pose": {"position": {"y": 1}}}]})
    assert path.poses[0].pose.position.y == 1.0
    assert made("std_msgs/msg/Byte", {"data": 7}).data == b"\x07"


@pytest.mark.parametrize("number", [math.nan, math.inf, True, "1", None])
def test_what_is_no_number_is_refused(number: Any) -> None:
    with pytest.raises(FieldError, match=r"^fields\.data"):
        made("std_msgs/msg/Float64", {"data": number})
