"""What an order changes in the robot once it is judged (section 6.1.2)."""

from __future__ import annotations

from collections.abc import Iterable

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.action_states import ActionRecord, loaded_after
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.order_acceptance import (
    Duplicate,
    NewOrder,
    Rejected,
    Situation,
    Update,
    Verdict,
    judge,
)
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.session import switched_off
from nena_edge_agent.protocol.zone_sets import CLOSED
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge, Node, Order

_DURATIONS: dict[str, Until] = {ErrorType.MOBILE_ROBOT_NOT_AVAILABLE: Until.AVAILABLE}
"""How long a refusal is shown, where that is not until another order is accepted."""


class OrderIntake:
    """Judges orders and takes those that pass; a refused one changes nothing but the errors."""

    def __init__(self, parts: RobotParts, flow: ActionFlow) -> None:
        self._parts = parts
        self._flow = flow

    def take(self, order: Order) -> Verdict:
        """Judge ``order`` and do what follows."""
        if self._waits_for_disk(order):
            return Duplicate()
        verdict = judge(order, self._situation(), self._parts.capabilities)
        match verdict:
            case NewOrder():
                self._begin(order)
            case Update():
                self._extend(order)
            case Rejected(error):
                self._parts.errors.show(error, _DURATIONS.get(error.error_type, Until.ORDER_ACCEPTED))
        return verdict

    def _waits_for_disk(self, order: Order) -> bool:
        """Tell whether ``order`` is held and the disk does not have it: no state shows it, but it goes on."""
        progress = self._parts.progress
        held = (progress.order_id, progress.order_update_id) == (order.order_id, order.order_update_id)
        return held and bool(self._parts.journal_problem)

    def _situation(self) -> Situation:
        parts, progress = self._parts, self._parts.progress
        return Situation(
            operating_mode=parts.coming_mode,
            off=switched_off(parts),
            fatal=parts.fatal,
            idle=parts.idle and not parts.clearing,
            cancelled=progress.cancelled or parts.clearing,
            cleared=progress.cleared,
            order_id=progress.order_id,
            order_update_id=progress.order_update_id,
            decision_point=progress.decision_point,
            content=progress.content,
            pose=parts.senses.trusted_pose,
            no_route=parts.senses.no_route,
            maps=parts.map_ids,
            closed=tuple(each for each in parts.zone_sets.enabled if each.zone.zone_type in CLOSED),
            stands_on=progress.last_node_id if progress.on_last_node else "",
            instant_action_ids=frozenset(record.action.action_id for record in parts.instants),
            base_action_ids=frozenset(
                record.action.action_id for record in parts.actions if not self._in_horizon(record)
            ),
            loaded=self._loaded_at_the_end(),
            history=parts.history,
        )

    def _loaded_at_the_end(self) -> bool:
        parts = self._parts
        to_do = (
            record.action
            for record in parts.actions
            if not record.status.ended and not self._in_horizon(record)
        )
        return loaded_after(to_do, parts.capabilities.actions, loaded=bool(parts.loads))

    def _begin(self, order: Order) -> None:
        parts = self._parts
        self._clear_errors()
        if not parts.capabilities.rules.standard.instant_states_until_cleared:
            parts.instants.remove(lambda record: record.status.ended)
        parts.actions.remove(lambda _: True)
        parts.queue.clear()
        parts.history.end(parts.progress.order_id)
        parts.history.accept(order, parts.utc_now)
        parts.progress.begin(order)
        parts.actions.add(_records(order.nodes, order.edges))
        self._flow.enqueue(order.nodes[0].actions)

    def _extend(self, order: Order) -> None:
        """Extend the base; the stitching node is known, and its actions do not run again."""
        parts = self._parts
        self._clear_errors()
        parts.actions.remove(self._in_horizon)
        parts.history.accept(order, parts.utc_now)
        parts.progress.extend(order)
        parts.actions.add(_records(order.nodes[1:], order.edges))

    def _clear_errors(self) -> None:
        self._parts.errors.end(Until.ORDER_ACCEPTED, Until.ORDER_OVER)
        self._parts.goal.forget_failures()

    def _in_horizon(self, record: ActionRecord) -> bool:
        decision_point = self._parts.progress.decision_point
        return decision_point is not None and record.sequence_id > decision_point[1]


def _records(nodes: Iterable[Node], edges: Iterable[Edge]) -> list[ActionRecord]:
    """Make the records in driving order."""
    on_nodes = (
        ActionRecord(action, ActionScope.NODE, node.sequence_id) for node in nodes for action in node.actions
    )
    on_edges = (
        ActionRecord(action, ActionScope.EDGE, edge.sequence_id) for edge in edges for action in edge.actions
    )
    return sorted((*on_nodes, *on_edges), key=lambda record: record.sequence_id)
