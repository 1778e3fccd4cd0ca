"""cancelOrder, with its edge cases (section 6.1.3)."""

from __future__ import annotations

from pydantic import JsonValue

from nena_edge_agent.protocol.clearing import Clearing
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorType, error


class OrderCancel:
    """Has the order cleared on request."""

    def __init__(self, parts: RobotParts, clearing: Clearing) -> None:
        self._parts = parts
        self._clearing = clearing
        self._named = parts.capabilities.rules.standard.cancel_names_order

    def request(self, action: Action) -> None:
        """Begin to cancel; a second request joins the first, and one without an order to cancel fails."""
        parts = self._parts
        if parts.idle or self._wanted(action) not in (None, parts.progress.order_id):
            self._refuse(action)
            return
        parts.instants.change(action.action_id, ActionStatus.RUNNING)
        self._clearing.begin()

    def _wanted(self, action: Action) -> JsonValue:
        """Give the orderId that shall be cancelled, None: whatever there is."""
        return action.parameter("orderId") if self._named else None

    def _refuse(self, action: Action) -> None:
        parts = self._parts
        text = "there is no order to cancel"
        if not parts.idle:
            text = f"the active order is '{parts.progress.order_id}', not '{self._wanted(action)}'"
        parts.instants.change(action.action_id, ActionStatus.FAILED, text)
        entry = error(
            ErrorType.NO_ORDER_TO_CANCEL,
            text,
            hint="the robot's state shows its orderId and what is left of it",
            action_id=action.action_id,
        )
        parts.errors.show(entry, Until.ORDER_ACCEPTED)
