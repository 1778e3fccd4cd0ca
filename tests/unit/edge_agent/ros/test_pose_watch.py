from __future__ import annotations

import math

import pytest

from nena_edge_agent.ros.pose_watch import PoseWatch


@pytest.fixture
def watch() -> PoseWatch:
    """A watch that has heard a pose at 100 s."""
    watch = PoseWatch(timeout=5.0, wait=2.0)
    watch.on_pose(100.0)
    return watch


def test_nothing_is_asked_before_the_first_pose() -> None:
    watch = PoseWatch(timeout=5.0, wait=2.0)
    assert not watch.look(driving=True, unsure=False, now=1000.0)
    assert not watch.lost


def test_a_pose_is_asked_for_and_its_coming_ends_the_matter(watch: PoseWatch) -> None:
    assert not watch.look(driving=True, unsure=False, now=104.9)
    assert watch.look(driving=True, unsure=False, now=105.0)
    watch.on_answer(105.1)
    watch.on_pose(105.2)
    assert not watch.look(driving=True, unsure=False, now=110.0)
    assert not watch.lost


def test_lost_is_who_is_promised_a_pose_and_gets_none(watch: PoseWatch) -> None:
    watch.look(driving=True, unsure=False, now=105.0)
    watch.on_answer(105.1)
    asked, lost = [], []
    for now in (106.9, 107.1):
        asked.append(watch.look(driving=True, unsure=False, now=now))
        lost.append(watch.lost)
    watch.on_pose(108.0)
    assert (asked, lost) == ([False, True], [False, True])
    assert not watch.lost


def test_lost_is_who_drives_on_without_a_pose(watch: PoseWatch) -> None:
    for step in range(105):
        watch.on_velocity(0.5, 0.0, 100.0 + step * 0.05)
    watch.look(driving=True, unsure=False, now=105.2)
    assert watch.lost


def test_robot_that_stands_before_an_obstacle_is_not_lost_where_nobody_answers(watch: PoseWatch) -> None:
    for second in range(105, 200):
        watch.on_velocity(0.0, 0.0, float(second))
        watch.look(driving=True, unsure=False, now=float(second))
    watch.on_velocity(math.nan, 0.0, 200.0)
    watch.look(driving=True, unsure=False, now=200.0)
    assert not watch.lost


def test_silence_at_standstill_says_nothing(watch: PoseWatch) -> None:
    assert not watch.look(driving=False, unsure=False, now=1000.0)
    assert not watch.look(driving=True, unsure=False, now=1004.9)
    assert watch.look(driving=True, unsure=False, now=1005.0)


def test_a_robot_that_is_unsure_or_lost_goes_on_asking_also_at_standstill(watch: PoseWatch) -> None:
    assert watch.look(driving=False, unsure=True, now=105.0)
    watch.on_answer(105.0)
    assert watch.look(driving=False, unsure=True, now=107.0)
    assert watch.lost
    assert watch.look(driving=False, unsure=False, now=109.0)
