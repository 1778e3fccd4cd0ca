"""Counts and last values of a robot's agent, for its metrics."""

from __future__ import annotations

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveProgress,
    PoseReport,
    SessionReport,
    SessionState,
)
from nena_edge_agent.protocol import events
from nena_shared.clock import ClockSkew


class AgentStatistics:
    """Counts and last values since the start of a robot's agent, for its metrics."""

    def __init__(self) -> None:
        self.arrived = 0
        self.failed = dict.fromkeys(DriveFailure, 0)
        """Failed drives by kind of failure."""
        self.recoveries = 0
        self.session: SessionState | None = None
        self.localized: bool | None = None
        """Whether the robot is localised; None: unknown."""
        self.posed_at: float | None = None
        """Time of the last valid pose, monotonic, s."""
        self.fleet_clock = ClockSkew()
        """Clock skew of the order service, by the timestamps of its orders."""
        self._recoveries_of_drive = 0

    def count_event(self, event: events.Event, now: float) -> None:
        """Count an event."""
        match event:
            case PoseReport(localized=localized):
                self.localized = localized
                if localized:
                    self.posed_at = now
            case DriveProgress(recoveries=recoveries):
                self.recoveries += max(0, recoveries - self._recoveries_of_drive)
                self._recoveries_of_drive = recoveries
            case Arrived():
                self.arrived += 1
                self._recoveries_of_drive = 0
            case DriveFailed():
                self.failed[event.failure] += 1
                self._recoveries_of_drive = 0
            case SessionReport():
                self.session = event.state
            # A timestamp repaired to the time of arrival would always show a skew of 0.
            case events.OrderReceived(utc=utc) if utc and event.dated:
                self.fleet_clock.measure(event.order.timestamp, utc)
            case _:
                pass
