"""What has to stand in the environment before rclpy is loaded."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ros_environment() -> Iterator[None]:
    """Set up this process for rclpy; what the user has set stays.

    UDP alone, since shared memory of a process that was killed can block its neighbours for ever. Fields of
    messages check their types, since a number of the wrong type would be sent as garbage. The log files that
    rclpy insists on go to a directory that is removed in the end.
    """
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    if "ROS_LOG_DIR" in os.environ:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="nena-robot-simulator-", ignore_cleanup_errors=True) as directory:
        os.environ["ROS_LOG_DIR"] = directory
        yield
        del os.environ["ROS_LOG_DIR"]
