"""What traffic control asks of routing."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Protocol

from nena_order_service.routing import Route


class Ways(Protocol):
    """Gives the ways of vehicles, which it knows by name, between points of the plant."""

    def route(self, vehicle: str, start: str, goal: str, *, avoid: Collection[str] = frozenset()) -> Route:
        """Give the cheapest way; raises NoRouteError."""
        ...

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Give what it costs to reach each point that can be reached from ``start``."""
        ...
