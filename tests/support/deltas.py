"""A client of the event stream: what it shows after each delta."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from nena_status_aggregator.fleet.publication import Delta, Patch, V
from nena_status_aggregator.fleet.views import FleetView


def apply_delta(delta: Delta, view: FleetView) -> FleetView:
    """Apply ``delta`` to a view, as clients of the event stream do."""
    return {
        "id": delta["id"],
        "robots": _apply_patches(view["robots"], delta.get("robots", ()), delta.get("robotsGone", ())),
        "orders": _apply_patches(view["orders"], delta.get("orders", ()), delta.get("ordersGone", ())),
        "peripherals": _apply_patches(
            view["peripherals"], delta.get("peripherals", ()), delta.get("peripheralsGone", ())
        ),
        "plant": delta["plant"] if "plant" in delta else view["plant"],
        "link": delta.get("link", view["link"]),
        "orderService": delta.get("orderService", view["orderService"]),
        "jams": delta.get("jams", view["jams"]),
        "attention": delta.get("attention", view["attention"]),
        "malformed": delta.get("malformed", view["malformed"]),
    }


def _apply_patches(views: list[V], patches: Iterable[Patch], gone: Iterable[str]) -> list[V]:
    result = {view["id"]: cast("Patch", view) for view in views}
    for name in gone:
        result.pop(name, None)
    for patch in patches:
        result[patch["id"]] = {**result.get(patch["id"], {}), **patch}
    return cast("list[V]", list(result.values()))
