"""Published views and their numbered changes.

A delta contains only changes: of robots, orders and devices the ``id`` and the changed fields (a new value
replaces the old one), the IDs of removed ones, and the other parts as a whole. Its own ``id`` is one more
than that of the view it applies to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Generic, NotRequired, TypedDict, TypeVar, cast

from nena_shared.fleet_api.attention import Matter
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.views import (
    FleetView,
    JamView,
    LinkView,
    MalformedView,
    OrderServiceView,
    OrderView,
    PeripheralView,
    PlantView,
    RobotView,
)

V = TypeVar("V", RobotView, OrderView, PeripheralView)

Patch = dict[str, Any]
"""``id`` and the changed fields."""


class Delta(TypedDict):
    """Changes; parts that did not change are omitted."""

    id: int
    robots: NotRequired[list[Patch]]
    robotsGone: NotRequired[list[str]]
    orders: NotRequired[list[Patch]]
    ordersGone: NotRequired[list[str]]
    peripherals: NotRequired[list[Patch]]
    peripheralsGone: NotRequired[list[str]]
    plant: NotRequired[PlantView | None]
    link: NotRequired[LinkView]
    orderService: NotRequired[OrderServiceView]
    jams: NotRequired[list[JamView]]
    attention: NotRequired[list[Matter]]
    malformed: NotRequired[MalformedView]


K = TypeVar("K", RobotKey, str)


class PublishedViews(Generic[K, V]):
    """The published views of one kind, and the keys of those that may have changed since."""

    def __init__(self) -> None:
        self.views: dict[K, V] = {}
        # A dictionary, because it keeps the order: clients get the changes in the order they happened.
        self._touched: dict[K, None] = {}

    def mark_touched(self, key: K) -> None:
        """Mark a view as possibly changed."""
        self._touched[key] = None

    def take_changes(self, build_view: Callable[[K], V | None]) -> tuple[list[Patch], list[str]]:
        """Rebuild the marked views; return the changes and the IDs of removed views."""
        patches: list[Patch] = []
        removed: list[str] = []
        for key in self._touched:
            view = build_view(key)
            old = self.views.pop(key, None) if view is None else self.views.get(key)
            if view is None:
                if old is not None:
                    removed.append(old["id"])
                continue
            self.views[key] = view
            old_fields = cast("Mapping[str, Any]", old)
            if old is None:
                patches.append(dict(view))
            elif changed := {name: value for name, value in view.items() if old_fields[name] != value}:
                patches.append({"id": view["id"], **changed})
        self._touched.clear()
        return patches, removed


class Publication:
    """Numbers the changes, so that a client can resume."""

    def __init__(self) -> None:
        self.robots: PublishedViews[RobotKey, RobotView] = PublishedViews()
        self.orders: PublishedViews[str, OrderView] = PublishedViews()
        self.peripherals: PublishedViews[str, PeripheralView] = PublishedViews()
        self.fleet: FleetView = {
            "id": 0,
            "robots": [],
            "orders": [],
            "peripherals": [],
            "plant": None,
            "link": {"connected": False, "since": None},
            "orderService": {"up": None, "lastSign": None, "stops": [], "brokerLacks": []},
            "jams": [],
            "attention": [],
            "malformed": {"counts": {}, "lastTopic": None, "lastProblem": None, "lastTime": None},
        }
        """The other parts, each of which is replaced as a whole."""
        self._published = self.fleet.copy()

    def flush(
        self,
        robot: Callable[[RobotKey], RobotView | None],
        order: Callable[[str], OrderView | None],
        peripheral: Callable[[str], PeripheralView | None],
    ) -> Delta | None:
        """Return the changes since the last call, or None. The arguments build the current views."""
        number = self._published["id"] + 1
        delta: dict[str, Any] = {"id": number}
        changes = {
            "robots": self.robots.take_changes(robot),
            "orders": self.orders.take_changes(order),
            "peripherals": self.peripherals.take_changes(peripheral),
        }
        for kind, (patches, gone) in changes.items():
            delta |= {kind: patches} if patches else {}
            delta |= {f"{kind}Gone": gone} if gone else {}
        published = cast("Mapping[str, Any]", self._published)
        for name, part in self.fleet.items():
            if name != "id" and part != published[name]:
                delta[name] = part
        if len(delta) == 1:  # only the id: nothing changed, and no number is used up
            return None
        self._published = {**self.fleet, "id": number}
        return cast("Delta", delta)

    def snapshot(self) -> FleetView:
        """Return everything as of the last :meth:`flush`."""
        return {
            **self._published,
            "robots": list(self.robots.views.values()),
            "orders": list(self.orders.views.values()),
            "peripherals": list(self.peripherals.views.values()),
        }
