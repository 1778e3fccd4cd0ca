"""The program: reads the settings, runs the robots until a signal comes, leaves in order."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nena_robot_simulator.grid_map import hall
from nena_robot_simulator.ros_environment import ros_environment
from nena_robot_simulator.settings import SimulatorSettings
from nena_shared import log as logging
from nena_shared.clock import SystemClock
from nena_shared.settings import ConfigurationError, load

if TYPE_CHECKING:
    from nena_robot_simulator.node import RobotNode

PROGRAM = "nena-robot-simulator"
DESCRIPTION = (
    "Simulates mobile robots as they look on ROS 2 topics under Nav2: goals, statuses, pose, battery, map "
    "and plan. Without settings there is one robot, in ROS domain 0 and no namespace. Faults can be given at "
    "the start (--faults) and while it runs (topic simulator/fault)."
)
STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}
LOOK_AROUND = 0.5
"""Seconds between two looks at the robots' threads."""

log = logging.get_logger(__name__)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; the exit status is 0 after a signal, 1 after a failure, 2 for bad settings."""
    try:
        settings = load(
            SimulatorSettings,
            sys.argv[1:] if argv is None else argv,
            program=PROGRAM,
            description=DESCRIPTION,
        )
    except ConfigurationError as error:
        for problem in error.problems:
            sys.stderr.write(f"{PROGRAM}: {problem}\n")
        return 2
    logging.configure(settings.log)
    # Blocked here, and so in all threads to come, the signals wait until they are asked for.
    signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    with ros_environment():
        return _run(settings)


def _run(settings: SimulatorSettings) -> int:
    try:
        from nena_robot_simulator import node  # noqa: PLC0415 - after the environment is set
    except ImportError as error:
        log.error("ROS 2 for Python is missing; install nena-robot-simulator[ros]", reason=str(error))  # noqa: TRY400
        return 1
    place = hall(**settings.map.model_dump())
    clock = SystemClock()
    robots: list[RobotNode] = []
    try:
        for robot in settings.robots:
            robots.append(node.RobotNode(robot, simulator=settings, hall=place, clock=clock))
            robots[-1].start()
        return _wait(robots)
    finally:
        for started in robots:
            started.close()
        log.info("stopped")


def _wait(robots: Sequence[RobotNode]) -> int:
    """Wait for a signal, or for a robot whose thread has ended."""
    while signal.sigtimedwait(STOP_SIGNALS, LOOK_AROUND) is None:
        if not all(robot.alive for robot in robots):
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
