from __future__ import annotations

import pytest

from nena_edge_agent.actions.message_shape import Listing, Record, Scalar, ScalarKind
from nena_edge_agent.actions.message_types import (
    UnknownTypeError,
    class_of,
    message_type,
    read,
    service_type,
)


@pytest.mark.parametrize(
    "name", ["std_msgs/String", "std_msgs/srv/String", "String", "std_msgs/msg/..", "os/msg/Path"]
)
def test_what_is_no_message_type_is_refused_with_what_to_do(name: str) -> None:
    with pytest.raises(UnknownTypeError, match=r"no name of a type|source the workspace"):
        message_type(name)


def test_a_type_that_its_package_does_not_have() -> None:
    with pytest.raises(UnknownTypeError, match="there is no type 'std_msgs/msg/Strin' here"):
        message_type("std_msgs/msg/Strin")


def test_shapes_are_those_of_the_definitions() -> None:
    pose = message_type("geometry_msgs/msg/PoseWithCovariance")
    solid = message_type("shape_msgs/msg/SolidPrimitive")

    assert isinstance(pose.fields["pose"], Record)
    assert pose.fields["covariance"] == Listing(Scalar(ScalarKind.NUMBER), exactly=36)
    assert solid.fields["dimensions"] == Listing(Scalar(ScalarKind.NUMBER), most=3)
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

    assert read(path)["poses"][0]["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    assert read(covariance)["covariance"] == [0.0] * 36
    assert read(octets)["data"] == [5]
