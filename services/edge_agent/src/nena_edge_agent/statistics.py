"""Counts what a robot's agent does, for its metrics; a match on each event, and no more."""

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
from nena_edge_agent.protocol.events import Event, OrderReceived
from nena_shared.clock import ClockSkew


class AgentStatistics:
    """Counts since the start of the robot's agent."""

    def __init__(self) -> None:
        self.arrived = 0
        self.failed = dict.fromkeys(DriveFailure, 0)
        """Drives that failed, by how."""
        self.recoveries = 0
        self.session: SessionState | None = None
        self.localized: bool | None = None
        """Whether the robot knows where it is; None: it never did."""
        self.posed_at: float | None = None
        """When the last pose that counts came, in monotonic seconds."""
        self.fleet_clock = ClockSkew()
        """Of the order service, by the timestamps of its orders."""
        self._recoveries_of_drive = 0

    def note(self, event: Event, now: float) -> None:
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
            case OrderReceived(utc=utc) if utc and event.dated:
                self.fleet_clock.measure(event.order.timestamp, utc)
            case _:
                pass
