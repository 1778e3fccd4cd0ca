"""The rules for a robot's orders, independent of the core that is tested against them."""

from __future__ import annotations

from dataclasses import dataclass, field

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.order import Edge, Node, Order
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import OperatingMode

ORDERS_TAKEN_IN = (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC, OperatingMode.INTERVENED)
FLEET_CONTROLS_IN = (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC)


@dataclass
class Oracle:
    """What must be true of the held order: its way as (nodeId, sequenceId), and its actions."""

    rules: Rules
    order_id: str = ""
    update: int = 0
    message: Order | None = None
    """That was taken last."""
    base: list[tuple[str, int]] = field(default_factory=list)
    horizon: list[tuple[str, int]] = field(default_factory=list)
    reached: int = 0
    cancelled: bool = False
    cleared: bool = False
    mode: OperatingMode = OperatingMode.AUTOMATIC
    base_actions: dict[str, Action] = field(default_factory=dict)
    horizon_actions: set[str] = field(default_factory=set)

    def expected(self, made: Order, *, busy: bool, clearing: bool, stands: bool, forgotten: bool) -> str:
        """Return what must happen to an order: ``taken``, ``dropped`` or ``refused``.

        ``clearing``: the held order is being ended; ``stands``: the robot is at the first node of this one;
        ``forgotten``: its last node is no longer known.
        """
        if self.mode not in ORDERS_TAKEN_IN:
            return "refused"
        if made.order_id != self.order_id:
            wrong_number = self.rules.first_update_id_is_zero and made.order_update_id != 0
            return "refused" if busy or clearing or wrong_number or not stands else "taken"
        if made.order_update_id < self.update or self.cancelled or clearing:
            return "refused"
        if made.order_update_id == self.update:
            same = not self.rules.equal_update_id_compared or self._says_the_same(made)
            return "dropped" if same else "refused"
        first = made.nodes[0]
        fits = (first.node_id, first.sequence_id) == self.base[-1] and not forgotten
        unchanged = not self.rules.stitching_node_repeated or first == self.decision_node
        return "taken" if fits and unchanged and (stands or not self.cleared) else "refused"

    @property
    def decision_node(self) -> Node | None:
        """The last released node of the message that was taken last."""
        nodes = self.message.nodes if self.message else ()
        return next((node for node in reversed(nodes) if node.released), None)

    def takes(self, action_type: str) -> bool:
        """Return whether the mode allows fleet control to request an instant action (section 6.6.6)."""
        if action_type == "stateRequest" or self.mode in FLEET_CONTROLS_IN:
            return True
        return action_type == "cancelOrder" and self.mode in ORDERS_TAKEN_IN

    def switch(self, mode: OperatingMode) -> None:
        """Switch the mode as a person does; one that allows no orders ends the order (section 6.6.7)."""
        if mode is not self.mode:
            self.mode = mode
            self.cleared = self.cleared or mode not in ORDERS_TAKEN_IN

    def take(self, order: Order) -> None:
        """Accept an order."""
        way = [(node.node_id, node.sequence_id) for node in order.nodes]
        released = [node.released for node in order.nodes].count(True)
        if order.order_id != self.order_id:
            self.base, self.reached, self.cancelled = [way[0]], 0, False
            self.base_actions = {each.action_id: each for each in order.nodes[0].actions}
        elif self.cleared:
            self.reached = len(self.base) - 1
        self.cleared = False
        self.order_id, self.update, self.message = order.order_id, order.order_update_id, order
        self.base += way[1:released]
        self.horizon = way[released:]
        self.horizon_actions = set()
        parts: tuple[Node | Edge, ...] = (*order.nodes[1:], *order.edges)
        for part in parts:
            for each in part.actions:
                if part.released:
                    self.base_actions[each.action_id] = each
                else:
                    self.horizon_actions.add(each.action_id)

    def _says_the_same(self, made: Order) -> bool:
        held = self.message
        return held is not None and (made.nodes, made.edges) == (held.nodes, held.edges)
