"""The instant actions of one robot: each is answered, and a cancelled order has an end (section 6.2.1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from nena_cli.vda5050.action_checks import all_actions
from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.said import Said
from nena_cli.vda5050.sent import Unanswered
from nena_shared.vda5050.action import Action, ActionStatus, InstantActions
from nena_shared.vda5050.state import OperatingMode, State

CANCEL_ORDER: Final = "cancelOrder"
ENDS_ORDER: Final = frozenset({CANCEL_ORDER, "startHibernation"})
ENDINGS: Final = 50
"""Such actions that are remembered."""
HARMLESS: Final = frozenset({"stateRequest", "factsheetRequest"})
"""Asked of robots in any mode by most fleet controls, and no robot is moved by them."""


@dataclass(slots=True)
class _Ending:
    """An instant action that is to end an order."""

    order_ids: frozenset[str]
    """Of the orders that may be meant: the robot may have the newest one already, or not yet."""
    status: ActionStatus | None = None


class InstantConversation:
    """Follows instant actions to their ends."""

    def __init__(self) -> None:
        self._waiting: Unanswered[str] = Unanswered()
        self._types: Remembered[str, str] = Remembered()
        """Of the instant actions that were sent."""
        self._ending: Remembered[str, _Ending] = Remembered(ENDINGS)

    def on_instant_actions(
        self, said: Said, message: InstantActions, state: State | None, newest_order: str | None
    ) -> Iterator[Problem]:
        """Check instant actions; ``state`` is the robot's last one, ``newest_order`` was sent last."""
        for action in message.actions:
            if action.action_id in self._types:
                continue  # sent again, in case that it was lost on the way
            self._types[action.action_id] = action.action_type
            self._waiting.add(action.action_id, said)
            if action.action_type in ENDS_ORDER:
                self._ending[action.action_id] = _Ending(_meant(action, state, newest_order))
            if state and not _allowed(action.action_type, state.operating_mode):
                text = f"{action.action_type} is sent to a robot in the mode {state.operating_mode}"
                yield Rule.MODE, Severity.ERROR, text

    def on_state(self, state: State) -> Iterator[Problem]:
        """Check what a state says of instant actions."""
        told = {each.action_id: each.action_status for each in all_actions(state)}
        self._waiting.state_came(lambda action_id: action_id in told)
        for action_id, ending in self._ending.items():
            before, ending.status = ending.status, told.get(action_id, ending.status)
            if ending.status is ActionStatus.FINISHED and before is not ActionStatus.FINISHED:
                yield from self._end_problems(state, action_id)

    def unanswered(self, now: datetime, *, ended: bool) -> Iterator[tuple[Said, Problem]]:
        """Name instant actions that no state has shown in time, once."""
        for action_id, said in self._waiting.overdue(now, ended=ended):
            text = f"no state shows the instant action '{action_id}'"
            yield said, (Rule.INSTANT_ANSWER, Severity.WARNING, text)

    def ends(self, order_id: str) -> bool:
        """Tell whether an order is being ended by an instant action, or was."""
        endings = (each for each in self._ending.values() if order_id in each.order_ids)
        return any(each.status is not ActionStatus.FAILED for each in endings)

    def _end_problems(self, state: State, action_id: str) -> Iterator[Problem]:
        name = f"{self._types[action_id]} '{action_id}' is FINISHED, and"
        if state.node_states or state.edge_states:
            yield Rule.CANCEL_END, Severity.ERROR, f"{name} nodes or edges of the order are left"
        open_ones = (each.action_id for each in state.action_states if not each.action_status.ended)
        if going_on := [each for each in open_ones if each not in self._types]:
            text = f"{name} actions of the order have not ended: {', '.join(going_on)}"
            yield Rule.CANCEL_END, Severity.ERROR, text


def _meant(action: Action, state: State | None, newest_order: str | None) -> frozenset[str]:
    named = action.parameter("orderId")
    if isinstance(named, str):
        return frozenset({named})
    held = state.order_id if state else None
    return frozenset(each for each in (held, newest_order) if each)


def _allowed(action_type: str, mode: OperatingMode) -> bool:
    if mode is OperatingMode.INTERVENED:
        return action_type in HARMLESS | {CANCEL_ORDER}
    return mode.fleet_controls or action_type in HARMLESS
