"""A vehicle as the dispatcher sees it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from nena_order_service.dispatch.load_room import Carried, Pick
from nena_order_service.dispatch.order_types import type_priority
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.order_types import ANY_ORDER_TYPE, AcceptableOrderType


@dataclass(frozen=True, slots=True)
class DispatchedVehicle:
    """Whether a vehicle takes orders now, and which; reasons are predicates, such as "is offline"."""

    name: str
    obstacle: str = ""
    """Why it takes no order at all; empty if it may."""
    restriction: str = ""
    """Why it takes no order but one to recharge; empty if it takes others too."""
    energy: float = 100.0
    """Percent."""
    idle: bool = True
    """Whether it neither charges nor has an order."""
    gives_up: str = ""
    """Name of the dispensable order that it would give up for another one; empty if it has none."""
    kept_for: int | None = None
    """Number of the order for which it gives up a dispensable one; it takes no other."""
    order_types: tuple[AcceptableOrderType, ...] = ANY_ORDER_TYPE
    """The types of orders that it accepts."""
    carried: Carried | None = None
    """The loads that it has; None: none, or nobody knows."""

    def type_priority(self, order: TransportOrder) -> float:
        """Give the priority that orders of this type have here, less is better; infinity: it accepts none."""
        priority = type_priority(self.order_types, order.status.type)
        return inf if priority is None else priority

    def why_not(self, order: TransportOrder, *, recharges: bool, pick: Pick | None = None) -> str:
        """Say, as a predicate, why it does not take this order now; empty if it may.

        ``recharges``: the next thing that the order asks for is to recharge. ``pick``: what it is to pick up
        first, None: nothing before it drops something.
        """
        if self.obstacle:
            return self.obstacle
        if self.kept_for is not None and self.kept_for != order.number:
            return "is kept for another order"
        if self.restriction and not recharges:
            return self.restriction
        if self.gives_up and order.status.dispensable:
            return "has a dispensable order itself"
        return self.carried.why_no_room(pick) if self.carried and pick else ""
