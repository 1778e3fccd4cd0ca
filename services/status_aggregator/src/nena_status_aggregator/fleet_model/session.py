"""State of a robot's node, as far as its messages show it."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.error import ErrorType
from nena_status_aggregator.fleet_model.condition import Condition


class SessionState(StrEnum):
    """Whether the program of a robot runs and reaches what drives it."""

    NOT_ACTIVE = "NOT_ACTIVE"
    """It has logged off, sleeps, or was never heard of."""
    INITIATING = "INITIATING"
    """It is there, and no state has come yet."""
    ACTIVE = "ACTIVE"
    """It sends states, and nothing says that it cannot drive."""
    FAILED = "FAILED"
    """It went without a word, or says that its navigation is not there."""


def session_of(condition: Condition, state: StateBrief | None) -> SessionState:
    """Tell the state of a robot's node from its condition and its last state."""
    if condition is Condition.OFFLINE:
        return SessionState.NOT_ACTIVE
    if condition is Condition.BROKEN:
        return SessionState.FAILED
    if state is None:
        return SessionState.INITIATING
    blind = any(each.error_type == ErrorType.NAVIGATION_NOT_AVAILABLE for each in state.errors)
    return SessionState.FAILED if blind or condition is Condition.SILENT else SessionState.ACTIVE
