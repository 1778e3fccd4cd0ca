"""waitForTrigger and what releases it: fleet control, or somebody at the robot (section 6.2.3)."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.declaration import TRIGGER_TYPE, WAIT_FOR_TRIGGER
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus

FLEET_CONTROL = "FLEET_CONTROL"
"""The type of trigger that fleet control pulls."""


class Trigger:
    """Finishes the actions that wait for a trigger of some type."""

    def __init__(self, parts: RobotParts, flow: ActionFlow) -> None:
        self._parts = parts
        self._flow = flow

    def request(self, action: Action) -> None:
        """Release all that wait for fleet control; the standard does not say which one, if there are more."""
        if self.pull(FLEET_CONTROL):
            self._parts.instants.change(action.action_id, ActionStatus.FINISHED)
        else:
            text = "no action waits for a trigger of fleet control"
            self._parts.instants.change(action.action_id, ActionStatus.FAILED, text)

    def pull(self, trigger_type: str) -> bool:
        """Release all that wait for ``trigger_type``; tells whether there were any."""
        waiting = [record for record in self._parts.actions if _waits(record, trigger_type)]
        for record in waiting:
            self._flow.end(record, ActionStatus.FINISHED, f"released by {trigger_type}")
        self._flow.schedule()
        return bool(waiting)


def _waits(record: ActionRecord, trigger_type: str) -> bool:
    if record.action.action_type != WAIT_FOR_TRIGGER or record.status is not ActionStatus.RUNNING:
        return False
    types = record.action.parameter(TRIGGER_TYPE)
    return isinstance(types, list) and trigger_type in types
