"""What has to stand in the environment before rclpy is loaded."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile


def prepare_environment() -> None:
    """Set up this process for rclpy; what the user has set stays.

    UDP alone, since shared memory of a process that was killed can block its neighbours for ever. Fields of
    messages check their types, since a number of the wrong type would be sent as garbage. The log files that
    rclpy insists on go to a directory that is removed when the program ends.
    """
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    if "ROS_LOG_DIR" not in os.environ:
        directory = tempfile.mkdtemp(prefix="nena-edge-agent-ros-log-")
        atexit.register(shutil.rmtree, directory, ignore_errors=True)
        os.environ["ROS_LOG_DIR"] = directory
