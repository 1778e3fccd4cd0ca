"""``nena-edge-agent check-plugin NAME``: check a plug-in against the contract and print a report."""

from __future__ import annotations

import argparse
import asyncio
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import JsonValue
from pydantic_core import from_json

from nena_edge_agent.actions.builtin import Wait
from nena_edge_agent.actions.messages import (
    FieldError,
    Record,
    action_type,
    conformed,
    message_type,
    read,
    service_type,
)
from nena_edge_agent.actions.plugin import (
    ActionPlugin,
    Fields,
    PluginContext,
    Publisher,
    RosActionClient,
    RosError,
    ServiceClient,
    TopicQos,
)
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.registry import PluginBrokenError, installed_names, make
from nena_edge_agent.actions.ros_port import installed
from nena_edge_agent.actions.run import Watchdog
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.plugin_check.contract import CHECKS, Check, Finding, Subject, Verdict, examine
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared import log
from nena_shared.program import EXIT_FAILED, report_misconfigured
from nena_shared.settings import ConfigurationError, LogSettings, load
from nena_shared.vda5050.topics import RobotKey

DRIVE_TIME = 0.2
"""Duration of every simulated drive, seconds."""


class DryRos:
    """Simulated ROS: accepts valid messages and publishes none; services report success."""

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Return a publisher with one subscriber.

        Raises:
            RosError: the type is not installed.

        """
        return _DryPublisher(topic, installed(message_type, type_name))

    def subscribe(
        self,
        topic: str,  # noqa: ARG002 - the port's names
        type_name: str,
        handle: Callable[[Fields], None],  # noqa: ARG002
        *,
        qos: TopicQos = TopicQos.RELIABLE,  # noqa: ARG002
    ) -> None:
        """Check the type; no messages arrive.

        Raises:
            RosError: the type is not installed.

        """
        installed(message_type, type_name)

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Return a client whose service always responds.

        Raises:
            RosError: the type is not installed.

        """
        return _DryClient(service, *installed(service_type, type_name))

    def action(self, name: str, type_name: str) -> RosActionClient:
        """Return a client whose goals all succeed.

        Raises:
            RosError: the type is not installed.

        """
        return _DryAction(name, *installed(action_type, type_name))


class DryDrive:
    """Simulated drives, which arrive after ``DRIVE_TIME``."""

    def __init__(self) -> None:
        self.pose: Pose | None = Pose(0.0, 0.0, 0.0, "map")

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,  # noqa: ARG002 - the port's names
        deviation_theta: float | None = None,  # noqa: ARG002
        maximum_speed: float | None = None,  # noqa: ARG002
    ) -> None:
        """Wait, then arrive."""
        await asyncio.sleep(DRIVE_TIME)
        self.pose = pose

    async def initialize_position(self, pose: Pose) -> None:
        """Accept the position."""
        self.pose = pose


