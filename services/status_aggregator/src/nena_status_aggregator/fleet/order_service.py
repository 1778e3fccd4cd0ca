"""The order service as the aggregator sees it."""

from __future__ import annotations

from datetime import datetime

from nena_shared.clock import ClockSkew
from nena_shared.fleet_api.service_status import LOST_AFTER, ServiceStatus
from nena_shared.fleet_api.stops import SetBy, StopStatus
from nena_shared.mqtt.broker_check import BrokerLack
from nena_status_aggregator.fleet.robot import Timestamp


class OrderServiceWatch:
    """Tracks the last status of the active order service, if the fleet has one."""

    def __init__(self) -> None:
        self.skew = ClockSkew()
        self._last: ServiceStatus | None = None
        self._received_at = 0.0
        """Time of arrival of the last status, monotonic seconds."""
        self.last_sign: datetime | None = None
        """Time of the last heartbeat; None: none received."""
        self.stops: tuple[StopStatus, ...] = ()
        """The active stops; a last will does not have them."""
        self.broker_lacks: tuple[BrokerLack, ...] = ()
        """What it has found that the broker does not do."""
        self.locked_paths: tuple[str, ...] = ()
        """The paths that hosts have locked."""
        self.locked_by: dict[str, SetBy] = {}
        """Who has locked them, by path."""

    def apply_status(self, status: ServiceStatus, at: Timestamp, *, retained: bool) -> None:
        """Store a status."""
        self._last, self._received_at = status, at.monotonic
        # The timestamp of a retained status is old, that of a last will is the one of the connection.
        if status.online:
            self.stops, self.broker_lacks = status.stops, status.broker_lacks
            self.locked_paths, self.locked_by = status.locked_paths, status.locked_by
            self.last_sign = status.timestamp if retained else at.utc
            if not retained:
                self.skew.measure(status.timestamp, at.utc)

    def forget_status(self) -> None:
        """Forget the status: the broker link is down, or the broker no longer retains it."""
        self._last, self.last_sign = None, None
        self.stops, self.broker_lacks, self.locked_paths = (), (), ()
        self.locked_by, self.skew = {}, ClockSkew()

    def is_up(self, now: Timestamp) -> bool | None:
        """Return whether the order service is up; None: no status received."""
        if self._last is None:
            return None
        return self._last.online and now.monotonic - self._received_at < LOST_AFTER

    @property
    def store_ready(self) -> bool | None:
        """Whether the order service accepts new orders, from its last status; None: no status received."""
        return None if self._last is None else self._last.store_ready
