"""An actionId stands for one action, for all time (section 7.3)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_shared.vda5050.action import Action


class ActionIds:
    """Remembers which action each id stands for."""

    def __init__(self) -> None:
        self._known: Remembered[str, tuple[str, str]] = Remembered()

    def check(self, actions: Iterable[Action], within: str) -> Iterator[Problem]:
        """Check actions that are sent ``within`` an order, by its id, or as instant actions."""
        for action in actions:
            known = self._known.get(action.action_id)
            if known is None:
                known = self._known[action.action_id] = action.action_type, within
            if known[0] != action.action_type:
                text = f"actionId '{action.action_id}' stands for '{known[0]}' and '{action.action_type}'"
                yield Rule.ACTION_ID, Severity.ERROR, text
            elif known[1] != within:
                text = f"actionId '{action.action_id}' was used before, in {known[1]}"
                yield Rule.ACTION_ID, Severity.WARNING, text
