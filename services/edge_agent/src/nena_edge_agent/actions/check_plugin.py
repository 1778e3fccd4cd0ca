"""``nena-edge-agent check-plugin NAME``: the contract of plug-ins, tried on one of them, as a report."""

from __future__ import annotations

import argparse
import asyncio
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

from pydantic import JsonValue
from pydantic_core import from_json

from nena_edge_agent.actions.contract import CHECKS, Check, Finding, Verdict, examine
from nena_edge_agent.actions.dry_ports import DryDrive, DryRos
from nena_edge_agent.actions.installed import PluginBrokenError, make, names_installed
from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.trial import Subject
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.actions.watchdog import Watchdog
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared import log
from nena_shared.program import EXIT_FAILED, EXIT_MISCONFIGURED
from nena_shared.settings import ConfigurationError, LogSettings, load
from nena_shared.vda5050.topics import RobotKey

COMMAND = "check-plugin"
PROGRAM = f"nena-edge-agent {COMMAND}"
DESCRIPTION = (
    "Tries a plug-in for actions: does it keep to its contract? No robot is needed and none is moved: ROS "
    "and drives are rehearsed. Exit status: 0 when nothing is broken, 1 when something is, 2 for bad "
    "settings."
)


def main(argv: Sequence[str]) -> int:
    """Run the command with its arguments: a name, and options of its own and of the agent."""
    own, rest = _parser().parse_known_args(list(argv))
    try:
        settings = load(EdgeAgentSettings, rest, program=PROGRAM, description=DESCRIPTION)
        log.configure(LogSettings(level="error", form="text"))
        plugins = _plugins(own.name, settings)
    except ConfigurationError as error:
        for problem in error.problems:
            sys.stderr.write(f"{PROGRAM}: setting {problem}\n")
        return EXIT_MISCONFIGURED
    except PluginBrokenError as error:
        sys.stdout.write(f"{own.name}\n  BROKEN    Loads: {error}\n")
        return EXIT_FAILED
    broken = False
    for plugin in plugins:
        subject = Subject(plugin, own.parameters, settings.actions.patience, own.patience)
        findings = findings_of(subject)
        sys.stdout.write(report(plugin.declaration.action_type, findings))
        broken = broken or any(each.verdict is Verdict.BROKEN for each in findings)
    return EXIT_FAILED if broken else 0


def findings_of(subject: Subject, checks: Sequence[Check] = CHECKS) -> list[Finding]:
    """Try a plug-in in a thread of its own, which it may block for ever."""
    run = _Run(subject, checks)
    thread = threading.Thread(target=run.work, name="trial", daemon=True)
    thread.start()
    while thread.is_alive() and not run.hangs:
        thread.join(0.05)
    return run.findings()


def report(name: str, findings: Sequence[Finding]) -> str:
    """Write findings for people."""
    lines = [name]
    for each in findings:
        lines.append(f"  {each.verdict:<9} {each.check}: {each.text}")
        if each.remedy:
            lines.append(f"            -> {each.remedy}")
    broken = sum(each.verdict is Verdict.BROKEN for each in findings)
    lines.append(f"  {broken} broken" if broken else "  It keeps to the contract.")
    return "\n".join(lines) + "\n"


@dataclass
class _Run:
    """The checks of one plug-in, in a thread."""

    subject: Subject
    checks: Sequence[Check]
    found: list[Finding] = field(default_factory=list)
    watchdog: Watchdog | None = None

    def work(self) -> None:
        """Run them."""
        asyncio.run(self._work())

    @property
    def hangs(self) -> bool:
        """Whether they will never end."""
        return self.watchdog is not None and self.watchdog.hangs.is_set()

    def findings(self) -> list[Finding]:
        """Give what was found, with what kept the loop from running."""
        name, blocked = "Does not block", self.watchdog.blocked if self.watchdog else ""
        if not blocked:
            return [*self.found, Finding(name, Verdict.OK, "the agent's event loop runs on meanwhile")]
        ever = ", for ever: the rest could not be tried" if self.hangs else ""
        remedy = "wait by await, or do what blocks in a thread: asyncio.to_thread"
        return [
            *self.found,
            Finding(name, Verdict.BROKEN, f"blocks the whole agent at {blocked}{ever}", remedy),
        ]

    async def _work(self) -> None:
        self.watchdog = Watchdog()
        await examine(self.subject, self.found, self.checks)
        self.watchdog.stop()


def _plugins(name: str, settings: EdgeAgentSettings) -> tuple[ActionPlugin, ...]:
    """Give what goes by the name: an installed plug-in, or an action of the settings.

    Raises:
        ConfigurationError: nothing does.
        PluginBrokenError: the plug-in gives no actions.

    """
    options = settings.actions.options.get(name, {})
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    context = PluginContext(robot, DryDrive(), DryRos(), options)
    if name in names_installed():
        return make(name, context)
    own = [*ready_made(settings.operations, context, settings.actions), Wait()]
    found = tuple(each for each in own if each.declaration.action_type == name)
    if not found:
        known = ", ".join(names_installed()) or "none"
        types = ", ".join(each.declaration.action_type for each in own)
        raise ConfigurationError([f"NAME: '{name}' is none of the plug-ins ({known}) or actions ({types})"])
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description=DESCRIPTION,
        epilog="All further options are those of the agent, such as --config FILE.",
        allow_abbrev=False,
    )
    parser.add_argument("name", metavar="NAME", help="an installed plug-in, or an action of the settings")
    parser.add_argument(
        "--parameters", type=_parameters, default={}, metavar="JSON", help="parameters of the actions"
    )
    parser.add_argument(
        "--patience", type=float, default=10.0, metavar="SECONDS", help="how long an action may take (10)"
    )
    return parser


def _parameters(text: str) -> dict[str, JsonValue]:
    value: JsonValue = from_json(text)
    if not isinstance(value, dict):
        message = "give a JSON object"
        raise argparse.ArgumentTypeError(message)
    return value
