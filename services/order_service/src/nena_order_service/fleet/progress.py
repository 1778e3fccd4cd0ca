"""How far a mission has come, from one state alone (VDA 5050 3.0 sections 6.6.2, 6.6.8 and 6.6.9)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.reported import ActionState, State
from nena_shared.vda5050.action import ActionStatus

NOT_BEGUN: Final = frozenset({ActionStatus.WAITING, ActionStatus.FAILED})
"""A waiting action fails without ever having begun when its order is cancelled."""

INSTANT_ONLY: Final = frozenset(
    {
        "cancelOrder",
        "clearInstantActions",
        "clearZoneActions",
        "deleteMap",
        "deleteZoneSet",
        "downloadMap",
        "downloadZoneSet",
        "factsheetRequest",
        "logReport",
        "retry",
        "shutdown",
        "skipRetry",
        "startHibernation",
        "startPause",
        "stateRequest",
        "stopHibernation",
        "stopPause",
        "trigger",
        "updateCertificate",
    }
)
"""Types that never belong to an order; 2.x reports them among the order's actions."""


@dataclass(frozen=True, slots=True)
class Progress:
    """What a state that echoes the mission says about it."""

    passed: int
    """The sequenceId of the last node that has been traversed; -1: none."""
    operating: bool
    """Whether an action of the mission has begun."""
    idle: bool
    """Whether the robot has nothing left to do for it."""
    at_end: bool
    """Whether the robot has come to the last node."""
    failed: tuple[ActionState, ...]
    """The mission's actions that have failed."""
    retriable: tuple[ActionState, ...]
    """Those that have failed and may be tried again."""
    unreported: frozenset[str]
    """Ids of the mission's actions that the state does not know."""

    @property
    def done(self) -> bool:
        """Whether everything has been done, and with success."""
        return self.idle and self.at_end and not self.failed and not self.unreported


def knows(state: State, mission: Mission, update_id: int) -> bool:
    """Tell whether the robot's order is this mission, with all updates up to ``update_id``."""
    return state.order_id == mission.mission_id and state.order_update_id == update_id


def read(state: State, mission: Mission) -> Progress:
    """Read a state that :func:`knows` the mission.

    A node counts as traversed only if it is no longer among those to come: not every robot sets
    lastNodeSequenceId back at once when it takes a new order.
    """
    ids = mission.action_ids
    own = [each for each in state.action_states if each.action_id in ids] if ids else []
    left = bool(state.node_states or state.edge_states)
    passed = state.last_node_sequence_id
    if state.node_states:
        passed = min(passed, state.node_states[0].sequence_id - 1)
    return Progress(
        passed=passed,
        operating=any(each.action_status not in NOT_BEGUN for each in own),
        idle=not left and all(each.action_status.ended for each in own),
        at_end=passed == mission.last_sequence_id,
        failed=tuple(each for each in own if each.action_status is ActionStatus.FAILED),
        retriable=tuple(each for each in own if each.action_status is ActionStatus.RETRIABLE),
        unreported=ids.difference(each.action_id for each in own) if len(own) < len(ids) else frozenset(),
    )


def is_idle(state: State, instant_ids: Collection[str]) -> bool:
    """Tell whether the robot has nothing left to do of any order (section 6.6.8).

    Instant actions do not count; ``instant_ids`` are those that 2.x mixes with the order's actions and that
    their types do not give away.
    """
    if state.node_states or state.edge_states:
        return False
    return all(
        each.action_status.ended or each.action_type in INSTANT_ONLY or each.action_id in instant_ids
        for each in state.action_states
    )
