"""Clearing the order: what a cancel and a change of the operating mode have in common (section 6.6.7)."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.declaration import CANCEL_ORDER
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.travel import Travel
from nena_shared.vda5050.action import ActionStatus


class Clearing:
    """Ends the order where the robot is: a freely navigating robot need not go on to a node."""

    def __init__(self, parts: RobotParts, flow: ActionFlow, travel: Travel) -> None:
        self._parts = parts
        self._flow = flow
        self._travel = travel

    def begin(self) -> None:
        """Stop the robot and its actions; one that cannot be stopped goes on to its own end."""
        if not self._parts.clearing:
            self._parts.clearing = True
            self._flow.give_up()
            self._travel.halt()
        elif self._parts.goal.halt_problem:
            self._travel.resume_halt()

    def advance(self) -> None:
        """Finish, all in one state, when nothing moves and nothing runs any more.

        A person who takes over need not wait for the robot to stand: it may be moved by hand already.
        """
        parts = self._parts
        by_hand = parts.coming_mode.clears_order
        if not parts.clearing or not parts.actions.all_ended or (parts.goal.moving and not by_hand):
            return
        cancelled = bool(parts.instants_running(CANCEL_ORDER))
        parts.clearing = False
        parts.progress.clear(cancelled=cancelled)
        parts.queue.clear()
        parts.goal.forget_failures()
        parts.errors.end(Until.ORDER_OVER)
        parts.end_instants(CANCEL_ORDER, ActionStatus.FINISHED)
