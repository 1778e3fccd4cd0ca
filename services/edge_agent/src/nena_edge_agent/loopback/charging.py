"""Joins actions that begin or end charging with the loopback robot's battery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nena_edge_agent.actions.plugin import ActionPlugin, Report, RunningAction
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.state import Load


class ChargingWatch:
    """Does what ``plugin`` does, and has ``switch`` called when it begins or ends charging.

    The core hears of it by the battery alone, so that a charger that is taken away ends it as well.
    """

    def __init__(self, plugin: ActionPlugin, switch: Callable[[bool], None]) -> None:
        self._plugin = plugin
        self._switch = switch
        self.declaration = plugin.declaration

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
        """Begin."""

        def watched(told: ActionReport) -> None:
            charging = getattr(
                told, "charging", None
            )  # a plug-in may tell anything; the agent judges it later
            if isinstance(charging, bool):
                self._switch(charging)
                told = replace(told, charging=None)
            report(told)

        return self._plugin.start(action, loads, watched)
