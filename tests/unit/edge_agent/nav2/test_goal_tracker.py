from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriverEvent,
    GoalReport,
    GoalTable,
    Halted,
    HaltFailed,
    NavigationReport,
    OwnGoals,
    Pose,
)
from nena_edge_agent.nav2.commands import CancelGoal, Command, PublishGoal, Report, RequestPose, StopMotion
from nena_edge_agent.nav2.goal_tracker import LATE_AT_MOST, REASON_WAIT, GoalDrive, GoalTracker
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix
from nena_edge_agent.nav2.settings import GoalSettings
from nena_shared.ros import GoalStatus

MARK = GoalIdPrefix("agent")
READY = NavigationReport(available=True, reason="")


def goal(generation: int, x: float = 5.0, *, xy: float = 0.5, theta: float | None = None) -> DriveGoal:
    return DriveGoal(generation, Pose(x, 0.0, 0.0, "hall"), deviation_xy=xy, deviation_theta=theta)


@dataclass
class Conversation:
    """A tracker, the time, and all of its reports."""

    tracker: GoalTracker = field(default_factory=lambda: GoalTracker(GoalSettings(), MARK))
    now: float = 0.0
    said: list[Command] = field(default_factory=list)

    def ready(self) -> Conversation:
        """Make Nav2 available without goals, with the robot at x = 0."""
        self.said += self.tracker.on_servers(frozenset({"gid"}), self.now)
        self.said += self.tracker.on_navigation(READY, self.now)
        self.at(0.0)
        self.later(2.05)
        return self

    def go_to(self, wanted: DriveGoal) -> None:
        self.said += self.tracker.go_to(wanted, self.now)

    def drives(self) -> None:
        """Send goal 1, which Nav2 executes as A."""
        self.go_to(goal(1))
        self.array("A:2")

    def halt(self) -> None:
        self.said += self.tracker.halt(self.now)

    def servers(self, found: frozenset[str]) -> None:
        self.said += self.tracker.on_servers(found, self.now)

    def silent_for(self, seconds: float) -> None:
        """Report that feedback has been missing for ``seconds``."""
        self.said += self.tracker.on_silence(seconds, self.now)

    def array(self, text: str) -> None:
        """Handle an array written as ``A:2 B:6``."""
        entries = [
            GoalEntry(name, GoalStatus.of(int(status)))
            for name, status in (x.split(":") for x in text.split())
        ]
        self.said += self.tracker.on_statuses(entries, self.now)

    def at(self, x: float, *, theta: float = 0.0) -> None:
        self.said += self.tracker.on_pose(Pose(x, 0.0, theta, "hall"), self.now)

    def later(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.now += 0.05
            self.said += self.tracker.tick(self.now)

    @property
    def events(self) -> list[DriverEvent]:
        """What was reported, goals for information left out."""
        reports = [command.event for command in self.said if isinstance(command, Report)]
        return [event for event in reports if not isinstance(event, GoalTable)]

    @property
    def goal_reports(self) -> list[tuple[str, bool, str]]:
        """Return the rows of the reported tables, each when it was new or had changed."""
        told: list[GoalReport] = []
        table: tuple[GoalReport, ...] = ()
        for event in (command.event for command in self.said if isinstance(command, Report)):
            if isinstance(event, GoalTable):
                told += [goal for goal in event.goals if goal not in table]
                table = event.goals
        return [(goal.goal_id, goal.external, goal.status) for goal in told]

    @property
    def given(self) -> list[int]:
        return [command.goal.generation for command in self.said if isinstance(command, PublishGoal)]

    @property
    def cancelled(self) -> list[str]:
        return [command.goal_id for command in self.said if isinstance(command, CancelGoal)]

    def rolls(self, seconds: float, speed: float = 0.5) -> None:
        """Report motion by the odometry, as time passes."""
        for _ in range(round(seconds / 0.1)):
            self.tracker.on_velocity(speed, 0.0, self.now)
            self.later(0.1)

    def stands(self, seconds: float = 0.5) -> None:
        self.rolls(seconds, speed=0.0)

    @property
    def motion_stopped(self) -> int:
        """How often the controller was to be stopped."""
        return sum(isinstance(command, StopMotion) for command in self.said)

    @property
    def poses_asked(self) -> int:
        return sum(isinstance(command, RequestPose) for command in self.said)

    def failure(self) -> DriveFailed:
        if not self.events:
            self.later(REASON_WAIT + 0.1)  # a goal by topic has no result with the reason
        (event,) = self.events
        assert isinstance(event, DriveFailed)
        return event


@pytest.fixture
def talk() -> Conversation:
    return Conversation().ready()


class TestGoldenTraces:
    """What the traces of the simulated robot (tests/integration) do not show."""

    def test_second_goal_in_one_array_with_the_end_of_the_first(self, talk: Conversation) -> None:
        talk.drives()
        talk.go_to(goal(2, 9.0))
        talk.at(9.0)
        talk.array("A:6 B:4")
        assert talk.events == [Arrived(2)]

    def test_of_three_goals_at_once_the_last_is_sent_after_the_first_is_confirmed(
        self, talk: Conversation
    ) -> None:
        for generation in (1, 2, 3):
            talk.go_to(goal(generation))
        assert talk.given == [1]
        talk.array("A:2")
        assert talk.given == [1, 3]
        talk.at(5.0)
        talk.array("A:6 B:4")
        assert talk.events == [Arrived(3)]

    def test_deactivated_while_driving(self, talk: Conversation) -> None:
        talk.drives()
        talk.said += talk.tracker.on_navigation(
            NavigationReport(available=False, reason="inactive"), talk.now
        )
        assert talk.events == []
        talk.array("A:6")
        assert talk.failure().failure is DriveFailure.ABORTED

    def test_server_restarted(self, talk: Conversation) -> None:
        talk.drives()
        talk.array("X:2")
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE
        assert talk.goal_reports[-1] == ("X", True, "EXECUTING")


class TestConfirmation:
    @pytest.mark.parametrize("status", [1, 2, 3, 4])
    def test_whatever_is_seen_first_is_ours(self, talk: Conversation, status: int) -> None:
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.array(f"A:{status}")
        talk.later(4.0)
        assert talk.given == [1]
        talk.array("A:4")
        assert talk.events == [Arrived(1)]

    def test_is_resent_at_most_three_times_and_then_fails(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(3.4)
        assert talk.given == [1]
        talk.later(0.2)
        assert talk.given == [1, 1]
        talk.later(10.2)
        assert talk.events == []
        talk.later(0.3)
        assert talk.given == [1] * 4
        assert talk.failure().failure is DriveFailure.NOT_TAKEN_UP
        assert "4 times" in talk.failure().description
        assert not talk.tracker.busy

    def test_both_ids_of_a_goal_resent_after_acceptance_are_ours(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(3.6)
        talk.array("A:2")
        talk.array("A:2 B:2")
        talk.array("A:6 B:2")
        assert talk.events == []
        talk.at(5.0)
        talk.array("A:6 B:4")
        assert talk.events == [Arrived(1)]
        assert all(not external for _, external, _ in talk.goal_reports)

    def test_a_goal_resent_after_acceptance_is_listed_twice_in_one_array(self, talk: Conversation) -> None:
        talk.array("old:5")
        talk.go_to(goal(1))
        talk.later(3.6)
        talk.array("old:5 A:6 B:2")
        assert talk.events == []
        talk.at(5.0)
        talk.array("old:5 A:6 B:4")
        assert talk.events == [Arrived(1)]

    def test_a_newer_goal_is_sent_instead_of_the_lost_one(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(1.0)
        talk.go_to(goal(2))
        assert talk.given == [1]
        talk.later(2.6)
        assert talk.given == [1, 2]
        talk.array("B:2")
        talk.at(5.0)
        talk.array("B:4")
        assert talk.events == [Arrived(2)]

    def test_a_late_id_of_a_finished_drive_is_cancelled(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(3.6)
        talk.at(5.0)
        talk.array("A:4")
        assert talk.events == [Arrived(1)]
        talk.array("A:4 B:2")
        assert talk.cancelled == ["B"]

    def test_a_late_id_of_a_finished_drive_does_not_end_the_next_one(self, talk: Conversation) -> None:
        """Goal 1 was sent twice; B, its second one, is listed after goal 2 was sent, and succeeds at once."""
        talk.go_to(goal(1))
        talk.later(3.6)
        talk.at(5.0)
        talk.array("A:4")
        talk.go_to(goal(2, 9.0))
        assert talk.given == [1, 1, 2]
        talk.array("A:4 B:4")
        talk.later(2.5)
        assert talk.events == [Arrived(1)]
        assert talk.given == [1, 1, 2, 2]
        for array in ("A:4 B:4 C:2", "A:4 B:4 C:6 D:2"):
            talk.array(array)
        talk.at(9.0)
        talk.array("A:4 B:4 C:6 D:4")
        assert talk.events == [Arrived(1), Arrived(2)]
        assert all(not external for _, external, _ in talk.goal_reports)

    def test_a_lost_goal_that_is_accepted_late_does_not_end_the_next_one(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(1.0)
        talk.go_to(goal(2, 9.0))
        talk.later(2.6)
        assert talk.given == [1, 2]
        talk.array("A:2")
        talk.at(5.0)
        talk.array("A:4")
        assert talk.given == [1, 2, 2]
        talk.array("A:4 B:2")
        talk.at(9.0)
        talk.array("A:4 B:4")
        assert talk.events == [Arrived(2)]

    def test_waits_for_navigation_without_a_timeout(self) -> None:
        talk = Conversation()
        nobody = NavigationReport(available=False, reason="no node publishes the status")
        talk.said += talk.tracker.on_navigation(nobody, 0.0)
        talk.go_to(goal(1))
        talk.later(60.0)
        assert (talk.given, talk.events) == ([], [])
        talk.ready()
        assert talk.given == [1]

    def test_goals_sent_before_navigation_was_unavailable_do_not_count(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.later(8.0)
        away = NavigationReport(available=False, reason="does not answer")
        talk.said += talk.tracker.on_navigation(away, talk.now)
        talk.later(60.0)
        assert (talk.given, talk.events) == ([1, 1, 1], [])
        talk.said += talk.tracker.on_navigation(READY, talk.now)
        talk.later(13.0)
        assert (len(talk.given), talk.events) == (7, [])
        talk.array("A:2")
        talk.at(5.0)
        talk.array("A:4")
        assert talk.events == [Arrived(1)]

    def test_is_sent_when_navigation_appears_and_has_settled(self) -> None:
        talk = Conversation()
        talk.go_to(goal(1))
        talk.later(1.0)
        talk.ready()
        assert talk.given == [1]

    def test_navigation_that_shows_its_goals_needs_no_time_to_settle(self) -> None:
        talk = Conversation()
        talk.said += talk.tracker.on_servers(frozenset({"gid"}), 0.0)
        talk.said += talk.tracker.on_navigation(READY, 0.0)
        talk.go_to(goal(1))
        assert talk.given == []
        talk.array("old:4")
        assert talk.given == [1]


class TestLocalisation:
    """AMCL dates its transform 1 s ahead: until then, Nav2 aborts goals with 102."""

    WAIT = GoalSettings().localisation_wait

    def test_a_goal_waits_for_the_transforms_of_a_localisation_that_was_lost(
        self, talk: Conversation
    ) -> None:
        talk.tracker.forget_pose()
        talk.later(20.0)
        talk.at(0.0)
        talk.go_to(goal(1))
        talk.later(self.WAIT - 0.1)
        assert talk.given == []
        assert talk.tracker.busy
        talk.at(0.0)
        talk.later(0.2)
        assert talk.given == [1]

    def test_a_pose_that_follows_another_delays_nothing(self, talk: Conversation) -> None:
        talk.at(0.3)
        talk.go_to(goal(1))
        assert talk.given == [1]

    def test_a_goal_of_an_earlier_run_is_continued_at_once(self) -> None:
        talk = Conversation()
        talk.tracker.reclaim(OwnGoals(("A",), goal(1).pose))
        talk.servers(frozenset({"gid"}))
        talk.said += talk.tracker.on_navigation(READY, talk.now)
        talk.array("A:2")
        talk.at(0.0)
        talk.go_to(goal(1))
        assert talk.tracker.driving

    def test_the_wait_does_not_count_as_a_refusal(self) -> None:
        settings = GoalSettings(confirmation_time=0.1, resends=0, settle_time=0.1)
        talk = Conversation(tracker=GoalTracker(settings, MARK)).ready()
        talk.tracker.forget_pose()
        talk.at(0.0)
        talk.go_to(goal(1))
        talk.later(self.WAIT + 0.05)
        talk.array("A:2")
        assert talk.tracker.driving


class TestForeignGoals:
    def test_stale_success_never_touches_a_new_goal(self) -> None:
        talk = Conversation()
        talk.array("old:6 older:4")
        talk.ready()
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.array("old:6 older:4")
        talk.later(1.0)
        assert talk.events == []
        assert talk.goal_reports == []

    def test_of_a_late_subscriptions_first_array_only_the_last_goal_is_ours(self, talk: Conversation) -> None:
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.array("old:4 running:2 ours:2")
        talk.array("old:4 running:6 ours:2")
        assert talk.events == []
        talk.array("old:4 running:6 ours:4")
        assert talk.events == [Arrived(1)]

    def test_an_external_goal_is_reported_and_not_adopted(self, talk: Conversation) -> None:
        talk.array("X:2")
        talk.at(5.0)
        talk.array("X:4")
        assert talk.goal_reports == [("X", True, "EXECUTING"), ("X", True, "SUCCEEDED")]
        assert talk.events == []
        assert talk.cancelled == []

    def test_an_external_goal_that_replaces_ours_is_named(self, talk: Conversation) -> None:
        talk.drives()
        talk.array("A:2 X:2")
        talk.array("A:6 X:2")
        assert talk.failure().failure is DriveFailure.TAKEN_OVER
        assert "X" in talk.failure().description
        assert talk.cancelled == []

    def test_nothing_is_sent_while_a_goal_is_being_cancelled(self, talk: Conversation) -> None:
        talk.array("X:3")
        talk.go_to(goal(1))
        assert talk.given == []
        talk.array("X:5")
        assert talk.given == [1]


class TestArrival:
    def test_requests_a_fresh_pose_and_waits_for_it(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(4.2)
        talk.array("A:4")
        assert talk.events == []
        assert talk.poses_asked == 1
        talk.later(0.5)
        talk.at(4.8)
        assert talk.events == [Arrived(1)]

    def test_fresh_pose_elsewhere_fails(self, talk: Conversation) -> None:
        talk.drives()
        talk.array("A:4")
        talk.later(0.1)
        talk.at(4.3)
        talk.later(1.8)
        assert talk.events == []
        talk.later(0.3)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE
        assert "4.30" in talk.failure().description

    def test_late_poses_of_a_moving_robot_are_waited_for(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(2.0)
        talk.array("A:4")
        for x in (3.0, 3.3, 3.6, 3.9):
            talk.later(1.5)
            talk.at(x)
        assert talk.events == []
        talk.later(1.5)
        talk.at(5.0)
        assert talk.events == [Arrived(1)]

    def test_poses_that_stay_away_while_the_robot_drives_are_waited_for(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(2.0)
        talk.array("A:4")
        talk.later(5.0)
        assert talk.events == []
        talk.at(3.0)
        talk.later(1.0)
        talk.at(5.0)
        assert talk.events == [Arrived(1)]

    def test_poses_that_stay_away_for_good_are_waited_for_so_long(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(2.0)
        talk.array("A:4")
        talk.later(LATE_AT_MOST - 0.1)
        assert talk.events == []
        talk.later(0.2)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE

    def test_a_robot_that_keeps_driving_has_not_arrived(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(2.0)
        talk.array("A:4")
        seconds = 0
        while not talk.events:
            talk.later(1.0)
            seconds += 1
            if not talk.events:
                talk.at(10.0 + seconds)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE
        assert seconds == LATE_AT_MOST + GoalSettings().pose_wait

    def test_the_heading_counts_if_it_is_required(self, talk: Conversation) -> None:
        talk.go_to(goal(1, theta=0.1))
        talk.array("A:2")
        talk.array("A:4")
        talk.at(5.0, theta=0.3)
        talk.later(2.1)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE

    def test_a_silent_localisation_gets_a_larger_tolerance(self, talk: Conversation) -> None:
        talk.drives()
        talk.later(1.0)
        talk.at(4.3)
        talk.later(0.1)
        talk.array("A:4")
        talk.later(2.1)
        assert talk.events == [Arrived(1)]

    def test_silent_localisation_far_away_fails(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.array("A:4")
        talk.later(2.1)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE

    def test_a_goal_that_ended_with_the_previous_one_is_resent_once(self, talk: Conversation) -> None:
        talk.drives()
        talk.at(4.8)
        talk.go_to(goal(2, 9.0))
        talk.array("A:6 B:4")
        assert talk.given == [1, 2, 2]
        talk.array("A:6 B:4 C:4")
        talk.later(2.1)
        assert talk.given == [1, 2, 2]
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE

    def test_a_goal_that_ended_with_a_nearby_previous_one_is_resent(self, talk: Conversation) -> None:
        """Nodes 0.4 m apart: from the place that the localisation last showed it may have been reached."""
        talk.go_to(goal(1, 5.0, xy=0.3))
        talk.array("A:2")
        talk.at(4.9)
        talk.go_to(goal(2, 5.4, xy=0.3))
        talk.array("A:6 B:2")
        talk.later(0.8)
        talk.array("A:6 B:4")
        assert talk.poses_asked == 1
        talk.at(4.95)
        talk.later(2.1)
        assert (talk.events, talk.given) == ([], [1, 2, 2])
        talk.array("A:6 B:4 C:2")
        talk.at(5.3)
        talk.array("A:6 B:4 C:4")
        assert talk.events == [Arrived(2)]

    def test_a_goal_that_ended_with_another_clients_goal_is_resent(self, talk: Conversation) -> None:
        talk.array("X:2")
        talk.go_to(goal(1))
        talk.array("X:6 A:4")
        assert talk.given == [1, 1]


class TestStatuses:
    @pytest.mark.parametrize("status", [0, 1, 2, 3, 7, -1])
    def test_no_end_without_a_terminal_status(self, talk: Conversation, status: int) -> None:
        talk.at(5.0)
        talk.drives()
        talk.array(f"A:{status}")
        talk.later(20.0)
        assert talk.events == []
        assert talk.given == [1]

    def test_an_end_stays_an_end(self, talk: Conversation) -> None:
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.array("A:4")
        talk.array("A:2")
        assert talk.events == [Arrived(1)]
        assert talk.cancelled == []

    @pytest.mark.parametrize(("status", "failed"), [(4, False), (6, True)])
    def test_a_cancelled_goal_may_still_end_otherwise(
        self, talk: Conversation, status: int, *, failed: bool
    ) -> None:
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.array("A:3")
        talk.array(f"A:{status}")
        talk.later(REASON_WAIT + 0.1)
        assert isinstance(talk.events[0], DriveFailed) is failed

    def test_late_end_of_an_older_goal_does_not_touch_the_newer(self, talk: Conversation) -> None:
        talk.at(5.0)
        talk.drives()
        talk.go_to(goal(2))
        talk.array("A:4")
        assert talk.events == []
        talk.array("A:4 B:2")
        talk.array("A:4 B:6")
        assert talk.failure().generation == 2


class TestHalt:
    def test_nothing_runs(self, talk: Conversation) -> None:
        talk.halt()
        assert talk.events == [Halted()]

    def test_waits_for_the_end_and_for_standstill_by_odometry(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        assert talk.cancelled == ["A"]
        talk.tracker.on_velocity(0.5, 0.0, talk.now)
        talk.array("A:3")
        talk.array("A:5")
        talk.later(0.2)
        assert talk.events == []
        for _ in range(5):
            talk.tracker.on_velocity(0.0, 0.005, talk.now)
            talk.later(0.1)
        assert talk.events == [Halted()]

    def test_a_robot_that_keeps_rolling_is_never_reported_at_standstill(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.array("A:5")
        talk.rolls(2.9)
        assert talk.events == []
        talk.rolls(20.0)
        (failed,) = talk.events
        assert isinstance(failed, HaltFailed)
        assert "0.50 m/s" in failed.description
        talk.stands()
        assert talk.events[1:] == [Halted()]

    def test_a_repeated_halt_is_answered_again(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.rolls(3.2)
        talk.halt()
        talk.rolls(3.2)
        assert [type(event) for event in talk.events] == [HaltFailed, HaltFailed]

    def test_a_robot_that_slows_down_is_waited_for(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.array("A:5")
        for step in range(60):
            talk.rolls(0.1, speed=1.5 - 0.025 * step)
        assert talk.events == []
        assert talk.motion_stopped == 0
        talk.stands()
        assert talk.events == [Halted()]

    def test_the_controller_is_stopped_where_the_navigator_does_not_do_it(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.rolls(0.4)
        assert talk.motion_stopped == 0
        talk.rolls(0.2)
        assert talk.motion_stopped == 1
        talk.said += talk.tracker.on_stop_answer(talk.now, answered=True)
        assert talk.events == []
        talk.stands()
        assert talk.events == [Halted()]
        assert talk.cancelled == ["A"]

    def test_a_standstill_does_not_count_while_a_navigator_that_hangs_may_drive_on(
        self, talk: Conversation
    ) -> None:
        talk.drives()
        talk.halt()
        talk.stands(5.0)
        assert talk.events == []
        talk.said += talk.tracker.on_stop_answer(talk.now, answered=True)
        assert talk.events == [Halted()]

    def test_goals_of_others_are_not_stopped_with_ours(self, talk: Conversation) -> None:
        talk.drives()
        talk.array("A:6 X:2")
        talk.halt()
        talk.rolls(5.0)
        assert talk.motion_stopped == 0
        assert talk.events[1:] == [Halted()]

    def test_unconfirmed_goal_is_awaited_and_then_cancelled(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.halt()
        talk.later(1.0)
        assert talk.cancelled == []
        assert talk.events == []
        talk.array("A:2")
        assert talk.cancelled == ["A"]
        talk.array("A:5")
        talk.later(3.1)
        assert talk.events == [Halted()]

    def test_a_lost_goal_is_not_resent(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.halt()
        talk.later(7.0)
        assert talk.given == [1]
        assert talk.events == [Halted()]

    def test_a_cancel_without_effect_is_repeated(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.said += talk.tracker.on_cancel_answer("A", None, talk.now)
        talk.later(2.1)
        assert talk.cancelled == ["A", "A"]
        assert talk.events == []

    def test_goal_unknown_to_the_server_is_over(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.said += talk.tracker.on_cancel_answer("A", 2, talk.now)
        talk.later(3.1)
        assert talk.events == [Halted()]

    @pytest.mark.parametrize("status", [4, 5, 6])
    def test_any_end_will_do(self, talk: Conversation, status: int) -> None:
        talk.drives()
        talk.halt()
        talk.array(f"A:{status}")
        talk.later(3.1)
        assert talk.events == [Halted()]

    def test_both_goals_are_cancelled_in_the_middle_of_a_replacement(self, talk: Conversation) -> None:
        talk.drives()
        talk.go_to(goal(2))
        talk.halt()
        talk.array("A:3 B:2")
        assert talk.cancelled == ["A", "B"]
        talk.array("A:5 B:6")
        talk.later(3.1)
        assert talk.events == [Halted()]

    def test_external_goal_is_left_alone(self, talk: Conversation) -> None:
        talk.array("X:2")
        talk.halt()
        assert talk.cancelled == []
        assert talk.events == [Halted()]


class TestNavigationGone:
    def test_publisher_gone(self, talk: Conversation) -> None:
        talk.drives()
        talk.servers(frozenset())
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE

    def test_an_unconfirmed_goal_is_resent_to_the_next_server(self, talk: Conversation) -> None:
        talk.go_to(goal(1))
        talk.servers(frozenset({"other"}))
        talk.later(2.1)
        assert (talk.events, talk.given) == ([], [1, 1])
        talk.at(5.0)
        talk.array("A:4")
        assert talk.events == [Arrived(1)]

    def test_a_second_publisher_is_a_navigation_that_crashed_and_restarted(self, talk: Conversation) -> None:
        talk.drives()
        talk.servers(frozenset({"gid", "other"}))
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE

    def test_a_drive_continues_when_the_crashed_publisher_disappears(self, talk: Conversation) -> None:
        both, new = frozenset({"gid", "other"}), frozenset({"other"})
        talk.drives()
        talk.servers(both)
        talk.later(3.0)
        talk.go_to(goal(2))
        talk.array("B:2")
        told = len(talk.events)
        for servers in (both, new, new):
            talk.servers(servers)
        assert talk.events[told:] == []
        talk.array("B:4")
        talk.at(5.0)
        assert talk.events[-1] == Arrived(2)

    def test_old_goal_that_still_runs_after_a_break_of_the_network_is_cancelled(
        self, talk: Conversation
    ) -> None:
        talk.drives()
        talk.servers(frozenset())
        talk.later(1.0)
        talk.servers(frozenset({"gid"}))
        talk.array("A:2")
        assert talk.cancelled == ["A"]

    def test_a_halt_waits_for_the_array_of_a_navigation_that_returned(self, talk: Conversation) -> None:
        talk.drives()
        for servers in ({"other"}, {"gid"}):
            talk.servers(frozenset(servers))
        talk.halt()
        assert talk.events[1:] == []
        talk.array("A:2")
        assert talk.cancelled == ["A"]
        talk.array("A:5")
        talk.later(3.1)
        assert talk.events[1:] == [Halted()]

    def test_a_halt_is_answered_when_navigation_disappears(self, talk: Conversation) -> None:
        talk.drives()
        talk.halt()
        talk.servers(frozenset())
        assert talk.motion_stopped == 1
        talk.later(3.1)
        (failed,) = talk.events
        assert isinstance(failed, HaltFailed)
        assert "there is no odometry" in failed.description
        talk.said += talk.tracker.on_stop_answer(talk.now, answered=True)
        assert talk.events[1:] == [Halted()]

    def test_the_controller_is_stopped_until_the_robot_is_at_standstill(self, talk: Conversation) -> None:
        talk.drives()
        talk.rolls(0.1)
        talk.servers(frozenset())
        assert talk.motion_stopped == 1
        talk.rolls(2.1)
        assert talk.motion_stopped == 2
        talk.stands()
        talk.later(5.0)
        assert talk.motion_stopped == 2
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE

    @pytest.mark.parametrize("reason", ["not active", "does not answer"])
    def test_the_controller_is_stopped_when_navigation_falls_silent(
        self, talk: Conversation, reason: str
    ) -> None:
        talk.drives()
        talk.rolls(0.1)
        talk.said += talk.tracker.on_navigation(NavigationReport(available=False, reason=reason), talk.now)
        assert talk.motion_stopped == 1
        talk.stands()
        talk.said += talk.tracker.on_navigation(READY, talk.now)
        talk.array("A:4")
        assert (talk.events, talk.given) == ([], [1, 1]), "Nav2 takes a stopped controller for success"

    def test_feedback_that_stays_away_fails_the_drive_and_stops_the_controller(
        self, talk: Conversation
    ) -> None:
        talk.drives()
        talk.silent_for(2.5)
        assert talk.motion_stopped == 1
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE

    def test_a_navigator_that_was_only_busy_gets_its_goal_again(self, talk: Conversation) -> None:
        talk.drives()
        talk.rolls(0.5)
        talk.silent_for(0.5)
        assert (talk.motion_stopped, talk.events) == (1, [])
        talk.stands()
        talk.silent_for(1.0)
        assert talk.events == [], "it stands"
        talk.array("A:4")
        assert (talk.events, talk.given) == ([], [1, 1])

    def test_a_robot_that_does_not_become_slower_fails_its_drive_sooner(self, talk: Conversation) -> None:
        talk.drives()
        talk.rolls(0.5)
        talk.silent_for(0.5)
        talk.rolls(0.5)
        talk.silent_for(1.0)
        assert talk.failure().failure is DriveFailure.NAVIGATION_GONE

    def test_feedback_that_returns_ends_the_stops_of_a_silence(self, talk: Conversation) -> None:
        talk.drives()
        talk.rolls(0.5)
        talk.silent_for(0.5)
        talk.tracker.on_feedback()
        talk.rolls(0.5)
        talk.later(10.0)
        assert (talk.motion_stopped, talk.events) == (1, [])

    def test_feedback_does_not_end_the_stops_after_a_crash(self, talk: Conversation) -> None:
        talk.drives()
        talk.rolls(0.5)
        talk.servers(frozenset())
        talk.silent_for(0.5)
        talk.tracker.on_feedback()
        stopped = talk.motion_stopped
        talk.rolls(0.5)
        talk.later(10.0)
        assert talk.motion_stopped > stopped

    def test_a_goal_not_accepted_yet_leaves_the_previous_one_active(self, talk: Conversation) -> None:
        talk.drives()
        talk.go_to(goal(2, 9.0))
        assert not talk.tracker.driving
        assert talk.tracker.active, "it drives to the goal before"

    def test_a_goal_of_an_earlier_run_whose_navigator_is_gone_is_stopped(self) -> None:
        talk = Conversation()
        talk.tracker.reclaim(OwnGoals(("A",), Pose(5.0, 0.0, 0.0, "hall")))
        for _ in range(6):
            talk.servers(frozenset())
            assert talk.motion_stopped == 0
            talk.rolls(1.0)
        talk.servers(frozenset())
        assert talk.motion_stopped == 1

    def test_a_goal_that_is_not_accepted_also_ends_the_previous_one(self, talk: Conversation) -> None:
        talk.drives()
        talk.go_to(goal(2))
        talk.later(14.2)
        assert talk.failure().failure is DriveFailure.NOT_TAKEN_UP
        assert talk.cancelled == ["A"]


class TestRestartOfTheAgent:
    @staticmethod
    def after_restart(x: float = 5.0, *ids: str) -> Conversation:
        """Return a tracker with the goals of an earlier run, the last one at ``x``."""
        talk = Conversation()
        talk.tracker.reclaim(OwnGoals(ids or ("A",), Pose(x, 0.0, 0.0, "hall")))
        return talk

    def test_a_goal_to_the_same_pose_continues(self) -> None:
        talk = self.after_restart()
        talk.array("old:4 A:2")
        talk.ready()
        talk.go_to(goal(1))
        talk.at(5.0)
        talk.array("old:4 A:4")
        assert (talk.given, talk.cancelled, talk.events) == ([], [], [Arrived(1)])
        assert ("A", False, "EXECUTING") in talk.goal_reports

    def test_a_continued_goal_that_succeeds_elsewhere_is_resent(self) -> None:
        """The earlier run may have stopped its controller, which the navigator mistakes for success."""
        talk = self.after_restart()
        talk.array("A:2")
        talk.ready()
        talk.go_to(goal(1))
        talk.at(2.0)
        talk.array("A:4")
        talk.later(1.0)
        assert (talk.given, talk.events) == ([1], [])
        talk.array("A:4 B:2")
        talk.at(3.0)
        talk.array("A:4 B:4")
        talk.later(10.0)
        assert talk.failure().failure is DriveFailure.OUTSIDE_TOLERANCE, "this one was driven without doubt"

    def test_an_earlier_goal_that_succeeded_meanwhile_counts_as_reached(self) -> None:
        talk = self.after_restart()
        talk.array("A:4")
        talk.ready()
        talk.at(5.0)
        talk.go_to(goal(1))
        talk.later(0.05)
        assert (talk.given, talk.events) == ([], [Arrived(1)])

    @pytest.mark.parametrize("array", ["A:4", "A:5", "A:6", "other:4"])
    def test_an_earlier_goal_that_ended_elsewhere_or_is_unknown_is_resent(self, array: str) -> None:
        talk = self.after_restart()
        talk.array(array)
        talk.ready()
        talk.go_to(goal(1))
        assert (talk.given, talk.events) == ([1], [])

    @pytest.mark.parametrize(
        ("behind", "array"), [("", "A:2"), ("old", "old:4 A:2"), ("old", "old:4 A:2 B:6")]
    )
    def test_a_goal_sent_but_not_listed_before_the_restart_continues(self, behind: str, array: str) -> None:
        talk = self.unlisted(behind)
        talk.array(array)
        talk.ready()
        talk.go_to(goal(1))
        talk.at(5.0)
        talk.array(array.replace("A:2", "A:4"))
        assert (talk.given, talk.cancelled, talk.events) == ([], [], [Arrived(1)])

    @pytest.mark.parametrize(("behind", "array"), [("old", "old:4"), ("older", "old:4"), ("old", "")])
    def test_a_goal_that_was_never_sent_is_sent(self, behind: str, array: str) -> None:
        talk = self.unlisted(behind)
        talk.array(array)
        talk.ready()
        talk.go_to(goal(1))
        assert (talk.given, talk.events) == ([1], [])

    def test_a_goal_not_listed_before_the_restart_is_cancelled_by_a_halt(self) -> None:
        talk = self.unlisted("old")
        talk.array("old:4 A:2")
        talk.halt()
        assert talk.cancelled == ["A"]

    def unlisted(self, behind: str) -> Conversation:
        """Return a tracker with a goal to x = 5 m that an earlier run was about to send."""
        talk = Conversation()
        place = Pose(5.0, 0.0, 0.0, "hall")
        talk.tracker.reclaim(OwnGoals((), place, given=place, behind=behind))
        return talk

    def test_an_earlier_goal_to_another_pose_is_replaced_without_a_cancel(self) -> None:
        talk = self.after_restart(9.0)
        talk.array("A:2")
        talk.ready()
        talk.go_to(goal(1))
        assert (talk.given, talk.cancelled) == ([1], [])

    def test_a_halt_cancels_all_of_them(self) -> None:
        talk = self.after_restart(5.0, "A", "B")
        talk.halt()
        talk.array("A:2 B:2")
        talk.ready()
        assert set(talk.cancelled) == {"A", "B"}
        talk.array("A:5 B:5")
        talk.later(5.0)
        assert talk.events == [Halted()]

    def test_a_halt_waits_for_a_navigator_that_is_found_late(self) -> None:
        talk = self.after_restart()
        talk.halt()
        talk.later(0.5)
        talk.servers(frozenset())
        talk.later(4.5)
        assert talk.events == []
        talk.servers(frozenset({"gid"}))
        talk.array("A:5")
        talk.stands()
        assert talk.events == [Halted()]

    @pytest.mark.parametrize("looked", [True, False])
    def test_a_halt_whose_navigator_is_never_found_fails(self, *, looked: bool) -> None:
        talk = self.after_restart()
        talk.halt()
        if looked:
            talk.servers(frozenset())
        talk.later(8.5)
        assert [type(each) for each in talk.events] == [HaltFailed]

    def test_an_earlier_goal_that_is_not_requested_is_cancelled_after_a_timeout(self) -> None:
        talk = self.after_restart()
        talk.array("A:2")
        talk.ready()
        assert talk.cancelled == []
        talk.later(10.0)
        assert talk.cancelled[:1] == ["A"]


def test_before_the_arrival_no_pose_is_late() -> None:
    drive = GoalDrive(goal(1))
    drive.on_pose(Pose(3.0, 0.0, 0.0, "hall"), Pose(2.0, 0.0, 0.0, "hall"), 1.0)
    drive.reached_at = 2.0
    assert not drive.pose_may_come(4.0, wait=2.0)


def test_a_robot_that_drives_on_after_an_aborted_goal_is_stopped_and_reported(talk: Conversation) -> None:
    talk.drives()
    talk.rolls(0.5)
    talk.array("A:6")
    talk.halt()
    talk.rolls(1.0)
    assert talk.motion_stopped, "the controller may be alive"
    talk.rolls(4.0)
    failure = talk.events[-1]
    assert isinstance(failure, HaltFailed)
    assert "0.50 m/s" in failure.description
    talk.stands()
    assert talk.events[-1] == Halted()


def test_a_robot_that_rolls_out_after_its_arrival_is_left_to_its_controller(talk: Conversation) -> None:
    talk.drives()
    talk.at(5.0)
    talk.array("A:4")
    talk.halt()
    for speed in (0.5, 0.4, 0.3, 0.2, 0.1):
        talk.rolls(0.3, speed)
        assert Halted() not in talk.events
    talk.stands()
    assert (talk.events[-1], talk.motion_stopped, talk.cancelled) == (Halted(), 0, [])


def test_without_odometry_a_robot_may_roll_out_after_its_arrival(talk: Conversation) -> None:
    talk.drives()
    talk.at(5.0)
    talk.array("A:4")
    talk.halt()
    talk.later(2.5)
    assert Halted() not in talk.events
    talk.later(1.0)
    assert talk.events[-1] == Halted()
    talk.halt()
    assert talk.events[-2:] == [Halted(), Halted()], "nothing has moved it since"


def test_odometry_that_ends_while_the_robot_moves_confirms_no_standstill(talk: Conversation) -> None:
    talk.rolls(0.5)
    talk.later(2.0)
    talk.halt()
    talk.later(2.5)
    assert talk.events == []
    talk.later(1.0)
    assert talk.events == [Halted()]


def test_a_pose_at_standstill_is_requested_after_each_arrival() -> None:
    talk = Conversation().ready()
    talk.drives()
    talk.at(5.0)
    talk.array("A:4")
    assert talk.events[-1] == Arrived(1)
    assert RequestPose() not in talk.said, "it still rolls"
    for _ in range(8):
        talk.tracker.on_velocity(0.0, 0.0, talk.now)
        talk.later(0.05)
    assert talk.said.count(RequestPose()) == 1
    assert not talk.tracker.busy


def test_no_pose_at_standstill_is_requested_after_the_next_goal() -> None:
    talk = Conversation().ready()
    talk.drives()
    talk.at(5.0)
    talk.array("A:4")
    talk.go_to(goal(2, 9.0))
    talk.later(5.0)
    assert RequestPose() not in talk.said
