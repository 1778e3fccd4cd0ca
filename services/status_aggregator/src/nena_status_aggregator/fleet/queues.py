"""Queues of waiting robots, and jams: many robots behind one head for long."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import datetime

from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.fleet_api.wait_chains import WaitChain, wait_chains
from nena_status_aggregator.fleet.condition import Condition
from nena_status_aggregator.fleet.robot import Robot, Timestamp
from nena_status_aggregator.settings import JamSettings

STUCK = (
    Condition.OFFLINE,
    Condition.BROKEN,
    Condition.SILENT,
    Condition.MANUAL,
    Condition.ERROR,
    Condition.BLOCKED,
)
"""Conditions in which a robot does not continue without a person's intervention."""

STUCK_ELSEWHERE = (VehicleState.ERROR, VehicleState.UNAVAILABLE, VehicleState.UNKNOWN)
"""The same for robots of other shares, of which only the order service's status is known."""


@dataclass(frozen=True, slots=True)
class Jam:
    """Robots that wait behind one head, or in a circle and behind it."""

    end: tuple[str, ...]
    """The head, or the vehicles of the circle."""
    circle: bool
    robots: int
    """Number of waiting robots, without those of other shares."""
    since: datetime
    """Time since which there are more than the limit."""


def _awaited(wait: TrafficWait) -> tuple[str, ...]:
    """Return the vehicles that are waited for, or the locked path, which is then the head of the queue."""
    return (wait.at,) if wait.cause is WaitCause.LOCKED and wait.at else wait.vehicles


class Queues:
    """The queues of waiting vehicles, by the vehicles' names."""

    def __init__(self, limits: JamSettings) -> None:
        self.chains: dict[str, WaitChain] = {}
        """The chain of each waiting vehicle."""
        self._limits = limits
        self._waits: dict[str, tuple[str, ...]] = {}
        self._stuck: dict[str, None] = {}
        self._elsewhere: set[str] = set()
        """Vehicles of other shares: chains lead through them, but they are not counted."""
        self._changed = False
        self._sizes: Counter[tuple[str, ...]] = Counter()
        self._long: dict[tuple[str, ...], Timestamp] = {}
        """Time since which queues have been longer than the limit, by their ends."""

    def update_robot(self, robot: Robot) -> None:
        """Record the vehicles that a robot waits for, and whether it is stuck."""
        vehicle = robot.vehicle
        if vehicle is None:
            return
        self._elsewhere.discard(vehicle.name)
        # A robot in any other condition would not drive on if those vehicles left: it heads its own queue.
        waiting = robot.condition is Condition.WAITING and vehicle.wait
        self._set_waits(vehicle.name, _awaited(waiting) if waiting else (), stuck=robot.condition in STUCK)

    def update_elsewhere(self, vehicle: VehicleStatus, limit: int) -> None:
        """Record the vehicles that one of another share waits for; ignore new ones beyond ``limit``."""
        if vehicle.name not in self._elsewhere and len(self._elsewhere) >= limit:
            return
        self._elsewhere.add(vehicle.name)
        waits = _awaited(vehicle.wait) if vehicle.wait else ()
        self._set_waits(vehicle.name, waits, stuck=vehicle.state in STUCK_ELSEWHERE)

    def remove_vehicle(self, name: str) -> None:
        """Remove a vehicle."""
        self._set_waits(name, (), stuck=False)

    def update_chains(self, at: Timestamp) -> list[str]:
        """Recompute the chains if anything has changed; return the vehicles whose chain changed."""
        if not self._changed:
            return []
        self._changed = False
        previous, self.chains = self.chains, wait_chains(self._waits, self._stuck)
        # Each share counts its own robots, so that the sum over all aggregators is right.
        self._sizes = Counter(chain.end for name, chain in self.chains.items() if name not in self._elsewhere)
        long = [end for end, number in self._sizes.items() if number > self._limits.robots]
        self._long = {end: self._long.get(end, at) for end in long}
        names = previous.keys() | self.chains.keys()
        return [name for name in names if previous.get(name) != self.chains.get(name)]

    def find_jams(self, at: Timestamp) -> tuple[Jam, ...]:
        """Return the jams as of the last :meth:`update_chains`, the longest queue first."""
        jams = [
            Jam(end, len(end) > 1, self._sizes[end], since.utc)
            for end, since in self._long.items()
            if at.monotonic - since.monotonic >= self._limits.seconds
        ]
        return tuple(sorted(jams, key=lambda jam: (-jam.robots, jam.end)))

    def _set_waits(self, name: str, waits: tuple[str, ...], *, stuck: bool) -> None:
        if self._waits.get(name, ()) != waits:
            self._changed = True
            self._waits.pop(name, None)
            if waits:
                self._waits[name] = waits
        if (name in self._stuck) is not stuck:
            self._changed = True
            self._stuck.pop(name, None)
            if stuck:
                self._stuck[name] = None
