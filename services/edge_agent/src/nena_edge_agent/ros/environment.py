"""What has to stand in the environment before rclpy is loaded."""

from __future__ import annotations

import atexit
import ctypes
import os
import shutil
import tempfile

M_ARENA_MAX = -8
"""Of glibc's mallopt: how many pools there may be."""
POOLS = 2


def prepare_environment() -> None:
    """Set up this process for rclpy; what the user has set stays.

    UDP alone, since shared memory of a process that was killed can block its neighbours for ever. Fields of
    messages check their types, since a number of the wrong type would be sent as garbage. The log files that
    rclpy insists on go to a directory that is removed when the program ends. Threads share memory pools, for
    those of each new session would fill pools of their own, some megabytes until all are in use.
    """
    _limit_memory_pools()
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    if "ROS_LOG_DIR" not in os.environ:
        directory = tempfile.mkdtemp(prefix="nena-edge-agent-ros-log-")
        atexit.register(shutil.rmtree, directory, ignore_errors=True)
        os.environ["ROS_LOG_DIR"] = directory


def _limit_memory_pools() -> None:
    """Set what MALLOC_ARENA_MAX would set; other C libraries have no such thing."""
    if "MALLOC_ARENA_MAX" not in os.environ and hasattr(own := ctypes.CDLL(None), "mallopt"):
        own.mallopt(M_ARENA_MAX, POOLS)
