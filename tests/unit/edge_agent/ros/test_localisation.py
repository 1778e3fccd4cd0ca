from __future__ import annotations

from dataclasses import replace

from structlog.testing import capture_logs

from nena_edge_agent.driver.map_port import MapPose, MapPoseReport
from nena_edge_agent.driver.port import VelocityReport
from nena_edge_agent.ros.localisation import Localisation
from nena_edge_agent.ros.pose import PoseReading
from nena_edge_agent.ros.settings import RosSettings

SECOND = 1_000_000_000
READING = PoseReading(1.0, 2.0, 0.5, "map", 100 * SECOND, 0.01, 0.01, 0.01)


def localisation() -> Localisation:
    return Localisation(RosSettings(), "hall")


def test_nothing_is_known_before_the_first_pose() -> None:
    unknown = localisation()
    unknown.on_velocity((1.0, 0.0), 0.0)
    assert not unknown.known
    assert unknown.report() is None


def test_pose_is_told_with_the_newest_velocity() -> None:
    known = localisation()
    assert known.on_reading(READING) == MapPose(1.0, 2.0, 0.5, "hall")
    assert known.report() == MapPoseReport(
        MapPose(1.0, 2.0, 0.5, "hall"), localized=True, vx=None, omega=None
    )
    known.on_velocity((0.7, 0.1), 0.0)
    assert known.report() == MapPoseReport(MapPose(1.0, 2.0, 0.5, "hall"), localized=True, vx=0.7, omega=0.1)


def test_pose_that_came_already_or_late_is_no_news() -> None:
    known = localisation()
    known.on_reading(READING)
    assert known.on_reading(READING) is None
    assert known.on_reading(replace(READING, x=0.5, stamp=READING.stamp - 1)) is None
    assert known.on_reading(replace(READING, x=1.5, stamp=READING.stamp + 1)) is not None


def test_clock_that_was_set_back_does_not_silence_the_robot() -> None:
    known = localisation()
    known.on_reading(READING)
    assert known.on_reading(replace(READING, stamp=5 * SECOND)) is not None


def test_pose_in_another_frame_is_dropped_and_told_once() -> None:
    lost = localisation()
    with capture_logs() as lines:
        for _ in range(2):
            assert lost.on_reading(replace(READING, frame="odom")) is None
    assert len(lines) == 1
    assert lines[0]["frame"] == "odom"
    assert not lost.known


def test_wide_spread_is_told() -> None:
    lost = localisation()
    lost.on_reading(replace(READING, x_variance=9.0))
    report = lost.report()
    assert report is not None
    assert not report.localized


def test_begin_and_end_of_moving_are_noticed() -> None:
    moving = localisation()
    velocities = [(0.0, 0.0), (0.001, 0.0), (0.5, 0.0), (0.6, 0.0), (0.0, 0.4), (0.0, 0.0)]
    assert [moving.on_velocity(each, 0.0) for each in velocities] == [True, False, True, False, False, True]


def test_a_nearer_place_counts_until_a_pose_comes_that_is_newer() -> None:
    known = localisation()
    assert known.on_nearer(1.5, 2.0, 0.5, "map") is None
    known.on_reading(READING)
    nearer = MapPose(1.5, 2.0, 0.5, "hall")
    assert known.on_nearer(1.5, 2.0, 0.5, "/map") == nearer
    later = replace(READING, x=1.2, stamp=READING.stamp + 1)
    assert known.on_reading(later, old=True) == nearer
    latest = replace(READING, x=1.3, stamp=READING.stamp + 2)
    assert known.on_reading(latest) == MapPose(1.3, 2.0, 0.5, "hall")


def test_a_nearer_place_in_another_frame_is_passed_over() -> None:
    known = localisation()
    known.on_reading(READING)
    assert known.on_nearer(1.5, 2.0, 0.5, "odom") is None


def test_a_velocity_that_no_odometry_confirms_is_forgotten() -> None:
    moving = localisation()
    moving.on_velocity((0.5, 0.0), 10.0)
    assert not moving.forget_stale_velocity(11.0)
    assert moving.velocity == VelocityReport(0.5, 0.0)
    assert moving.forget_stale_velocity(11.1)
    assert moving.velocity == VelocityReport(None, None)
    assert not moving.forget_stale_velocity(12.0)
