"""Changes between two views of the fleet: small, numbered, and enough to make the second from the first.

A delta names only what changed: of robots and orders the ``id`` and the fields with their new values (a value
replaces the old one whole), the ids of those that are gone, and the other parts whole. Its own ``id`` is one
more than that of the view that it applies to.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NotRequired, TypedDict, TypeVar, cast

from nena_status_aggregator.fleet_model.views import (
    FleetView,
    LinkView,
    MalformedView,
    OrderView,
    PlantView,
    RobotView,
)

V = TypeVar("V", RobotView, OrderView)

Patch = dict[str, Any]
"""``id``, and the fields that changed."""


class Delta(TypedDict):
    """What changed; a part that is not there did not."""

    id: int
    robots: NotRequired[list[Patch]]
    robotsGone: NotRequired[list[str]]
    orders: NotRequired[list[Patch]]
    ordersGone: NotRequired[list[str]]
    plant: NotRequired[PlantView | None]
    link: NotRequired[LinkView]
    malformed: NotRequired[MalformedView]


def apply(delta: Delta, view: FleetView) -> FleetView:
    """Make the view after ``delta`` from the one before it, as every reader of the event stream does."""
    return {
        "id": delta["id"],
        "robots": _patched(view["robots"], delta.get("robots", ()), delta.get("robotsGone", ())),
        "orders": _patched(view["orders"], delta.get("orders", ()), delta.get("ordersGone", ())),
        "plant": delta["plant"] if "plant" in delta else view["plant"],
        "link": delta.get("link", view["link"]),
        "malformed": delta.get("malformed", view["malformed"]),
    }


def _patched(views: list[V], patches: Iterable[Patch], gone: Iterable[str]) -> list[V]:
    result = {view["id"]: cast("Patch", view) for view in views}
    for name in gone:
        result.pop(name, None)
    for patch in patches:
        result[patch["id"]] = {**result.get(patch["id"], {}), **patch}
    return cast("list[V]", list(result.values()))
