"""Effects that wait for the disk: what no record tells of is not begun, so that it cannot be begun twice."""

from __future__ import annotations

from collections.abc import Iterable

from nena_edge_agent.protocol.effects import CancelAction, Drive, Effect, Halt, SetPosition, StartAction

BEGINNINGS = (Drive, SetPosition, StartAction)
"""All else ends something, or tells of it: that never waits."""


class Postponed:
    """Keeps back what is to be begun while the newest record is not on the disk."""

    def __init__(self) -> None:
        self._waiting: list[Effect] = []

    def sift(self, effects: Iterable[Effect], *, recorded: bool) -> list[Effect]:
        """Give what may be done now, in its order; ``recorded``: a record tells of all ``effects``.

        What is ended while it waits is not begun any more.
        """
        if recorded:
            waiting, self._waiting = self._waiting, []
            return [*waiting, *effects]
        now: list[Effect] = []
        for effect in effects:
            if isinstance(effect, BEGINNINGS):
                self._waiting.append(effect)
            else:
                self._waiting = [each for each in self._waiting if not _ends(effect, each)]
                now.append(effect)
        return now


def _ends(effect: Effect, waiting: Effect) -> bool:
    """Tell whether ``effect`` is the end of what ``waiting`` would begin."""
    match effect, waiting:
        case Halt(), Drive():
            return True
        case CancelAction(action_id), StartAction(action):
            return action.action_id == action_id
        case _:
            return False
