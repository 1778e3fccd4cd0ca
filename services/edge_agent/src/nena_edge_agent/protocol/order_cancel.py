"""cancelOrder, with its edge cases (section 6.1.3)."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.predefined import CANCEL_ORDER
from nena_edge_agent.protocol.travel import Travel
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorType, error


class OrderCancel:
    """Ends the order where the robot is: a freely navigating robot need not go on to a node."""

    def __init__(self, parts: RobotParts, flow: ActionFlow, travel: Travel) -> None:
        self._parts = parts
        self._flow = flow
        self._travel = travel

    def request(self, action: Action) -> None:
        """Begin to cancel; a second request joins the first, and one without an order to cancel fails."""
        parts = self._parts
        wanted = action.parameter("orderId")
        if parts.idle or wanted not in (None, parts.progress.order_id):
            self._refuse(action)
            return
        parts.instants.change(action.action_id, ActionStatus.RUNNING)
        if not parts.cancelling:
            parts.cancelling = True
            self._flow.give_up()
            self._travel.halt()

    def advance(self) -> None:
        """Finish, all in one state, when nothing moves and nothing runs any more."""
        parts = self._parts
        if not parts.cancelling or parts.goal.moving or not parts.actions.all_ended:
            return
        parts.cancelling = False
        parts.progress.clear()
        parts.queue.clear()
        parts.goal.failed_at = None
        parts.errors.end(Until.ORDER_OVER)
        parts.end_instants(CANCEL_ORDER, ActionStatus.FINISHED)

    def _refuse(self, action: Action) -> None:
        parts = self._parts
        text = "there is no order to cancel"
        wanted = action.parameter("orderId")
        if not parts.idle:
            text = f"the active order is '{parts.progress.order_id}', not '{wanted}'"
        parts.instants.change(action.action_id, ActionStatus.FAILED, text)
        entry = error(
            ErrorType.NO_ORDER_TO_CANCEL,
            text,
            hint="the robot's state shows its orderId and what is left of it",
            action_id=action.action_id,
        )
        parts.errors.show(entry, Until.ORDER_ACCEPTED)
