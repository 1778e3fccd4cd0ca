"""nena:showMapTransforms: how the plant lies on the robot's maps.

That the factsheet lists this action is what tells fleet control that the robot transforms poses itself.
"""

from __future__ import annotations

from collections.abc import Mapping

from nena_edge_agent.actions.ended import ENDED
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS
from nena_shared.vda5050.state import Load


class MapTransforms:
    """Tells the transforms of the settings, as they stand there."""

    declaration = ActionDeclaration(
        SHOW_MAP_TRANSFORMS,
        scopes=(ActionScope.INSTANT,),
        restartable=True,
        description="Tells how the plant lies on the maps of the robot, which transforms poses itself.",
    )

    def __init__(self, texts: Mapping[str, str]) -> None:
        """Take the transforms by map id."""
        self._result = "; ".join(f"{map_id}: {text}" for map_id, text in sorted(texts.items()))

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Tell at once."""
        report(ActionReport(action.action_id, ActionStatus.FINISHED, self._result))
        return ENDED
