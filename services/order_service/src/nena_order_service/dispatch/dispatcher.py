"""The dispatcher: gives the most urgent order to the vehicle that has the cheapest way to do it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from nena_order_service.dispatch.way import Way
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import NoRouteError

BUSY = "works on another order"


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
    """What is to be done now, and why all the rest is not."""

    assignments: list[Assignment] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    """Why each order that was not assigned waits, by its name; words that stay the same while they hold."""


FindWay = Callable[[TransportOrder, str], Way]
"""Gives the way of a vehicle through an order's destinations; raises NoRouteError."""


Misfit = Callable[[TransportOrder, str], str]
"""Says, as a predicate, why a vehicle must not do an order, whatever it does now; empty where it may.

Of two orders of one kind (see :func:`_kind`) it says the same.
"""


def _anybody_may(_order: TransportOrder, _vehicle: str) -> str:
    return ""


def decide(
    orders: Iterable[TransportOrder],
    obstacles: Mapping[str, str],
    find_way: FindWay,
    misfit: Misfit = _anybody_may,
) -> Decisions:
    """Assign what can be assigned of the dispatchable ``orders``, which come most urgent first.

    ``obstacles`` says of each vehicle, by its name, why it takes no order now (a predicate such as
    "is offline"); empty where it does. An order is never given to two vehicles, nor two to one.
    """
    decisions = Decisions()
    standing = dict(obstacles)
    nobody_free: dict[Kind, str] = {}
    for order in orders:
        kind = _kind(order)
        if kind in nobody_free:
            decisions.reasons[order.name] = nobody_free[kind]
            continue
        hindrances = _hindrances(order, standing, misfit)
        free = [name for name, hindrance in hindrances.items() if not hindrance]
        if not free:
            reason = _nobody_free(order.status.intended_vehicle, hindrances)
            nobody_free[kind] = decisions.reasons[order.name] = reason
            continue
        best = _best(order, free, find_way)
        if isinstance(best, str):
            decisions.reasons[order.name] = best
        else:
            decisions.assignments.append(best)
            standing[best.vehicle] = BUSY
    return decisions


Kind = tuple[str | None, str, tuple[str, ...]]
"""What an order says about who may do it."""


def _kind(order: TransportOrder) -> Kind:
    status = order.status
    return status.intended_vehicle, status.type, status.excluded_vehicles


def _hindrances(order: TransportOrder, standing: Mapping[str, str], misfit: Misfit) -> dict[str, str]:
    """Say of each vehicle that may be meant why it does not get this order now; empty where it could."""
    intended = order.status.intended_vehicle
    meant = standing if intended is None else [name for name in (intended,) if name in standing]
    return {name: misfit(order, name) or standing[name] for name in meant}


def _best(order: TransportOrder, free: Sequence[str], find_way: FindWay) -> Assignment | str:
    """Give the cheapest assignment, or why there is none."""
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
        return reason
    cost, name, way = min(ways, key=lambda each: each[:2])
    return Assignment(order, name, way, _why(cost, len(free), order.status.intended_vehicle))


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
