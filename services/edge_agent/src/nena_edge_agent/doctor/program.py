"""The doctor command: check every link in order, print the findings, and return the exit status."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

from nena_edge_agent.actions.ros_session import session_switch
from nena_edge_agent.doctor.broker import examine_broker
from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict, missing, ok, report, unknown
from nena_edge_agent.doctor.navigation import (
    ROS_LINKS,
    RosView,
    judge_clock,
    judge_map,
    judge_robot,
    kernel_keeps_time,
)
from nena_edge_agent.driver.port import SessionError
from nena_edge_agent.extension import settings_model
from nena_edge_agent.nav2.session_control import prepare_environment
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared import log
from nena_shared.program import EXIT_FAILED, report_misconfigured
from nena_shared.settings import ConfigurationError, LogSettings, load
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import RULES

PROGRAM = "nena-edge-agent doctor"
DESCRIPTION = (
    "Check each link between fleet control and Nav2, in sequence, with the settings of the agent, and report "
    "which is missing and what to do. Sends no goals; can run beside the agent. Exit status: 0 if no "
    "link is missing, 1 if one is, 2 for invalid settings."
)


def main(argv: Sequence[str]) -> int:
    """Run the command, which accepts the agent's arguments."""
    try:
        settings = load(settings_model(), argv, program=PROGRAM, description=DESCRIPTION)
        log.configure(LogSettings(level="error", form="text"))
        findings = asyncio.run(examine(settings))
    except ConfigurationError as error:
        return report_misconfigured(PROGRAM, error)
    sys.stdout.write(report(findings))
    return EXIT_FAILED if any(finding.verdict is LinkVerdict.MISSING for finding in findings) else 0


async def examine(settings: EdgeAgentSettings) -> list[LinkFinding]:
    """Check every link; raises ConfigurationError if the password file cannot be read."""
    # A command may have changed the agent's ROS address: then the robot is where the journal says.
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    journal = settings.journal.folder if settings.journal.enabled else None
    address = session_switch(settings.ros, journal, robot).address
    settings = settings.model_copy(update={"ros": address.applied(settings.ros)})
    broker, (view, robot_findings) = await asyncio.gather(examine_broker(settings), _examine_robot(settings))
    clock = judge_clock(kept=kernel_keeps_time(), ros_offset=view.clock_offset)
    looked_at = None if settings.driver == "loopback" else view
    place = judge_map(looked_at, settings.ros, settings.map_id, broker.plant_maps)
    return [*broker.findings, *robot_findings, place, clock, *judge_power(settings)]


def judge_power(settings: EdgeAgentSettings) -> list[LinkFinding]:
    """Check the commands that hibernate and shut down the robot, if configured."""
    if not settings.power_actions:
        return []
    if not RULES[settings.version].hibernation:
        text = f"VDA 5050 {settings.version} has no hibernation and no shutdown: they are not offered"
        return [LinkFinding(Link.POWER, LinkVerdict.DOUBTFUL, text, "set version to 3.0.1, or remove them")]
    if problems := settings.power.problems():
        text = "; ".join(f"power.{kind}: {problem}" for kind, problem in problems.items())
        return [missing(Link.POWER, text, "correct the command, or install the program")]
    return [ok(Link.POWER, f"offers {', '.join(sorted(settings.power_actions))}")]


async def _examine_robot(settings: EdgeAgentSettings) -> tuple[RosView, list[LinkFinding]]:
    nothing = RosView()
    if settings.driver == "loopback":
        return nothing, unknown(ROS_LINKS, "a loopback robot has none")
    prepare_environment()
    try:
        from nena_edge_agent.doctor.ros_probe import observe_robot  # noqa: PLC0415 - rclpy may be missing

        view = await observe_robot(settings.ros)
    except (ImportError, SessionError) as error:
        remedy = "source the robot's ROS installation before the start, or install nena-edge-agent[ros]"
        first = missing(Link.DOMAIN, f"ROS 2 for Python does not work here: {error}", remedy)
        return nothing, [first, *unknown(ROS_LINKS[1:], "needs ROS")]
    return view, judge_robot(view, settings.ros)
