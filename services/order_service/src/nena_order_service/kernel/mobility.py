"""Which vehicles at rest could drive away now, and why the others cannot."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.fleet import LinkStatus, RobotView
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.pauses import Pauses
from nena_order_service.kernel.places import Places
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.vehicles import FleetVehicle, VehicleRegistry
from nena_order_service.traffic.desk import TrafficDesk
from nena_shared.clock import Clock

EVASION_PAUSE = 10.0
"""Seconds in which a robot that did not make room is not asked again."""


class Mobility:
    """Tells traffic of whom it may count on: by what robots say, by their places and by their orders."""

    def __init__(
        self,
        desk: TrafficDesk,
        *,
        places: Places,
        pauses: Pauses,
        missions: MissionBook,
        registry: VehicleRegistry,
        fleet: Callable[[], FleetControl],
        clock: Clock,
    ) -> None:
        self._desk = desk
        self._places = places
        self._pauses = pauses
        self._missions = missions
        self._registry = registry
        self._fleet = fleet
        self._clock = clock
        self._no_evasion_until: dict[str, float] = {}

    def evasion_failed(self, vehicle: FleetVehicle) -> None:
        """Let a vehicle not be sent away again for a while."""
        self._no_evasion_until[vehicle.name] = self._clock.monotonic() + EVASION_PAUSE

    def movable(self, name: str, *, wants: bool = False) -> bool:
        """Tell whether a vehicle at rest could drive away now; ``wants``: it is to drive for its order."""
        vehicle = self._registry.named(name)
        if vehicle is None or vehicle.obstacle or name in self._pauses:
            return False
        if self._places.obstacle(vehicle, working=wants):
            return False
        if self._desk.journey(name) or not self._places.located(vehicle):
            return False
        if self._clock.monotonic() < self._no_evasion_until.get(name, 0.0) and not wants:
            return False
        return self._view(vehicle).availability.can_take_order

    def lost(self, name: str) -> bool:
        """Tell whether nobody knows when a vehicle at rest could drive away."""
        vehicle = self._registry.named(name)
        if vehicle is None or name in self._pauses or self._view(vehicle).link is not LinkStatus.ONLINE:
            return True
        works = self._missions.order_number(vehicle.key) is not None
        return not works and not self.movable(name)

    def why_it_stays(self, vehicle: FleetVehicle) -> str:
        """Say what keeps a vehicle from beginning to drive for its order; empty for nothing."""
        view = self._view(vehicle)
        if not view.availability.can_take_order:
            return f"the robot {view.availability.reason}"
        if obstacle := self._places.obstacle(vehicle, working=True):
            return f"it {obstacle}"
        if not self._places.located(vehicle):
            return "it is not known where it is"
        why = self._desk.why_waiting(vehicle.name)
        return f"it {why}" if why else ""

    def _view(self, vehicle: FleetVehicle) -> RobotView:
        return self._fleet().view(vehicle.key)
