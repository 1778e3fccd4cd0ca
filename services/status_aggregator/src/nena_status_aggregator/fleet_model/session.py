"""State of a robot's node, as far as its messages show it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.own_actions import ROS_SESSION
from nena_status_aggregator.fleet_model.condition import Condition


class SessionState(StrEnum):
    """Whether the program of a robot runs and reaches what drives it."""

    NOT_ACTIVE = "NOT_ACTIVE"
    """It has logged off, sleeps, or was never heard of."""
    INITIATING = "INITIATING"
    """It is there, and no state has come yet."""
    ACTIVE = "ACTIVE"
    """It sends states, and nothing says that it cannot drive."""
    TERMINATING = "TERMINATING"
    """It says that it leaves ROS."""
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
    if condition is Condition.SILENT:
        return SessionState.FAILED
    told = ros_session(state)
    if told:
        return told.state
    blind = any(each.error_type == ErrorType.NAVIGATION_NOT_AVAILABLE for each in state.errors)
    return SessionState.FAILED if blind else SessionState.ACTIVE


@dataclass(frozen=True, slots=True)
class RosSession:
    """What a robot's edge agent tells of its ROS session."""

    state: SessionState
    namespace: str
    domain_id: str


def ros_session(state: StateBrief) -> RosSession | None:
    """Give what the information of a state tells; it is for people, and nothing else goes by it."""
    for entry in state.information or ():
        if entry.info_type == ROS_SESSION:
            facts = {each.reference_key: each.reference_value for each in entry.info_references}
            told = facts.get("state", "")
            if told in SessionState.__members__:
                return RosSession(SessionState(told), facts.get("namespace", ""), facts.get("domainId", ""))
    return None
