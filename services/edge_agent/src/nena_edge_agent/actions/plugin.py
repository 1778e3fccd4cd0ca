"""The interface of an action plug-in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.state import Load

Report = Callable[[ActionReport], None]
"""Tells the core of a new status; to be called in the event loop's thread, at any time, also at once."""


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

        An exception fails the action with its text.
        """
        ...
