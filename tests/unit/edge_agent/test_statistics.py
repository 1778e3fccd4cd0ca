from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveProgress,
    Pose,
    PoseReport,
    SessionReport,
    SessionState,
)
from nena_edge_agent.protocol.events import OrderReceived
from nena_edge_agent.statistics import AgentStatistics

POSE = Pose(1.0, 2.0, 0.0, "hall")
NOW = datetime(2026, 1, 1, tzinfo=UTC)


class Dated:
    """The part of an order that has its timestamp."""

    def __init__(self, timestamp: datetime) -> None:
        self.timestamp = timestamp


def order(ahead: float, *, dated: bool = True) -> OrderReceived:
    sent: Any = Dated(NOW + timedelta(seconds=ahead))
    return OrderReceived(sent, NOW, dated=dated)


def test_drives_are_counted_by_their_end() -> None:
    statistics = AgentStatistics()
    statistics.count_event(Arrived(1), 0.0)
    statistics.count_event(DriveFailed(2, DriveFailure.ABORTED, "blocked"), 0.0)
    assert statistics.arrived == 1
    assert {kind for kind, count in statistics.failed.items() if count} == {DriveFailure.ABORTED}


def test_recoveries_are_added_up_over_drives() -> None:
    statistics = AgentStatistics()
    for recoveries in (0, 1, 1, 3):
        statistics.count_event(DriveProgress(1.0, recoveries, "map"), 0.0)
    statistics.count_event(Arrived(1), 0.0)
    statistics.count_event(DriveProgress(1.0, 1, "map"), 0.0)
    assert statistics.recoveries == 4


def test_recoveries_of_a_drive_without_a_reported_end_are_not_counted_twice() -> None:
    statistics = AgentStatistics()
    for recoveries in (2, 0, 1):
        statistics.count_event(DriveProgress(1.0, recoveries, "map"), 0.0)
    assert statistics.recoveries == 3


def test_the_clock_of_the_order_service_is_measured_by_orders_with_a_readable_time() -> None:
    statistics = AgentStatistics()
    statistics.count_event(order(60.0, dated=False), 0.0)
    assert statistics.fleet_clock.seconds is None
    statistics.count_event(order(2.5), 0.0)
    assert statistics.fleet_clock.seconds == 2.5


def test_the_session_is_the_last_reported_one() -> None:
    statistics = AgentStatistics()
    for state in (SessionState.INITIATING, SessionState.ACTIVE):
        statistics.count_event(SessionReport(state, "", 0), 0.0)
    assert statistics.session is SessionState.ACTIVE


def test_a_rejected_pose_is_not_a_new_one() -> None:
    statistics = AgentStatistics()
    assert AgentStatistics().localized is None
    statistics.count_event(PoseReport(POSE, localized=True), 1.0)
    statistics.count_event(PoseReport(POSE, localized=False, problem="no pose for 10 s of driving"), 2.0)
    assert (statistics.localized, statistics.posed_at) == (False, 1.0)
    statistics.count_event(PoseReport(POSE, localized=True), 3.0)
    assert (statistics.localized, statistics.posed_at) == (True, 3.0)
