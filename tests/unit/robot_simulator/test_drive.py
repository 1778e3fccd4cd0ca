from __future__ import annotations

import itertools
from uuid import UUID

import pytest

from nena_robot_simulator.drive import PLAN_PARTS, Drive
from nena_robot_simulator.navigator import Progress, Target
from nena_robot_simulator.pose import Pose

GOAL = Pose(10.0, 0.0, 1.0)
TARGET = Target(UUID(int=1), GOAL)
START = Pose(0.0, 0.0, 0.0)


def progress_at(drive: Drive, pose: Pose) -> Progress:
    drive.move_to(pose)
    return drive.progress(pose)


def test_the_goal_counts_as_reached_within_place_and_heading() -> None:
    drive = Drive(TARGET, START, GOAL)
    assert progress_at(drive, Pose(9.7, 0.0, 1.0)) is Progress.UNDERWAY
    assert progress_at(drive, Pose(9.8, 0.0, 0.7)) is Progress.UNDERWAY
    assert progress_at(drive, Pose(9.8, 0.0, 0.8)) is Progress.REACHED


def test_the_place_once_met_stays_met_while_the_robot_turns() -> None:
    drive = Drive(TARGET, START, GOAL)
    drive.move_to(Pose(9.8, 0.0, 0.0))
    assert progress_at(drive, Pose(9.6, 0.0, 1.0)) is Progress.REACHED


def test_headings_agree_across_the_half_turn() -> None:
    goal = Pose(10.0, 0.0, 3.1)
    drive = Drive(Target(UUID(int=1), goal), START, goal)
    assert progress_at(drive, Pose(10.0, 0.0, -3.1)) is Progress.REACHED


def test_the_end_of_the_way_counts_and_not_the_goal() -> None:
    drive = Drive(TARGET, START, Pose(9.5, 0.0, 1.0))
    assert progress_at(drive, Pose(9.3, 0.0, 1.0)) is Progress.REACHED


def test_without_a_way_the_drive_fails_and_has_no_plan() -> None:
    drive = Drive(TARGET, START, None)
    assert progress_at(drive, GOAL) is Progress.FAILED
    assert drive.plan(START) == []


def test_a_drive_is_given_up_after_a_part_of_the_way() -> None:
    drive = Drive(TARGET, START, GOAL, abort_after=0.25)
    assert progress_at(drive, Pose(2.4, 0.0, 0.0)) is Progress.UNDERWAY
    assert progress_at(drive, Pose(2.6, 0.0, 0.0)) is Progress.FAILED


def test_the_plan_leads_straight_from_the_robot_to_the_end() -> None:
    plan = Drive(TARGET, START, GOAL).plan(Pose(8.0, 0.0, 0.5))
    assert plan[0] == pytest.approx((8.0, 0.0, 0.0))
    assert plan[-1] == GOAL
    assert [a.distance(b) for a, b in itertools.pairwise(plan)] == pytest.approx([0.25] * 8)


@pytest.mark.parametrize("x", [1e7, 1e308])
def test_the_plan_of_a_robot_that_was_put_far_away_is_bounded(x: float) -> None:
    poses = Drive(TARGET, START, GOAL).plan(Pose(x, 0.0, 0.0))
    assert len(poses) == PLAN_PARTS + 1
    assert poses[-1] == GOAL


def test_places_on_the_way_are_passed_one_after_the_other() -> None:
    drive = Drive(Target(UUID(int=1), GOAL, (Pose(4.0, 0.0, 0.0), Pose(7.0, 0.0, 0.0))), START, GOAL)
    assert (drive.next_place, drive.behind, drive.places_left) == (Pose(4.0, 0.0, 0.0), 6.0, 3)
    assert progress_at(drive, Pose(3.5, 0.0, 0.0)) is Progress.UNDERWAY
    assert (drive.next_place, drive.behind, drive.places_left) == (Pose(7.0, 0.0, 0.0), 3.0, 2)
    assert drive.left(Pose(3.5, 0.0, 0.0)) == 6.5
    drive.move_to(Pose(7.0, 0.0, 0.0))
    assert (drive.next_place, drive.behind, drive.places_left) == (GOAL, 0.0, 1)


def test_the_end_counts_only_after_the_places_before_it() -> None:
    drive = Drive(Target(UUID(int=1), GOAL, (Pose(10.0, 4.0, 0.0),)), START, GOAL)
    assert progress_at(drive, GOAL) is Progress.UNDERWAY
    drive.move_to(Pose(10.0, 3.5, 0.0))
    assert progress_at(drive, GOAL) is Progress.REACHED


def test_the_plan_goes_over_the_places() -> None:
    plan = Drive(Target(UUID(int=1), GOAL, (Pose(5.0, 5.0, 0.0),)), START, GOAL).plan(START)
    assert max(pose.y for pose in plan) == 5.0
    assert plan[-1] == GOAL
