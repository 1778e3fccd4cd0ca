"""The program: one robot, or a fleet of loopback robots."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.timed_operation import TimedOperation
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.drivers import driver_maker
from nena_edge_agent.journal import sole_user
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import SystemClock
from nena_shared.log import get_logger
from nena_shared.program import run
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.topics import RobotKey

PROGRAM = "nena-edge-agent"
DESCRIPTION = (
    "Makes a ROS 2 robot with Nav2 a VDA 5050 robot: takes orders and instant actions over MQTT, drives, and "
    "reports. Try it without a robot: nena-edge-agent --driver loopback"
)

log = get_logger(__name__)


async def serve(settings: EdgeAgentSettings, stop: asyncio.Event) -> None:
    """Run every robot of ``settings`` until ``stop`` is set."""
    if not settings.journal.enabled:
        await _serve_alone(settings, stop)
        return
    with sole_user(settings.journal.folder, RobotKey(settings.manufacturer, settings.serial_number)):
        await _serve_alone(settings, stop)


async def _serve_alone(settings: EdgeAgentSettings, stop: asyncio.Event) -> None:
    clock = SystemClock()
    operations = (TimedOperation(each) for each in settings.operations)
    registry = ActionRegistry((*operations, Wait()))
    agents = [
        RobotAgent(
            settings,
            serial_number,
            make_driver=driver_maker(settings, index, clock),
            registry=registry,
            clock=clock,
        )
        for index, serial_number in enumerate(settings.serial_numbers)
    ]
    log.info("robots started", robots=len(agents), driver=settings.driver, first=str(agents[0].robot))
    await _run_all(agents, stop)
    log.info("robots stopped")


async def _run_all(agents: Sequence[RobotAgent], stop: asyncio.Event) -> None:
    if len(agents) == 1:
        await agents[0].run(stop)
        return
    async with Supervisor() as supervisor:
        tasks = [supervisor.start(f"agent {each.robot}", each.run(stop), vital=False) for each in agents]
        await asyncio.gather(*tasks)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; the exit status is 0 after a signal, 1 after a failure, 2 for bad settings."""
    return run(EdgeAgentSettings, serve, program=PROGRAM, description=DESCRIPTION, argv=argv)


if __name__ == "__main__":
    sys.exit(main())
