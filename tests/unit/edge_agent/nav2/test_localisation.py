from __future__ import annotations

import math
from dataclasses import replace

import pytest
from structlog.testing import capture_logs

from nena_edge_agent.driver.port import Pose, PoseReport, PositionInitialized, VelocityReport
from nena_edge_agent.nav2.commands import Report
from nena_edge_agent.nav2.localisation import (
    InitialPosition,
    Localisation,
    LocaliserWatch,
    PoseWatch,
    PublishInitialPose,
    Repetition,
)
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.settings import LocalisationSettings, RosSettings

SECOND = 1_000_000_000
READING = PoseReading(1.0, 2.0, 0.5, "map", 100 * SECOND, 0.01, 0.01, 0.01)


def localisation() -> Localisation:
    return Localisation(RosSettings(), "hall")


def test_nothing_is_known_before_the_first_pose() -> None:
    unknown = localisation()
    unknown.on_velocity((1.0, 0.0), 0.0)
    assert not unknown.known
    assert unknown.report() is None


def test_the_pose_is_reported_with_the_newest_velocity() -> None:
    known = localisation()
    assert known.on_reading(READING) == Pose(1.0, 2.0, 0.5, "hall")
    assert known.report() == PoseReport(Pose(1.0, 2.0, 0.5, "hall"), localized=True, vx=None, omega=None)
    known.on_velocity((0.7, 0.1), 0.0)
    assert known.report() == PoseReport(Pose(1.0, 2.0, 0.5, "hall"), localized=True, vx=0.7, omega=0.1)


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


def test_a_pose_in_another_frame_is_dropped_and_logged_once() -> None:
    lost = localisation()
    with capture_logs() as lines:
        for _ in range(2):
            assert lost.on_reading(replace(READING, frame="odom")) is None
    assert len(lines) == 1
    assert lines[0]["frame"] == "odom"
    assert not lost.known


def test_a_large_uncertainty_is_reported() -> None:
    lost = localisation()
    lost.on_reading(replace(READING, x_variance=9.0))
    report = lost.report()
    assert report is not None
    assert not report.localized


def standing(x: float = 1.0, theta: float = math.pi, map_id: str = "hall") -> PoseReport:
    return PoseReport(Pose(x, 2.0, theta, map_id), localized=True, vx=0.0, omega=0.0)


STANDING_ROBOT = standing()


def test_a_standing_robot_repeats_itself_once_a_second() -> None:
    repetition = Repetition()
    news = [number for number in range(100) if not repetition.repeats(STANDING_ROBOT, number / 20)]
    assert news == [0, 20, 40, 60, 80]


@pytest.mark.parametrize(
    "report",
    [
        standing(x=1.002),
        standing(theta=math.pi - 0.002),
        standing(map_id="yard"),
        replace(STANDING_ROBOT, localized=False),
        replace(STANDING_ROBOT, vx=0.1),
        replace(STANDING_ROBOT, problem="the localisation is uncertain"),
    ],
)
def test_what_differs_is_no_repetition(report: PoseReport) -> None:
    repetition = Repetition()
    repetition.repeats(STANDING_ROBOT, 0.0)
    assert not repetition.repeats(report, 0.05)
    assert repetition.repeats(report, 0.1)
    assert not repetition.repeats(STANDING_ROBOT, 0.15)


def test_noise_adds_up_to_news() -> None:
    repetition = Repetition()
    creeping = [standing(x=1.0 + 0.0004 * step) for step in range(6)]
    assert [repetition.repeats(report, 0.0) for report in creeping] == [False, True, True, False, True, True]


def test_begin_and_end_of_moving_are_noticed() -> None:
    moving = localisation()
    velocities = [(0.0, 0.0), (0.001, 0.0), (0.5, 0.0), (0.6, 0.0), (0.0, 0.4), (0.0, 0.0)]
    assert [moving.on_velocity(each, 0.0) for each in velocities] == [True, False, True, False, False, True]


