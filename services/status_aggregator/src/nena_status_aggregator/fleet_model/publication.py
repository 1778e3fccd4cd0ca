"""What readers have been told of the fleet, and what they have to be told next."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar, cast

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet_model.delta import Delta, Patch
from nena_status_aggregator.fleet_model.views import (
    FleetView,
    LinkView,
    MalformedView,
    OrderView,
    PlantView,
    RobotView,
)

V = TypeVar("V", RobotView, OrderView)
K = TypeVar("K", RobotKey, str)


class Told(Generic[K, V]):
    """The views of one kind as they have been told, and which of them may have changed since."""

    def __init__(self) -> None:
        self.views: dict[K, V] = {}
        self.touched: dict[K, None] = {}

    def touch(self, key: K) -> None:
        """Have this one looked at by the next :meth:`changes`."""
        self.touched[key] = None

    def changes(self, look: Callable[[K], V | None]) -> tuple[list[Patch], list[str]]:
        """Look at what was touched; give the changes, and the ids of what is there no more."""
        patches: list[Patch] = []
        gone: list[str] = []
        for key in self.touched:
            view = look(key)
            old = self.views.pop(key, None) if view is None else self.views.get(key)
            if view is not None:
                self.views[key] = view
                patches += _patch(old, view)
            elif old is not None:
                gone.append(old["id"])
        self.touched.clear()
        return patches, gone


def _patch(old: RobotView | OrderView | None, new: RobotView | OrderView) -> list[Patch]:
    if old is None:
        return [dict(new)]
    before = cast("Mapping[str, Any]", old)
    changed = {name: value for name, value in new.items() if before[name] != value}
    return [{"id": new["id"], **changed}] if changed else []


class Publication:
    """Numbers the changes, so that a reader can tell where it stands."""

    def __init__(self) -> None:
        self.robots: Told[RobotKey, RobotView] = Told()
        self.orders: Told[str, OrderView] = Told()
        self.plant: PlantView | None = None
        self.link: LinkView = {"connected": False, "since": None}
        self.malformed: MalformedView = {
            "counts": {},
            "lastTopic": None,
            "lastProblem": None,
            "lastTime": None,
        }
        self._told: FleetView = self._fleet(0)

    def flush(
        self,
        robot: Callable[[RobotKey], RobotView | None],
        order: Callable[[str], OrderView | None],
    ) -> Delta | None:
        """Give what changed since the last call; None: nothing. The arguments give views as they are now."""
        delta: Delta = {"id": self._told["id"] + 1}
        robots, robots_gone = self.robots.changes(robot)
        orders, orders_gone = self.orders.changes(order)
        if robots:
            delta["robots"] = robots
        if robots_gone:
            delta["robotsGone"] = robots_gone
        if orders:
            delta["orders"] = orders
        if orders_gone:
            delta["ordersGone"] = orders_gone
        self._tell_parts(delta)
        if len(delta) == 1:
            return None
        self._told = self._fleet(delta["id"])
        return delta

    def snapshot(self) -> FleetView:
        """Give everything as of the last :meth:`flush`."""
        return {
            **self._told,
            "robots": list(self.robots.views.values()),
            "orders": list(self.orders.views.values()),
        }

    def _tell_parts(self, delta: Delta) -> None:
        if self.plant != self._told["plant"]:
            delta["plant"] = self.plant
        if self.link != self._told["link"]:
            delta["link"] = self.link
        if self.malformed != self._told["malformed"]:
            delta["malformed"] = self.malformed

    def _fleet(self, number: int) -> FleetView:
        return {
            "id": number,
            "robots": [],
            "orders": [],
            "plant": self.plant,
            "link": self.link,
            "malformed": self.malformed,
        }
