"""The dispatcher: gives the most urgent order to the vehicle that has the cheapest way to do it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from nena_order_service.dispatch.way import Way
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import NoRouteError

BUSY = "works on another order"
IDLE = "has nothing to do: no order waits"
NO_ORDER_FITS = "has nothing to do: the orders that wait are for other vehicles, or it cannot reach them"


@dataclass(frozen=True, slots=True)
class Assignment:
    """One order for one vehicle."""

    order: TransportOrder
    vehicle: str
    way: Way
    why: str
    """Why this vehicle."""


@dataclass(slots=True)
class Decisions:
    """What is to be done now, and why all the rest is not; words that stay while they hold."""

    assignments: list[Assignment] = field(default_factory=list)
    order_reasons: dict[str, str] = field(default_factory=dict)
    """Why each order that was not assigned waits, by its name."""
    vehicle_reasons: dict[str, str] = field(default_factory=dict)
    """Why each vehicle that could take an order has got none, by its name."""


FindWay = Callable[[TransportOrder, str], Way]
"""Gives the way of a vehicle through an order's destinations; raises NoRouteError."""


def decide(orders: Iterable[TransportOrder], obstacles: Mapping[str, str], find_way: FindWay) -> Decisions:
    """Assign what can be assigned of the dispatchable ``orders``.

    ``obstacles`` says of each vehicle, by its name, why it takes no order now (a predicate such as
    "is offline"); empty where it does. An order is never given to two vehicles, nor two to one.
    """
    decisions = Decisions()
    standing = dict(obstacles)
    waiting = sorted(orders, key=lambda order: order.urgency)
    for order in waiting:
        best, reason = _best(order, standing, find_way)
        if best:
            decisions.assignments.append(best)
            standing[best.vehicle] = BUSY
        else:
            decisions.order_reasons[order.name] = reason
    idle = NO_ORDER_FITS if decisions.order_reasons else IDLE
    decisions.vehicle_reasons = {name: idle for name, obstacle in standing.items() if not obstacle}
    return decisions


def _best(
    order: TransportOrder, obstacles: Mapping[str, str], find_way: FindWay
) -> tuple[Assignment | None, str]:
    """Give the cheapest assignment, or why there is none."""
    intended = order.status.intended_vehicle
    names = [intended] if intended is not None else list(obstacles)
    free = [name for name in names if obstacles.get(name) == ""]
    if not free:
        return None, _nobody_free(intended, obstacles)
    ways: list[tuple[float, str, Way]] = []
    reason = ""
    for name in free:
        try:
            way = find_way(order, name)
        except NoRouteError as error:
            reason = f"waits, for vehicle {name!r} has no way: {error}"
        else:
            ways.append((way.cost, name, way))
    if not ways:
        return None, reason
    cost, name, way = min(ways, key=lambda each: each[:2])
    return Assignment(order, name, way, _why(cost, len(free), intended)), ""


def _nobody_free(intended: str | None, obstacles: Mapping[str, str]) -> str:
    if intended is not None:
        return f"waits for vehicle {intended!r}, which {obstacles.get(intended, 'takes no orders')}"
    if not obstacles:
        return "waits for a vehicle: the plant model has none that takes orders"
    kinds = sorted(set(obstacles.values()))
    return f"waits for a vehicle: each of them {' or '.join(kinds)}"


def _why(cost: float, choices: int, intended: str | None) -> str:
    if intended is not None:
        return "it is the intended vehicle"
    if choices == 1:
        return "it is the only vehicle that is free"
    return f"cheapest way ({cost:.0f}) of {choices} vehicles that are free"
