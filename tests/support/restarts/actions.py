"""Actions of the robot in the world: what they did stays done, what they were at ends with the agent."""

from __future__ import annotations

from nena_edge_agent.actions.plugin import Countdown, Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.state import Load
from support.restarts.fate import Fate
from support.restarts.world import World
from support.robot_core import LAMP, PRESS, WORK

SECONDS = 1.0
"""How long an action takes."""
PICK = ActionDeclaration("pick", WORK.scopes, restartable=True)
DECLARATIONS = (WORK, PRESS, LAMP, PICK)


class WorldAction:
    """Takes its time; the world is notified when it begins."""

    def __init__(self, declaration: ActionDeclaration, world: World, fate: Fate) -> None:
        self.declaration = declaration
        self._world = world
        self._fate = fate

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin."""
        name = action.action_id

        def tell(message: ActionReport) -> None:
            if self._fate.spares(f"tell {message.status} of {name}"):
                report(message)

        def done() -> None:
            if self._fate.alive:
                taken = (Load(load_id=name),) if action.action_type == "pick" else None
                tell(ActionReport(name, ActionStatus.FINISHED, "done", loads=taken))

        countdown = Countdown(name, SECONDS, tell, done)
        if self._fate.spares(f"before: begin {name}"):
            self._world.begin(name, restartable=self.declaration.restartable)
            countdown.start()
        return countdown