def test_a_position_from_feedback_counts_until_a_newer_pose_arrives() -> None:
    known = localisation()
    assert known.on_nearer(1.5, 2.0, 0.5, "map") is None
    known.on_reading(READING)
    nearer = Pose(1.5, 2.0, 0.5, "hall")
    assert known.on_nearer(1.5, 2.0, 0.5, "/map") == nearer
    later = replace(READING, x=1.2, stamp=READING.stamp + 1)
    assert known.on_reading(later, old=True) == nearer
    latest = replace(READING, x=1.3, stamp=READING.stamp + 2)
    assert known.on_reading(latest) == Pose(1.3, 2.0, 0.5, "hall")


def test_a_position_from_feedback_in_another_frame_is_ignored() -> None:
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


WANTED = Pose(2.0, 1.0, 3.1, "hall")
ELSEWHERE = Pose(9.0, 1.0, 3.1, "hall")
DONE = Report(PositionInitialized(succeeded=True, description=""))


@pytest.fixture
def initial_position() -> InitialPosition:
    return InitialPosition(LocalisationSettings(initial_wait=1.0, initial_attempts=3))


def test_is_sent_and_confirmed_by_a_pose_near_it(initial_position: InitialPosition) -> None:
    assert initial_position.start(WANTED, 0.0) == [PublishInitialPose(WANTED)]
    assert initial_position.on_pose(ELSEWHERE) == []
    assert initial_position.on_pose(Pose(2.3, 1.2, -3.1, "hall")) == [DONE]
    assert not initial_position.busy


def test_wrong_heading_confirms_nothing(initial_position: InitialPosition) -> None:
    initial_position.start(WANTED, 0.0)
    assert initial_position.on_pose(Pose(2.0, 1.0, 0.0, "hall")) == []
    assert initial_position.busy


def test_is_resent_and_then_abandoned(initial_position: InitialPosition) -> None:
    initial_position.start(WANTED, 0.0)
    assert initial_position.tick(0.9) == []
    assert initial_position.tick(1.0) == [PublishInitialPose(WANTED)]
    assert initial_position.tick(1.5) == []
    assert initial_position.tick(2.0) == [PublishInitialPose(WANTED)]
    (answer,) = initial_position.tick(3.0)
    assert isinstance(answer, Report)
    assert isinstance(answer.event, PositionInitialized)
    assert not answer.event.succeeded
    assert "after 3 initial positions" in answer.event.description
    assert initial_position.tick(9.0) == []


def test_a_failure_names_the_pose_of_the_localisation(initial_position: InitialPosition) -> None:
    initial_position.start(WANTED, 0.0)
    initial_position.on_pose(ELSEWHERE)
    for now in (1.0, 2.0):
        initial_position.tick(now)
    (answer,) = initial_position.tick(3.0)
    assert "stays at x 9.00 m" in str(answer)


def test_earlier_poses_do_not_confirm_the_position(initial_position: InitialPosition) -> None:
    assert initial_position.on_pose(WANTED) == []
    initial_position.start(WANTED, 0.0)
    assert initial_position.busy


def test_newer_position_replaces_the_older_one(initial_position: InitialPosition) -> None:
    initial_position.start(ELSEWHERE, 0.0)
    initial_position.start(WANTED, 0.5)
    assert initial_position.on_pose(ELSEWHERE) == []
    assert initial_position.on_pose(WANTED) == [DONE]


@pytest.fixture
def watch() -> PoseWatch:
    """A watch that has heard a pose at 100 s."""
    watch = PoseWatch(timeout=5.0, wait=2.0)
    watch.on_pose(100.0)
    return watch


def test_nothing_is_requested_before_the_first_pose() -> None:
    watch = PoseWatch(timeout=5.0, wait=2.0)
    assert not watch.wants_pose(driving=True, unsure=False, now=1000.0)
    assert not watch.lost


