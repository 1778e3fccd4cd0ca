"""After a restart nobody is given anything before each robot has been heard."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.fleet import LinkStatus, RobotView
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_shared.clock import Clock
from nena_shared.log import get_logger

log = get_logger(__name__)

MAY_STILL_SPEAK = (LinkStatus.UNKNOWN, LinkStatus.ONLINE, LinkStatus.SILENT)


class RestartGate:
    """Opens once, when the robots that are there have told their states, or patience is at its end.

    Robots that are known from before the restart are waited for also while the broker says nothing of them.
    Those that are away keep what they held.
    """

    def __init__(
        self,
        patience: float,
        clock: Clock,
        *,
        fleet: Callable[[], FleetControl],
        view: Callable[[FleetVehicle], RobotView],
    ) -> None:
        self._patience = patience
        self._clock = clock
        self._fleet = fleet
        self._view = view
        self._until = clock.monotonic() + patience
        self._remembered: tuple[FleetVehicle, ...] = ()
        self._open = False

    def begin(self, remembered: tuple[FleetVehicle, ...]) -> None:
        """Wait for these vehicles, from now on."""
        self._remembered = remembered
        self._until = self._clock.monotonic() + self._patience

    @property
    def is_open(self) -> bool:
        """Whether anybody may be given anything."""
        if not self._open:
            missing = self._missing()
            late = self._clock.monotonic() >= self._until and self._fleet().connected_for() >= self._patience
            self._open = late or (not missing and self._fleet().all_known())
            if self._open and missing:
                log.warning("robots that were not heard keep what they held, if anything", vehicles=missing)
        return self._open

    @property
    def reason(self) -> str:
        """Why nobody is given anything, in words; empty when the gate is open."""
        if self.is_open:
            return ""
        whom = ", ".join(self._missing()) or "each robot"
        return f"it waits after the start until {whom} has told its state"

    def _missing(self) -> list[str]:
        views = ((vehicle.name, self._view(vehicle)) for vehicle in self._remembered)
        return [name for name, view in views if view.state is None and view.link in MAY_STILL_SPEAK]
