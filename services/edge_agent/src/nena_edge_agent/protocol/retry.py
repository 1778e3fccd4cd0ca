"""retry and skipRetry: what becomes of a failed action that may be tried again (sections 6.2.3, 6.6.9)."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.instant_refusal import refuse
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus


class Retry:
    """Begins an action of the order that is RETRIABLE anew, or lets it be FAILED for good."""

    def __init__(self, parts: RobotParts, flow: ActionFlow) -> None:
        self._parts = parts
        self._flow = flow

    def retry(self, action: Action) -> None:
        """Begin the named action anew."""
        record = self._retriable(action)
        if record is None:
            return
        if self._parts.held:
            self._refuse(action, "the robot is held; let it go on first")
            return
        self._flow.begin_anew(record)
        self._parts.instants.change(action.action_id, ActionStatus.FINISHED)

    def skip(self, action: Action) -> None:
        """Let the named action be FAILED, and the order go on behind it."""
        record = self._retriable(action)
        if record is None:
            return
        self._flow.end(record, ActionStatus.FAILED, record.result)
        self._parts.errors.show(self._flow.failure(record), Until.ORDER_OVER)
        self._flow.schedule()
        self._parts.instants.change(action.action_id, ActionStatus.FINISHED)

    def _retriable(self, action: Action) -> ActionRecord | None:
        wanted = str(action.parameter("actionId"))
        record = self._parts.actions.get(wanted)
        if record is None:
            self._refuse(action, f"the order has no action '{wanted}'")
        elif record.status is not ActionStatus.RETRIABLE:
            self._refuse(action, f"action '{wanted}' is {record.status}, not RETRIABLE")
        else:
            return record
        return None

    def _refuse(self, action: Action, problem: str) -> None:
        hint = "the robot's state shows which actions are RETRIABLE"
        refuse(self._parts, action, problem, hint=hint)
