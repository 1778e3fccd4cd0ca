"""Paths of our own at the controller, goals at the navigator: one of them drives."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriverEvent,
    GoalTable,
    Halted,
    NavigationReport,
    OwnGoals,
    Pose,
)
from nena_edge_agent.nav2.commands import (
    CancelGoal,
    Command,
    Report,
    RequestResult,
    SendGoal,
    Server,
    StopMotion,
)
from nena_edge_agent.nav2.goal_tracker import GoalTracker
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix, GoalResult
from nena_edge_agent.nav2.offers import nav2_offers
from nena_edge_agent.nav2.settings import GoalSettings, OfferSettings, RosSettings
from nena_edge_agent.nav2.trackers import Trackers
from nena_shared.ros import GoalStatus
from support.action_types import needs_action_types

MARK = GoalIdPrefix("agent")
THEIRS = "ff" * 16
AVAILABLE = NavigationReport(available=True, reason="")
NAVIGATORS, CONTROLLERS = frozenset({"bt"}), frozenset({"controller"})


def place(x: float) -> Pose:
    return Pose(x, 0.0, 0.0, "hall")


def goal(generation: int, x: float = 5.0, *, path: bool = False) -> DriveGoal:
    way = tuple(place(x * i / 5) for i in range(6)) if path else ()
    return DriveGoal(generation, place(x), deviation_xy=0.5, path=way)


C = TypeVar("C", SendGoal, CancelGoal)


class Talk:
    """The trackers of a robot whose Nav2 is there, the time, and all that they have said."""

    def __init__(self) -> None:
        self.trackers = Trackers(GoalSettings(), MARK)
        self.now = 10.0
        self.said: list[Command] = []
        self.trackers.controller_takes_paths = self.trackers.navigator.by_action = True
        self.said += self.trackers.on_servers(NAVIGATORS, CONTROLLERS, 0.0)
        self.said += self.trackers.on_navigation(AVAILABLE, 0.0)
        self.said += self.trackers.on_pose(place(0.0), 0.0)
        self.stands()

    def go_to(self, wanted: DriveGoal) -> None:
        self.said += self.trackers.go_to(wanted, self.now)

    def later(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + 0.05, end)
            self.said += self.trackers.tick(self.now)

    def stands(self, speed: float = 0.0) -> None:
        """Let the odometry tell of a robot that has been at this speed for a while."""
        for _ in range(8):
            self.now += 0.05
            self.trackers.on_velocity(speed, 0.0, self.now)

    def accept_path(self) -> None:
        self.answer_path(accepted=True)

    def answer_path(self, *, accepted: bool) -> None:
        goal_id = self.paths[-1].goal_id
        self.tell(lambda tracker: tracker.on_goal_answer(goal_id, self.now, accepted=accepted))

    def tell(self, change: Callable[[GoalTracker], list[Command]], at: Server = Server.CONTROLLER) -> None:
        self.said += self.trackers.update(at, change, self.now)

    def accept_goal(self) -> None:
        goal_id = self.sent[-1].goal_id
        self.said += self.trackers.navigator.on_goal_answer(goal_id, self.now, accepted=True)

    def path_ends(self, status: GoalStatus, code: int = 0) -> None:
        result = GoalResult(self.paths[-1].goal_id, status, (code, ""))
        self.tell(lambda tracker: tracker.on_result(result, self.now))

    def array(self, status: GoalStatus) -> None:
        """Let the navigator list its goal."""
        entries = [GoalEntry(self.sent[-1].goal_id, status)]
        self.tell(lambda tracker: tracker.on_statuses(entries, self.now), Server.NAVIGATOR)

    def path_array(self, status: GoalStatus) -> None:
        self.path_statuses(self.paths[-1].goal_id, status)

    def path_statuses(self, goal_id: str, status: GoalStatus) -> None:
        """Let the controller list one path."""
        self.tell(lambda tracker: tracker.on_statuses([GoalEntry(goal_id, status)], self.now))

    @property
    def paths(self) -> list[SendGoal]:
        return [each for each in self._of_kind(SendGoal) if each.server is Server.CONTROLLER]

    @property
    def path_cancels(self) -> list[str]:
        cancels = self._of_kind(CancelGoal)
        return [each.goal_id for each in cancels if each.server is Server.CONTROLLER]

    @property
    def sent(self) -> list[SendGoal]:
        return [each for each in self._of_kind(SendGoal) if each.server is Server.NAVIGATOR]

    def _of_kind(self, kind: type[C]) -> list[C]:
        return [each for each in self.said if isinstance(each, kind)]

    @property
    def events(self) -> list[DriverEvent]:
        return [each.event for each in self.said if isinstance(each, Report)]

    @property
    def failures(self) -> list[DriveFailed]:
        return [each for each in self.events if isinstance(each, DriveFailed)]


@pytest.fixture
def talk() -> Talk:
    return Talk()


@pytest.fixture
def driving(talk: Talk) -> Talk:
    talk.go_to(goal(1, path=True))
    talk.accept_path()
    talk.stands(0.5)
    return talk


def test_a_path_is_sent_to_the_controller_and_its_end_is_reached(driving: Talk) -> None:
    (sent,) = driving.paths
    assert (len(sent.goal.path), MARK.matches(sent.goal_id), driving.sent) == (6, True, [])
    assert driving.trackers.current.goal_id == sent.goal_id
    assert RequestResult(sent.goal_id, Server.CONTROLLER) in driving.said
    driving.said += driving.trackers.on_pose(place(5.0), driving.now)
    driving.path_ends(GoalStatus.SUCCEEDED)
    assert Arrived(1) in driving.events
    assert not driving.trackers.may_drive


def test_success_far_from_the_node_is_no_arrival(driving: Talk) -> None:
    driving.said += driving.trackers.on_pose(place(2.0), driving.now)
    driving.path_ends(GoalStatus.SUCCEEDED)
    driving.later(20.0)
    assert [each.failure for each in driving.failures] == [DriveFailure.OUTSIDE_TOLERANCE]


def test_a_new_path_replaces_the_old_one_without_a_cancel(driving: Talk) -> None:
    driving.go_to(goal(2, 9.0, path=True))
    assert len(driving.paths) == 2
    assert driving.path_cancels == []


def test_a_goal_waits_for_the_end_of_a_path_and_a_path_for_that_of_a_goal(driving: Talk) -> None:
    driving.go_to(goal(2, 9.0))
    assert driving.path_cancels == [driving.paths[0].goal_id]
    assert (driving.sent, driving.trackers.busy) == ([], True)
    driving.path_array(GoalStatus.CANCELED)
    driving.later(0.1)
    assert [each.goal.generation for each in driving.sent] == [2]
    assert driving.failures == []
    driving.accept_goal()
    driving.go_to(goal(3, 12.0, path=True))
    assert len(driving.paths) == 1
    driving.array(GoalStatus.CANCELED)
    assert [each.goal.generation for each in driving.paths] == [1, 3]


def test_a_halt_cancels_the_path_and_is_answered_at_standstill(driving: Talk) -> None:
    driving.said += driving.trackers.halt(driving.now)
    assert driving.path_cancels == [driving.paths[0].goal_id]
    driving.path_array(GoalStatus.CANCELED)
    driving.later(0.2)
    assert Halted() not in driving.events
    driving.stands()
    driving.later(0.1)
    assert driving.events.count(Halted()) == 1


def test_a_goal_that_waits_is_forgotten_by_a_halt(driving: Talk) -> None:
    driving.go_to(goal(2, 9.0))
    driving.said += driving.trackers.halt(driving.now)
    driving.path_array(GoalStatus.CANCELED)
    driving.stands()
    driving.later(1.0)
    assert (driving.sent, Halted() in driving.events) == ([], True)


def gone(talk: Talk) -> list[Command]:
    return talk.trackers.on_servers(NAVIGATORS, frozenset(), talk.now)


def silent(talk: Talk) -> list[Command]:
    return talk.trackers.on_silence(2.0, talk.now)


@pytest.mark.parametrize("ended", [gone, silent])
def test_a_controller_that_dies_or_hangs_fails_the_drive_and_is_stopped(
    driving: Talk, ended: Callable[[Talk], list[Command]]
) -> None:
    driving.said += ended(driving)
    assert [each.failure for each in driving.failures] == [DriveFailure.NAVIGATION_GONE]
    driving.later(0.1)
    assert any(isinstance(each, StopMotion) for each in driving.said)


def test_silence_names_the_controller(driving: Talk) -> None:
    driving.said += silent(driving)
    assert "controller_server has sent no feedback" in driving.failures[0].description


def test_a_navigator_that_dies_does_not_end_a_path(driving: Talk) -> None:
    driving.said += driving.trackers.on_servers(frozenset(), CONTROLLERS, driving.now)
    lost = NavigationReport(available=False, reason="is Nav2 running there?")
    driving.said += driving.trackers.on_navigation(lost, driving.now)
    driving.later(1.0)
    assert (driving.failures, driving.path_cancels) == ([], [])
    assert not any(isinstance(each, StopMotion) for each in driving.said)


def test_a_path_waits_for_a_controller_that_accepts_it(talk: Talk) -> None:
    talk.trackers.controller_takes_paths = False
    talk.said += talk.trackers.on_navigation(AVAILABLE, talk.now)
    talk.go_to(goal(1, path=True))
    talk.later(30.0)
    assert (talk.paths, talk.failures) == ([], [])
    talk.trackers.controller_takes_paths = True
    talk.said += talk.trackers.on_navigation(AVAILABLE, talk.now)
    assert len(talk.paths) == 1


def test_an_abort_has_the_reason_of_the_controller(driving: Talk) -> None:
    driving.path_ends(GoalStatus.ABORTED, 105)
    (failed,) = driving.failures
    assert (failed.failure, failed.code) == (DriveFailure.ABORTED, 105)
    assert "no progress" in failed.description


def test_a_path_that_is_refused_fails_in_the_end(talk: Talk) -> None:
    talk.go_to(goal(1, path=True))
    for _ in range(40):
        talk.answer_path(accepted=False)
        talk.later(1.0)
    assert [each.failure for each in talk.failures] == [DriveFailure.NOT_TAKEN_UP]
    assert "is controller_server active?" in talk.failures[0].description


def test_a_path_replaced_by_another_clients_goal_is_taken_over(driving: Talk) -> None:
    theirs = [GoalEntry(THEIRS, GoalStatus.EXECUTING)]
    driving.tell(lambda tracker: tracker.on_statuses(theirs, driving.now), Server.NAVIGATOR)
    driving.path_ends(GoalStatus.ABORTED)
    driving.later(2.0)
    assert [each.failure for each in driving.failures] == [DriveFailure.TAKEN_OVER]
    tables = [each for each in driving.events if isinstance(each, GoalTable)]
    assert [each.goal_id for each in tables[-1].external] == [THEIRS]


def test_a_path_of_an_earlier_run_is_cancelled_before_the_next_one(talk: Talk) -> None:
    left = MARK.new()
    talk.path_statuses(left, GoalStatus.EXECUTING)
    talk.later(0.1)
    assert talk.path_cancels == [left]
    talk.go_to(goal(1, path=True))
    assert talk.paths == []
    talk.path_statuses(left, GoalStatus.CANCELED)
    assert len(talk.paths) == 1


def after_restart(*, paths: bool = True) -> Talk:
    """Return a robot without odometry whose agent has just restarted; Nav2 has listed no goals yet."""
    talk = Talk()
    talk.trackers = Trackers(GoalSettings(), MARK)
    talk.trackers.reclaim(OwnGoals((), place(5.0)), paths=paths)
    talk.trackers.controller_takes_paths = talk.trackers.navigator.by_action = True
    talk.said = talk.trackers.on_servers(NAVIGATORS, CONTROLLERS, talk.now)
    talk.said += talk.trackers.on_navigation(AVAILABLE, talk.now)
    return talk


def test_a_halt_after_a_restart_waits_for_the_end_of_a_path() -> None:
    talk, left = after_restart(), MARK.new()
    talk.said += talk.trackers.halt(talk.now)
    talk.later(1.0)
    assert Halted() not in talk.events
    talk.path_statuses(left, GoalStatus.EXECUTING)
    talk.later(0.1)
    assert talk.path_cancels == [left]
    assert Halted() not in talk.events
    talk.path_statuses(left, GoalStatus.CANCELED)
    talk.later(5.0)
    assert talk.events.count(Halted()) == 1


def test_a_halt_while_a_path_of_an_earlier_run_is_cancelled_waits_for_its_end() -> None:
    talk, left = after_restart(), MARK.new()
    talk.path_statuses(left, GoalStatus.EXECUTING)
    talk.said += talk.trackers.halt(talk.now)
    talk.later(1.0)
    assert Halted() not in talk.events
    talk.path_statuses(left, GoalStatus.CANCELED)
    talk.later(5.0)
    assert talk.events.count(Halted()) == 1


def test_a_halt_after_a_restart_is_answered_if_the_controller_had_no_path() -> None:
    talk = after_restart()
    talk.said += talk.trackers.halt(talk.now)
    talk.later(1.0)
    assert any(isinstance(each, StopMotion) for each in talk.said)
    talk.said += talk.trackers.on_stop_answer(talk.now, answered=True)
    talk.later(6.0)
    assert talk.events.count(Halted()) == 1
    talk.said += talk.trackers.halt(talk.now)
    assert talk.events.count(Halted()) == 2


def test_a_halt_after_a_restart_is_answered_at_once_without_paths() -> None:
    talk = after_restart(paths=False)
    talk.said += talk.trackers.halt(talk.now)
    assert talk.events.count(Halted()) == 1


@needs_action_types
@pytest.mark.parametrize("wanted", [True, False])
def test_paths_are_offered_only_where_the_settings_want_them(*, wanted: bool) -> None:
    settings = RosSettings(nav2=OfferSettings(follow_path=wanted))
    assert nav2_offers(settings).follows_paths is wanted
    assert RosSettings().nav2.follow_path is False
