"""The interface of an action plug-in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from pydantic import JsonValue

from nena_edge_agent.actions.ports import DrivePort, RosPort
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.topics import RobotKey

Report = Callable[[ActionReport], None]
"""Tells the core of a new status, or of progress by RUNNING with a result; at any time, from any thread."""


class PluginUnavailableError(Exception):
    """A plug-in cannot work on this robot; the text says why. The robot goes on without its actions."""


class RunningAction(Protocol):
    """One action that was begun. Every method returns at once; what comes of it is reported."""

    def pause(self) -> None:
        """Hold; report PAUSED. Called only where the declaration allows it."""
        ...

    def resume(self) -> None:
        """Go on; report RUNNING."""
        ...

    def cancel(self) -> None:
        """Give up; report FAILED. Called only where the declaration allows it, and when the agent ends."""
        ...


class ActionPlugin(Protocol):
    """Does one type of action."""

    @property
    def declaration(self) -> ActionDeclaration:
        """What the action is and takes: for the checks of orders and for the factsheet."""
        ...

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
        """Begin ``action``, with ``loads`` on the robot; report RUNNING, and in the end FINISHED or FAILED.

        Returns at once. An exception fails the action with its text.
        """
        ...


@dataclass(frozen=True, slots=True)
class PluginContext:
    """What a plug-in is made with: one for each robot of the program.

    ``options`` are those of the settings for this plug-in. ``ros`` is None on a robot without ROS; a plug-in
    that cannot do without raises :class:`PluginUnavailableError`.
    """

    robot: RobotKey
    drive: DrivePort
    ros: RosPort | None = None
    options: Mapping[str, JsonValue] = field(default_factory=dict)


PluginFactory = Callable[[PluginContext], ActionPlugin | Iterable[ActionPlugin]]
"""What an entry point of the group ``nena.actions`` names: makes one plug-in, or several."""
