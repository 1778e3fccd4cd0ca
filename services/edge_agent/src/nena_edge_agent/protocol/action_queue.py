"""Which action may run when, and whether the robot may drive meanwhile (section 6.2.2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_shared.vda5050.action import Action, BlockingType

ALONE = (BlockingType.SINGLE, BlockingType.HARD)
STANDING = (BlockingType.SOFT, BlockingType.HARD)


def lets_drive(actions: Iterable[Action]) -> bool:
    """Tell whether none of ``actions`` wants the robot to stand."""
    return all(action.blocking_type not in STANDING for action in actions)


class ActionQueue:
    """The actions of the nodes reached and edges entered that have not ended, in their order."""

    def __init__(self) -> None:
        self._actions: dict[str, BlockingType] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._actions)

    def append(self, actions: Iterable[Action]) -> None:
        """Put the actions of a node or edge behind those that are queued."""
        self._actions.update((action.action_id, action.blocking_type) for action in actions)

    def remove(self, action_id: str) -> None:
        """Take out an action that has ended; unknown ones are passed over."""
        self._actions.pop(action_id, None)

    def clear(self) -> None:
        """Forget all."""
        self._actions.clear()

    @property
    def driving_allowed(self) -> bool:
        """Whether no SOFT or HARD action is left."""
        return all(blocking not in STANDING for blocking in self._actions.values())

    def runnable(self) -> list[str]:
        """Give the actions that may run now, those that run already among them.

        NONE and SOFT gather from the front and run side by side; a SINGLE or HARD one waits for all before
        it, runs alone, and holds back all behind it.
        """
        gathered: list[str] = []
        for action_id, blocking in self._actions.items():
            if blocking in ALONE:
                return gathered or [action_id]
            gathered.append(action_id)
        return gathered