class _DryAction:
    def __init__(self, name: str, goal: Record, kind: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        self._name = name
        self._goal = goal
        self._kind = kind

    async def run(self, fields: Mapping[str, JsonValue]) -> Fields:
        _conform(fields, self._goal, self._name)
        await asyncio.sleep(DRIVE_TIME)
        return read(self._kind.Result())


class _DryPublisher:
    listeners = 1

    def __init__(self, topic: str, shape: Record) -> None:
        self._topic = topic
        self._shape = shape

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        _conform(fields, self._shape, self._topic)


class _DryClient:
    def __init__(self, service: str, request: Record, response: Record) -> None:
        self._service = service
        self._request = request
        self._response = response

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:  # noqa: ARG002
        _conform(fields, self._request, self._service)
        await asyncio.sleep(0)
        response = read(self._response.make())
        return response | {"success": True} if "success" in response else response


def _conform(fields: Mapping[str, JsonValue], shape: Record, path: str) -> None:
    try:
        conformed(dict(fields), shape, path)
    except FieldError as error:
        raise RosError(str(error)) from error


COMMAND = "check-plugin"
PROGRAM = f"nena-edge-agent {COMMAND}"
DESCRIPTION = (
    "Check that an action plug-in keeps its contract. No robot is needed or moved: ROS and drives are "
    "simulated. Exit status: 0 if all checks pass, 1 if one fails, 2 if the settings are wrong."
)


def main(argv: Sequence[str]) -> int:
    """Run the command with its arguments: a name, its own options and those of the agent."""
    own, rest = _parser().parse_known_args(list(argv))
    try:
        settings = load(EdgeAgentSettings, rest, program=PROGRAM, description=DESCRIPTION)
        log.configure(LogSettings(level="error", form="text"))
        plugins = _plugins(own.name, settings)
    except ConfigurationError as error:
        return report_misconfigured(PROGRAM, error)
    except PluginBrokenError as error:
        sys.stdout.write(f"{own.name}\n  BROKEN    Loads: {error}\n")
        return EXIT_FAILED
    broken = False
    for plugin in plugins:
        subject = Subject(plugin, own.parameters, settings.actions.timeouts, own.timeout)
        findings = findings_of(subject)
        sys.stdout.write(report(plugin.declaration.action_type, findings))
        broken = broken or any(each.verdict is Verdict.BROKEN for each in findings)
    return EXIT_FAILED if broken else 0


def findings_of(subject: Subject, checks: Sequence[Check] = CHECKS) -> list[Finding]:
    """Check a plug-in in a separate thread, as it may block forever."""
    run = _Run(subject, checks)
    thread = threading.Thread(target=run.work, name="trial", daemon=True)
    thread.start()
    while thread.is_alive() and not run.hangs:
        thread.join(0.05)
    return run.findings()


def report(name: str, findings: Sequence[Finding]) -> str:
    """Return the findings as text."""
    lines = [name]
    for each in findings:
        lines.append(f"  {each.verdict:<9} {each.check}: {each.text}")
        if each.remedy:
            lines.append(f"            -> {each.remedy}")
    broken = sum(each.verdict is Verdict.BROKEN for each in findings)
    lines.append(f"  {broken} broken" if broken else "  Passed: the plug-in keeps the contract.")
    return "\n".join(lines) + "\n"


@dataclass
class _Run:
    """The checks of one plug-in, in a thread."""

    subject: Subject
    checks: Sequence[Check]
    found: list[Finding] = field(default_factory=list)
    watchdog: Watchdog | None = None

    def work(self) -> None:
        """Run the checks."""
        asyncio.run(self._work())

    @property
    def hangs(self) -> bool:
        """Return whether a check will never end."""
        return self.watchdog is not None and self.watchdog.hangs.is_set()

    def findings(self) -> list[Finding]:
        """Return the findings, and whether the plug-in blocked the event loop."""
        name, blocked = "Does not block", self.watchdog.blocked if self.watchdog else ""
        if not blocked:
            return [*self.found, Finding(name, Verdict.OK, "the agent's event loop keeps running")]
        ever = ", forever; the other checks were not run" if self.hangs else ""
        remedy = "await, or run blocking code in a thread: asyncio.to_thread"
        return [
            *self.found,
            Finding(name, Verdict.BROKEN, f"blocks the whole agent at {blocked}{ever}", remedy),
        ]

    async def _work(self) -> None:
        self.watchdog = Watchdog()
        await examine(self.subject, self.found, self.checks)
        self.watchdog.stop()


def _plugins(name: str, settings: EdgeAgentSettings) -> tuple[ActionPlugin, ...]:
    """Return the installed plug-in or configured action with this name.

    Raises:
        ConfigurationError: the name is unknown.
        PluginBrokenError: the plug-in provides no actions.

    """
    options = settings.actions.options.get(name, {})
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    context = PluginContext(robot, DryDrive(), DryRos(), options)
    if name in installed_names():
        return make(name, context)
    own = [*ready_made(settings.operations, context, settings.actions), Wait()]
    found = tuple(each for each in own if each.declaration.action_type == name)
    if not found:
        known = ", ".join(installed_names()) or "none"
        types = ", ".join(each.declaration.action_type for each in own)
        raise ConfigurationError([f"NAME: '{name}' is not a plug-in ({known}) or an action ({types})"])
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description=DESCRIPTION,
        epilog="All options of the agent work as well, such as --config FILE.",
        allow_abbrev=False,
    )
    parser.add_argument("name", metavar="NAME", help="an installed plug-in or a configured action")
    parser.add_argument(
        "--parameters", type=_parameters, default={}, metavar="JSON", help="parameters of the actions"
    )
    parser.add_argument(
        "--timeout",
        type=float,
        default=10.0,
        metavar="SECONDS",
        help="time in which an action should end (10)",
    )
    return parser


def _parameters(text: str) -> dict[str, JsonValue]:
    value: JsonValue = from_json(text)
    if not isinstance(value, dict):
        message = "expected a JSON object"
        raise argparse.ArgumentTypeError(message)
    return value
