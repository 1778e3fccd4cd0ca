"""Observe a simulated site: the ends of orders, and how robots spend their time."""

from __future__ import annotations

import asyncio
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Self

from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    OrderSequenceStatus,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_simulate.site import SimulatedRobot, Site

EACH = 0.5
"""Seconds between two checks of the robots."""
HOUR = 3600.0


class Doing(StrEnum):
    """Activity of a robot."""

    DRIVES_LOADED = "drives with a load"
    DRIVES_EMPTY = "drives empty"
    WORKS = "picks or drops"
    WAITS = "waits"
    IDLE = "has no order"


def _seconds() -> defaultdict[str, float]:
    return defaultdict(float)


@dataclass(slots=True)
class Observed:
    """What robots and orders did after the warm-up."""

    hours: float
    created: int = 0
    """Number of orders that hosts created."""
    failed: int = 0
    waiting: float = 0
    """Number of orders without a robot at the end."""
    leads: list[float] = field(default_factory=list)
    """Lead time of each ended order, seconds from creation to end."""
    finishes: list[float] = field(default_factory=list)
    """Time of each end, seconds after the warm-up."""
    seconds: defaultdict[str, float] = field(default_factory=_seconds)
    """Robot seconds by activity, over all robots."""
    causes: defaultdict[str, float] = field(default_factory=_seconds)
    """Robot seconds of waiting by cause."""
    places: defaultdict[str, float] = field(default_factory=_seconds)
    """Robot seconds of waiting by the path in front of the robot, or by its point."""
    empty: float = 0.0
    """Metres driven without a load."""
    loaded: float = 0.0
    """Metres driven with a load."""
    unfinished: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    """Orders that failed, were unroutable, or wait at the end, by this, the reason's code and its text."""
    notes: Sequence[str] = ()

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return parts as if one had followed the other; ``waiting`` is the average of their ends."""
        if len(parts) == 1:
            return parts[0]
        whole = cls(0.0)
        for part in parts:
            whole.finishes += [at + whole.hours * HOUR for at in part.finishes]
            whole.leads += part.leads
            whole.hours += part.hours
            whole.created += part.created
            whole.failed += part.failed
            whole.empty += part.empty
            whole.loaded += part.loaded
            whole.unfinished += part.unfinished
            whole.notes = part.notes
            for total, more in (
                (whole.seconds, part.seconds),
                (whole.causes, part.causes),
                (whole.places, part.places),
            ):
                for name, seconds in more.items():
                    total[name] += seconds
        whole.waiting = round(sum(each.waiting for each in parts) / len(parts), 1)
        return whole


class Observer:
    """Observes a site from the end of the warm-up."""

    def __init__(self, site: Site) -> None:
        self.found = Observed(site.case.hours)
        self.moved: dict[str, dict[bool, float]] = {}
        """Metres that each robot has driven, without and with a load."""
        self._site = site
        self._begun: datetime | None = None
        self._created: set[str] = set()
        self._orders: dict[str, TransportOrderStatus] = {}
        """Unfinished orders by vehicle."""
        self._ended: Counter[tuple[str, str, str]] = Counter()
        """Orders that failed or were unroutable."""
        self._words = Words((robot.vehicle.name for robot in site.robots), site.offered)
        site.engine.unit_of_work.listeners.append(self)

    def observed(self) -> Observed:
        """Return what has been observed so far."""
        found = self.found
        found.created = len(self._created)
        waiting = [order.status for order in self._site.engine.state.orders.dispatchable()]
        found.waiting = len(waiting)
        found.unfinished = self._ended + Counter(map(self._why_unfinished, waiting))
        found.notes = self._site.notes
        found.empty, found.loaded = (
            sum(each[load] for each in self.moved.values()) for load in (False, True)
        )
        return found

    async def watch(self) -> None:
        """Observe all robots periodically."""
        site = self._site
        await asyncio.sleep(site.case.warm_up)
        self._begun = site.engine.clock.now()
        before = {each.vehicle.name: dict(each.driven) for each in site.robots}
        while True:
            await asyncio.sleep(EACH)
            for robot in site.robots:
                self._look_at(robot)
                start = before[robot.vehicle.name]
                self.moved[robot.vehicle.name] = {
                    loaded: metres - start[loaded] for loaded, metres in robot.driven.items()
                }

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Handle the new version of an order."""
        vehicle = status.processing_vehicle
        if vehicle and not status.state.final:
            self._orders[vehicle] = status
        elif vehicle and (kept := self._orders.get(vehicle)) and kept.name == status.name:
            del self._orders[vehicle]
        if status.automatic or self._begun is None:
            return
        if status.created >= self._begun:
            self._created.add(status.name)
        if status.state is TransportOrderState.FINISHED and status.finished:
            self.found.leads.append((status.finished - status.created).total_seconds())
            self.found.finishes.append((status.finished - self._begun).total_seconds())
        elif status.state.final:
            self.found.failed += 1
            self._ended[self._why_unfinished(status)] += 1

    def _why_unfinished(self, status: TransportOrderStatus) -> tuple[str, str, str]:
        code = status.coded_reason.code if status.coded_reason else ""
        return status.state.value, code, self._words.without_names(status.reason)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Ignore sequences: they are not simulated."""

    def _look_at(self, robot: SimulatedRobot) -> None:
        state = self._site.fleet.view(robot.key).state
        if state is None:
            return
        robot.loaded = bool(state.loads)
        order = self._orders.get(robot.vehicle.name)
        doing = self._activity_of(robot, order)
        self.found.seconds[doing] += EACH
        if doing is not Doing.WAITS or order is None:
            return
        self.found.causes[self._words.without_names(order.reason)] += EACH
        ahead = next((each.edge_id for each in state.edge_states if not each.released), "")
        self.found.places[ahead or state.last_node_id or robot.start.name] += EACH

    @staticmethod
    def _activity_of(robot: SimulatedRobot, order: TransportOrderStatus | None) -> Doing:
        if robot.driver.is_moving:
            return Doing.DRIVES_LOADED if robot.loaded else Doing.DRIVES_EMPTY
        if order is None:
            return Doing.IDLE
        drive = order.drive_orders[max(order.current_drive_order_index, 0)]
        return Doing.WORKS if drive.state is DriveOrderState.OPERATING else Doing.WAITS


class Words:
    """Merges reasons that differ only in names of robots, points and paths into one cause.

    Names of actions and operations are kept.
    """

    def __init__(self, vehicles: Iterable[str], actions: Collection[str] = ()) -> None:
        self._actions = actions
        # Longest first: of several alternatives, re takes the first that matches.
        names = sorted(vehicles, key=len, reverse=True)
        self._names = re.compile(rf"\b({'|'.join(map(re.escape, names))})\b")
        self._known: dict[str, str] = {}

    def without_names(self, reason: str) -> str:
        """Return the cause of a reason."""
        if reason not in self._known:
            text = re.sub(
                r"'([^']*)'", lambda found: found[0] if found[1] in self._actions else "a place", reason
            )
            text = self._names.sub("another", text)
            text = re.sub(r"another((, | and )another)+", "others", text)
            text = re.sub(r"^robot another travels to destination \d+ of \d+(, but it )?", "", text)
            self._known[reason] = re.sub(r"\d+(\.\d+)?", "n", text) or "between two parts of its base"
        return self._known[reason]