def test_a_pose_is_requested_until_it_arrives(watch: PoseWatch) -> None:
    assert not watch.wants_pose(driving=True, unsure=False, now=104.9)
    assert watch.wants_pose(driving=True, unsure=False, now=105.0)
    watch.on_answer(105.1)
    watch.on_pose(105.2)
    assert not watch.wants_pose(driving=True, unsure=False, now=110.0)
    assert not watch.lost


def test_a_robot_is_lost_if_a_promised_pose_does_not_arrive(watch: PoseWatch) -> None:
    watch.wants_pose(driving=True, unsure=False, now=105.0)
    watch.on_answer(105.1)
    asked, lost = [], []
    for now in (106.9, 107.1):
        asked.append(watch.wants_pose(driving=True, unsure=False, now=now))
        lost.append(watch.lost)
    watch.on_pose(108.0)
    assert (asked, lost) == ([False, True], [False, True])
    assert not watch.lost


def test_a_robot_that_drives_on_without_a_pose_is_lost(watch: PoseWatch) -> None:
    for step in range(105):
        watch.on_velocity(0.5, 0.0, 100.0 + step * 0.05)
    watch.wants_pose(driving=True, unsure=False, now=105.2)
    assert watch.lost


def test_a_robot_stopped_by_an_obstacle_is_not_lost_without_a_localisation_response(watch: PoseWatch) -> None:
    for second in range(105, 200):
        watch.on_velocity(0.0, 0.0, float(second))
        watch.wants_pose(driving=True, unsure=False, now=float(second))
    watch.on_velocity(math.nan, 0.0, 200.0)
    watch.wants_pose(driving=True, unsure=False, now=200.0)
    assert not watch.lost


def test_silence_at_standstill_is_ignored(watch: PoseWatch) -> None:
    assert not watch.wants_pose(driving=False, unsure=False, now=1000.0)
    assert not watch.wants_pose(driving=True, unsure=False, now=1004.9)
    assert watch.wants_pose(driving=True, unsure=False, now=1005.0)


def test_an_uncertain_or_lost_robot_keeps_requesting_poses_even_at_standstill(watch: PoseWatch) -> None:
    assert watch.wants_pose(driving=False, unsure=True, now=105.0)
    watch.on_answer(105.0)
    assert watch.wants_pose(driving=False, unsure=True, now=107.0)
    assert watch.lost
    assert watch.wants_pose(driving=False, unsure=False, now=109.0)


def test_a_localisation_that_dies_or_restarts_is_detected_once() -> None:
    watch = LocaliserWatch()
    one, other = frozenset({"a"}), frozenset({"b"})
    seen = [watch.find_problem(each, inactive=False) for each in (frozenset[str](), one, one)]
    assert seen == [None, None, None]
    looks = [watch.find_problem(frozenset(), inactive=False) for _ in range(4)]
    assert ["is not running" in str(each) for each in looks] == [False, True, False, False]
    assert watch.find_problem(other, inactive=False) is None, "its pose is new"
    assert "was restarted" in str(watch.find_problem(one | other, inactive=False)), (
        "DDS still shows the old one"
    )
    assert watch.find_problem(one, inactive=False) is None, "the old one is gone at last"


def test_a_localisation_that_dies_before_the_first_check_is_detected_by_its_pose() -> None:
    watch = LocaliserWatch()
    assert watch.find_problem(frozenset(), inactive=False) is None
    watch.on_pose()
    looks = [watch.find_problem(frozenset(), inactive=False) for _ in range(4)]
    assert ["is not running" in str(each) for each in looks] == [False, True, False, False]
    watch.on_pose()
    looks = [
        watch.find_problem(each, inactive=False)
        for each in (frozenset[str](), frozenset({"b"}), frozenset({"b"}))
    ]
    assert looks == [None, None, None], "it only comes back"


def test_a_localisation_that_is_deactivated_is_noticed() -> None:
    watch = LocaliserWatch()
    one = frozenset({"a"})
    assert watch.find_problem(one, inactive=False) is None
    assert "not active" in str(watch.find_problem(one, inactive=True))
    assert watch.find_problem(one, inactive=True) is None
