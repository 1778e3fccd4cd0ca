"""Actions of loopback robots: simulated actions, and charging of the simulated battery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nena_edge_agent.actions.builtin import LONGEST
from nena_edge_agent.actions.plugin import ActionPlugin, Countdown, Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

ALL_SCOPES = (ActionScope.NODE, ActionScope.EDGE, ActionScope.INSTANT)
DURATION = Parameter(
    "duration", ValueDataType.NUMBER, required=False, description="s", minimum=0.0, maximum=LONGEST
)

Outcome = Callable[[Action], str | None]
"""Returns why an action fails at its end, None if it succeeds."""


class SimulatedAction:
    """An action that runs for its parameter ``duration``, s, by default 0, and ends with ``outcome``."""

    def __init__(self, declaration: ActionDeclaration, outcome: Outcome) -> None:
        self.declaration = declaration
        self._outcome = outcome

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002 - the interface
        """Start the countdown; the outcome is decided at its end."""
        value = action.parameter(DURATION.key)
        seconds = float(value) if isinstance(value, int | float) else 0.0

        def done() -> None:
            problem = self._outcome(action)
            status = ActionStatus.FAILED if problem else ActionStatus.FINISHED
            report(ActionReport(action.action_id, status, problem or "done"))

        return Countdown(action.action_id, seconds, report, done).start()


class AlternatingOutcome:
    """Alternates between failure and success, beginning with failure; one instance per robot."""

    def __init__(self) -> None:
        self._fails_next = True

    def __call__(self, _: Action) -> str | None:
        """Return a reason to fail on every other call."""
        fails, self._fails_next = self._fails_next, not self._fails_next
        return "simulated failure of failOnce" if fails else None


def simulated_actions() -> tuple[ActionPlugin, ...]:
    """Create the simulated actions of one robot."""
    return (
        SimulatedAction(
            _declare_action(
                "waitUninterrupted", "Waits, and can be neither paused nor cancelled.", stoppable=False
            ),
            lambda _: None,
        ),
        SimulatedAction(
            _declare_action("failAlways", "Fails after its duration."),
            lambda _: "simulated failure of failAlways",
        ),
        SimulatedAction(
            _declare_action("failOnce", "Fails the first time, succeeds the second time, and so on."),
            AlternatingOutcome(),
        ),
        SimulatedAction(
            _declare_action(
                "needParameter",
                "Needs the parameter 'count'; refused without it.",
                Parameter("count", ValueDataType.INTEGER, description="any whole number"),
            ),
            lambda _: None,
        ),
    )


def _declare_action(
    action_type: str, description: str, *parameters: Parameter, stoppable: bool = True
) -> ActionDeclaration:
    return ActionDeclaration(
        action_type,
        scopes=ALL_SCOPES,
        parameters=(DURATION, *parameters),
        pause_allowed=stoppable,
        cancel_allowed=stoppable,
        restartable=True,
        description=description,
    )


class ChargingWatch:
    """Wraps ``plugin``, and calls ``switch`` when one of its actions starts or stops charging.

    The core only reads the battery's charging state, so that disconnecting the charger ends charging too.
    """

    def __init__(self, plugin: ActionPlugin, switch: Callable[[bool], None]) -> None:
        self._plugin = plugin
        self._switch = switch
        self.declaration = plugin.declaration

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
        """Start the plug-in's action."""

        def watched(update: ActionReport) -> None:
            charging = getattr(
                update, "charging", None
            )  # a plug-in may report anything; the agent checks it later
            if isinstance(charging, bool):
                # 0012: else `charging` would stay true after a charger is unplugged by hand.
                self._switch(charging)
                update = replace(update, charging=None)
            report(update)

        return self._plugin.start(action, loads, watched)
