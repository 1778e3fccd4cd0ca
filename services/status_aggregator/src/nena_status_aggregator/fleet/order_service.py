"""Whether the order service lives, by its sign of life over MQTT."""

from __future__ import annotations

from nena_shared.clock import ClockSkew
from nena_shared.fleet_api.service_status import LOST_AFTER, ServiceStatus
from nena_status_aggregator.fleet.robot import Timestamp


class OrderServiceWatch:
    """Keeps the last status of the leading order service; a fleet may also have none."""

    def __init__(self) -> None:
        self.skew = ClockSkew()
        self._last: ServiceStatus | None = None
        self._heard = 0.0
        """When that came, in monotonic seconds."""

    def hear(self, status: ServiceStatus, at: Timestamp, *, retained: bool) -> None:
        """Store a status; the timestamp of a retained one, or of a last will, is outdated."""
        self._last, self._heard = status, at.monotonic
        if status.online and not retained:
            self.skew.measure(status.timestamp, at.utc)

    def lose(self) -> None:
        """Forget it: there is no link to the broker, or the broker retains no status of it any more."""
        self._last = None
        self.skew = ClockSkew()

    def up(self, now: Timestamp) -> bool | None:
        """Return whether it lives; None: nothing was heard of one."""
        if self._last is None:
            return None
        return self._last.online and now.monotonic - self._heard < LOST_AFTER

    @property
    def store_ready(self) -> bool | None:
        """Return whether it accepts new orders, by its last status; None: no status was received."""
        return None if self._last is None else self._last.store_ready
