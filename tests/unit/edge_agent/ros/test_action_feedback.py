from __future__ import annotations

from dataclasses import replace

from nena_edge_agent.driver.port import DriveProgress
from nena_edge_agent.ros.action_feedback import FeedbackFilter, FeedbackReading

READING = FeedbackReading("aa", 1.0, 2.0, 0.5, "map", 7.0, 0)


def test_places_are_told_by_the_way_between_them() -> None:
    told = FeedbackFilter()
    assert told.moved(READING, 0.0)
    assert not told.moved(READING, 1.0)
    assert not told.moved(replace(READING, x=1.04), 1.1)
    assert told.moved(replace(READING, x=1.06), 1.2)


def test_turning_on_the_spot_is_told_too() -> None:
    told = FeedbackFilter()
    told.moved(replace(READING, yaw=3.1), 0.0)
    assert not told.moved(replace(READING, yaw=-3.15), 0.1), "nearly the same heading, across the seam"
    assert told.moved(replace(READING, yaw=-2.9), 0.2)
    assert told.moved(replace(READING, yaw=-2.7), 0.3)


def test_is_fresh_for_a_while() -> None:
    told = FeedbackFilter()
    assert not told.fresh(0.0)
    told.moved(READING, 0.0)
    assert told.fresh(0.4)
    assert not told.fresh(0.6)


def test_progress_is_told_each_second_and_recoveries_at_once() -> None:
    told = FeedbackFilter()
    assert told.progress(READING, "hall", 0.0) == DriveProgress(7.0, 0, "hall")
    assert told.progress(replace(READING, left=6.0), "hall", 0.5) is None
    assert told.progress(replace(READING, recoveries=1), "hall", 0.6) == DriveProgress(7.0, 1, "hall")
    assert told.progress(replace(READING, recoveries=1, left=-0.1), "hall", 1.7) == DriveProgress(
        0.0, 1, "hall"
    )


def test_another_drive_is_told_of_at_once() -> None:
    told = FeedbackFilter()
    told.progress(READING, "hall", 0.0)
    assert told.progress(replace(READING, goal_id="bb"), "hall", 0.01) == DriveProgress(7.0, 0, "hall")
