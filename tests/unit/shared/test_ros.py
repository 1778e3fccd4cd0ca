"""Messages are loaded without ROS's code generator, and work."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros

PROGRAM = """
import sys
from nena_shared.ros import joined_domain

with joined_domain(0):
    from std_msgs.msg import String
    from rclpy.serialization import deserialize_message, serialize_message

    assert deserialize_message(serialize_message(String(data="up")), String).data == "up"
    print([name for name in ("em", "lark", "rosidl_generator_py.generate_py_impl") if name in sys.modules])
from rosidl_generator_py.generate_py_impl import generate_py
print("em" in sys.modules)
"""


def test_the_code_generator_is_loaded_only_where_it_is_used() -> None:
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert run.stdout.split("\n") == ["[]", "True", ""]
