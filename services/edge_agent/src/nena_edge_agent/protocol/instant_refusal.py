"""How the refusal of an instant action shows (sections 6.2.1 and 6.6.5.4)."""

from __future__ import annotations

from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorType, error


def refuse(
    parts: RobotParts, action: Action, problem: str, *, hint: str, header_id: int | None = None
) -> None:
    """Let ``action`` be FAILED, and say why until the next instant action is taken."""
    parts.instants.change(action.action_id, ActionStatus.FAILED, problem)
    entry = error(
        ErrorType.INVALID_INSTANT_ACTION,
        problem,
        hint=hint,
        topic="instantActions",
        header_id=header_id,
        action_id=action.action_id,
    )
    parts.errors.show(entry, Until.INSTANT_ACTION_ACCEPTED)
