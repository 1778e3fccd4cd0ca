"""The program: reads the settings, runs the robots until a signal comes, leaves in order."""

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
from nena_shared.program import StartError, run
from nena_shared.tasks import TaskFailedError

if TYPE_CHECKING:
    from nena_robot_simulator.node import RobotNode


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


PROGRAM = "nena-robot-simulator"
DESCRIPTION = (
    "Simulates mobile robots as they look on ROS 2 topics under Nav2: goals, statuses, pose, battery, map "
    "and plan. Without settings there is one robot, in ROS domain 0 and no namespace. Faults can be given at "
    "the start (--faults) and while it runs (topic simulator/fault)."
)
LOOK_AROUND = 0.5
"""Seconds between two looks at the robots' threads."""

log = logging.get_logger(__name__)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; the exit status is 0 after a signal, 1 after a failure, 2 for bad settings."""
    with ros_environment():
        return run(SimulatorSettings, _serve, program=PROGRAM, description=DESCRIPTION, argv=argv)


async def _serve(settings: SimulatorSettings, stop: asyncio.Event) -> None:
    try:
        from nena_robot_simulator import node  # noqa: PLC0415 - after the environment is set
    except ImportError as error:
        message = f"ROS 2 for Python is missing ({error}); install nena-robot-simulator[ros]"
        raise StartError(message) from error
    place = hall(**settings.map.model_dump())
    clock = SystemClock()
    robots: list[RobotNode] = []
    try:
        for robot in settings.all_robots:
            robots.append(node.RobotNode(robot, simulator=settings, hall=place, clock=clock))
            robots[-1].start()
        await _wait(robots, stop)
    finally:
        for started in robots:
            started.close()
        log.info("stopped")


async def _wait(robots: Sequence[RobotNode], stop: asyncio.Event) -> None:
    """Wait for the end; a robot whose thread has ended is the end too."""
    while not stop.is_set():
        if not all(robot.alive for robot in robots):
            raise TaskFailedError("a robot's ROS thread")
        try:
            async with asyncio.timeout(LOOK_AROUND):
                await stop.wait()
        except TimeoutError:
            continue


if __name__ == "__main__":
    sys.exit(main())
