"""The program ``nena-robot-simulator``: environment, start-up and shutdown."""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from nena_robot_simulator.motion import hall
from nena_robot_simulator.settings import SimulatorSettings
from nena_shared import log as logging
from nena_shared.clock import SystemClock
from nena_shared.program import run
from nena_shared.tasks import StartError, TaskFailedError, set_within

if TYPE_CHECKING:
    from nena_robot_simulator.node import RobotNode


@contextmanager
def ros_environment() -> Iterator[None]:
    """Set the environment that rclpy needs; existing variables are kept.

    UDP only, because the shared memory of a killed process can block other processes forever. Message fields
    check their types, because a number of the wrong type would be sent as garbage. rclpy's log files go to a
    temporary directory.
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


PROGRAM = "nena-robot-simulator"
DESCRIPTION = (
    "Simulate mobile robots with Nav2 on ROS 2 topics: goals, statuses, pose, battery, map and plan. By "
    "default one robot in ROS domain 0 without a namespace. Inject faults at start (--faults) or at run time "
    "(topic simulator/fault)."
)
CHECK_PERIOD = 0.5
"""Period of checking the robots' threads, seconds."""

log = logging.get_logger(__name__)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; return 0 after a signal, 1 after a failure, 2 for invalid settings."""
    with ros_environment():
        return run(SimulatorSettings, _serve_robots, program=PROGRAM, description=DESCRIPTION, argv=argv)


async def _serve_robots(settings: SimulatorSettings, stop: asyncio.Event) -> None:
    try:
        from nena_robot_simulator import node  # noqa: PLC0415 - after the environment is set
    except ImportError as error:
        raise StartError(
            f"ROS 2 for Python is missing ({error}); install nena-robot-simulator[ros]"
        ) from error
    place = hall(**settings.map.model_dump())
    clock = SystemClock()
    robots: list[RobotNode] = []
    try:
        for robot in settings.all_robots:
            robots.append(node.RobotNode(robot, simulator=settings, hall=place, clock=clock))
            robots[-1].start()
        await _wait_for_stop(robots, stop)
    finally:
        for started in robots:
            started.close()
        log.info("stopped")


async def _wait_for_stop(robots: Sequence[RobotNode], stop: asyncio.Event) -> None:
    """Wait for a signal, or until a robot's thread ends."""
    while not stop.is_set():
        if not all(robot.alive for robot in robots):
            raise TaskFailedError("a robot's ROS thread")
        await set_within(stop, CHECK_PERIOD)


if __name__ == "__main__":
    sys.exit(main())
