"""Which types of orders a vehicle accepts, and which it likes best."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from nena_shared.fleet_api.order_types import ANY_ORDER_TYPE, ANY_TYPE, AcceptableOrderType


def acceptable(names: Iterable[str] | None) -> tuple[AcceptableOrderType, ...]:
    """Give types by their names, the first one liked best; None: any type is accepted."""
    if names is None:
        return ANY_ORDER_TYPE
    return tuple(AcceptableOrderType(name=name, priority=index) for index, name in enumerate(names))


def type_priority(accepted: Iterable[AcceptableOrderType], order_type: str) -> int | None:
    """Give how much a vehicle likes orders of this type, less is better; None: it does not accept them.

    What it says of the very type counts more than what it says of any (``*``).
    """
    priorities = {each.name: each.priority for each in accepted}
    return priorities.get(order_type, priorities.get(ANY_TYPE))


def why_not_accepted(accepted: Sequence[AcceptableOrderType], order_type: str) -> str:
    """Say, as a predicate, why a vehicle takes no orders of this type; empty if it does."""
    if type_priority(accepted, order_type) is not None:
        return ""
    if not accepted:
        return "accepts no orders of any type"
    names = ", ".join(repr(each.name) for each in sorted(accepted, key=lambda each: each.priority))
    return f"accepts no orders of type {order_type!r}, only {names}"
