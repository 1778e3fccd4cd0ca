from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriveProgress,
    DriverEvent,
    GoalTable,
    Halted,
    NavigationReport,
    OwnGoals,
    Pose,
)
from nena_edge_agent.nav2 import action_client
from nena_edge_agent.nav2.commands import (
    CancelGoal,
    Command,
    PublishGoal,
    Report,
    RequestResult,
    SendGoal,
)
from nena_edge_agent.nav2.error_codes import meaning_of
from nena_edge_agent.nav2.feedback import FeedbackFilter, PassedPoses, SilenceWatch
from nena_edge_agent.nav2.goal_tracker import REASON_WAIT, GoalTracker
from nena_edge_agent.nav2.goals import YIELD_TIME, FeedbackReading, GoalEntry, GoalIdPrefix, GoalResult
from nena_edge_agent.nav2.settings import GoalSettings, RosSettings
from nena_shared.ros import GoalStatus

MARK = GoalIdPrefix("agent")
THEIRS = "ff" * 16


def goal(generation: int, x: float = 5.0) -> DriveGoal:
    return DriveGoal(generation, Pose(x, 0.0, 0.0, "hall"), deviation_xy=0.5)


@dataclass
class Conversation:
    """A tracker that drives by the action, the time, and all of its reports."""

    tracker: GoalTracker = field(default_factory=lambda: GoalTracker(GoalSettings(), MARK))
    now: float = 10.0
    said: list[Command] = field(default_factory=list)

    def ready(self) -> Conversation:
        self.said += self.tracker.on_servers(frozenset({"gid"}), 0.0)
        self.said += self.tracker.on_navigation(NavigationReport(available=True, reason=""), 0.0)
        self.said += self.tracker.on_pose(Pose(0.0, 0.0, 0.0, "hall"), 0.0)
        self.tracker.by_action = True
        self.said += self.tracker.tick(self.now)
        return self

    def go_to(self, wanted: DriveGoal) -> None:
        self.said += self.tracker.go_to(wanted, self.now)

    def driving(self, generation: int = 1) -> str:
        """Send a goal and make it accepted; return its ID."""
        self.go_to(goal(generation))
        self.answer()
        return self.sent[-1]

    def answer(self, goal_id: str = "", *, accepted: bool | None = True) -> None:
        self.said += self.tracker.on_goal_answer(goal_id or self.sent[-1], self.now, accepted=accepted)

    def result(self, goal_id: str, status: GoalStatus, code: int = 0) -> None:
        self.said += self.tracker.on_result(GoalResult(goal_id, status, (code, "")), self.now)

    def array(self, **statuses: int) -> None:
        entries = [GoalEntry(goal_id.removeprefix("g"), GoalStatus.of(s)) for goal_id, s in statuses.items()]
        self.said += self.tracker.on_statuses(entries, self.now)

    def arrive(self, x: float = 5.0) -> None:
        self.said += self.tracker.on_pose(Pose(x, 0.0, 0.0, "hall"), self.now)

    def later(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + 0.05, end)
            self.said += self.tracker.tick(self.now)

    @property
    def sent(self) -> list[str]:
        return [command.goal_id for command in self.said if isinstance(command, SendGoal)]

    @property
    def ends(self) -> list[DriverEvent]:
        told = [command.event for command in self.said if isinstance(command, Report)]
        return [event for event in told if isinstance(event, Arrived | DriveFailed | Halted)]

    @property
    def tables(self) -> list[GoalTable]:
        told = [command.event for command in self.said if isinstance(command, Report)]
        return [event for event in told if isinstance(event, GoalTable)]


@pytest.fixture
def talk() -> Conversation:
    return Conversation().ready()


def test_a_goal_has_our_id_and_its_result_is_requested_once_accepted(talk: Conversation) -> None:
    goal_id = talk.driving()
    assert MARK.matches(goal_id)
    assert talk.tracker.goal_id == goal_id
    assert talk.said.count(RequestResult(goal_id)) == 1
    assert talk.tables[-1].own == (goal_id,)
    assert not any(isinstance(command, PublishGoal) for command in talk.said)


def test_success_by_array_and_then_by_result_is_one_arrival(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.arrive()
    talk.array(**{f"g{goal_id}": 4})
    assert talk.ends == [Arrived(1)]
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.ends == [Arrived(1)]


def test_success_by_result_and_then_by_array_is_one_arrival(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.arrive()
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.ends == [Arrived(1)]
    talk.array(**{f"g{goal_id}": 4})
    assert talk.ends == [Arrived(1)]


def test_the_reason_may_arrive_after_the_array(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6})
    assert talk.ends == []
    assert talk.tracker.busy
    talk.later(REASON_WAIT / 2)
    talk.result(goal_id, GoalStatus.ABORTED, 208)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.ABORTED
    assert "no path leads to the goal (error code 208)" in failed.description


def test_waiting_for_a_missing_reason_has_a_timeout(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6})
    talk.later(REASON_WAIT + 0.1)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert "Nav2's log" in failed.description
    assert not talk.tracker.busy


@pytest.mark.parametrize("code", [0, 102, 107, 202, 207, 302, 307])
def test_an_abort_whose_cause_passes_is_transient(talk: Conversation, code: int) -> None:
    goal_id = talk.driving()
    talk.result(goal_id, GoalStatus.ABORTED, code)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.failure, failed.transient) == (DriveFailure.ABORTED, True)


@pytest.mark.parametrize("code", [100, 101, 103, 105, 106, 203, 204, 206, 208, 308, 309, 9000])
def test_an_abort_for_a_reason_that_stays_fails_at_once(talk: Conversation, code: int) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6})
    talk.result(goal_id, GoalStatus.ABORTED, code)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert not failed.transient


def gone(talk: Conversation) -> None:
    report = NavigationReport(available=False, reason="Nav2 is not active")
    talk.said += talk.tracker.on_navigation(report, talk.now)


@pytest.mark.parametrize("by_action", [True, False])
@pytest.mark.parametrize("first", ["abort", "unavailable"])
def test_an_abort_without_a_result_is_transient_if_nav2_is_not_available(
    talk: Conversation, first: str, *, by_action: bool
) -> None:
    talk.tracker.by_action = by_action
    talk.go_to(goal(1))
    if by_action:
        talk.answer()
    goal_id = talk.sent[-1] if by_action else THEIRS
    talk.array(**{f"g{goal_id}": 2})
    if first == "unavailable":
        gone(talk)
    talk.array(**{f"g{goal_id}": 6})
    if first == "abort":
        talk.later(REASON_WAIT - 0.1)
        assert talk.ends == []
        gone(talk)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.failure, failed.transient) == (DriveFailure.ABORTED, True)


def test_an_abort_for_another_clients_goal_is_told_at_once(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6, f"g{THEIRS}": 2})
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.failure, failed.transient) == (DriveFailure.TAKEN_OVER, False)


def test_a_result_without_a_code_as_in_humble_is_not_transient(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.said += talk.tracker.on_result(GoalResult(goal_id, GoalStatus.ABORTED, None), talk.now)
    talk.later(REASON_WAIT + 0.1)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert not failed.transient


def test_a_goal_of_ours_that_replaces_another_one_is_no_failure(talk: Conversation) -> None:
    first = talk.driving(1)
    second = talk.driving(2)
    talk.array(**{f"g{first}": 6, f"g{second}": 2})
    talk.result(first, GoalStatus.ABORTED)
    talk.later(2 * REASON_WAIT)
    assert talk.ends == []
    assert talk.tracker.goal_id == second


def test_an_aborted_goal_that_is_replaced_while_its_reason_is_waited_for_is_no_failure(
    talk: Conversation,
) -> None:
    first = talk.driving(1)
    talk.array(**{f"g{first}": 6})
    talk.driving(2)
    talk.later(2 * REASON_WAIT)
    assert talk.ends == []


def test_a_rejected_goal_is_resent_with_another_id_and_then_fails(talk: Conversation) -> None:
    settings = GoalSettings()
    talk.go_to(goal(1))
    for _ in range(settings.resends):
        talk.answer(accepted=False)
        talk.later(settings.confirmation_time + 0.1)
    talk.answer(accepted=False)
    talk.later(settings.confirmation_time + 0.1)
    assert len(set(talk.sent)) == settings.resends + 1
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.NOT_TAKEN_UP
    assert "rejected the goal" in failed.description


def test_a_lost_response_is_replaced_by_the_array(talk: Conversation) -> None:
    talk.go_to(goal(1))
    (goal_id,) = talk.sent
    talk.answer(accepted=None)
    talk.array(**{f"g{goal_id}": 2})
    assert talk.tracker.goal_id == goal_id
    assert RequestResult(goal_id) in talk.said or talk.tracker.tick(talk.now) == [RequestResult(goal_id)]
    assert talk.sent == [goal_id]


def test_the_answer_to_an_older_goal_does_not_bind_the_newer_one(talk: Conversation) -> None:
    talk.go_to(goal(1))
    (first,) = talk.sent
    talk.go_to(goal(2, 9.0))
    talk.answer(first)
    assert talk.tracker.goal_id is None
    assert len(talk.sent) == 2
    talk.answer()
    assert talk.tracker.goal_id == talk.sent[-1]


def test_a_halt_cancels_by_the_id_that_was_accepted_though_no_array_came(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.said += talk.tracker.halt(talk.now)
    assert CancelGoal(goal_id) in talk.said
    talk.result(goal_id, GoalStatus.CANCELED)
    talk.later(5.0)
    assert talk.ends == [Halted()]


def test_another_clients_goal_takes_over(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6, f"g{THEIRS}": 2})
    talk.result(goal_id, GoalStatus.ABORTED)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.TAKEN_OVER


def test_a_goal_of_an_earlier_run_continues_and_its_result_is_requested() -> None:
    goal_id = MARK.new()
    talk = Conversation()
    talk.tracker.reclaim(OwnGoals((goal_id,), goal(1).pose))
    talk.ready()
    talk.array(**{f"g{goal_id}": 2})
    talk.go_to(goal(7))
    talk.later(0.1)
    assert talk.tracker.goal_id == goal_id
    assert RequestResult(goal_id) in talk.said
    assert talk.sent == []
    talk.result(goal_id, GoalStatus.ABORTED, 105)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.generation, failed.failure) == (7, DriveFailure.ABORTED)


def test_a_goal_sent_just_before_a_restart_is_adopted_by_its_prefix() -> None:
    goal_id = MARK.new()
    talk = Conversation()
    talk.tracker.reclaim(OwnGoals((), goal(1).pose, goal(1).pose, ""))
    talk.ready()
    talk.array(**{f"g{goal_id}": 2})
    talk.go_to(goal(7))
    assert talk.tracker.goal_id == goal_id
    assert talk.sent == []


def test_an_unexpected_running_goal_of_ours_is_cancelled() -> None:
    goal_id = MARK.new()
    talk = Conversation().ready()
    talk.array(**{f"g{goal_id}": 2})
    assert CancelGoal(goal_id) in talk.said


def test_without_the_action_goals_are_sent_by_topic(talk: Conversation) -> None:
    talk.tracker.by_action = False
    talk.go_to(goal(1))
    assert any(isinstance(command, PublishGoal) for command in talk.said)
    talk.array(**{f"g{THEIRS}": 2})
    assert talk.tracker.goal_id == THEIRS
    assert RequestResult(THEIRS) in talk.said
    talk.array(**{f"g{THEIRS}": 6})
    talk.later(REASON_WAIT + 0.1)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.failure, failed.transient) == (DriveFailure.ABORTED, False)


def test_a_goal_sent_by_topic_fails_with_the_code_of_its_result(talk: Conversation) -> None:
    talk.tracker.by_action = False
    talk.go_to(goal(1))
    talk.array(**{f"g{THEIRS}": 2})
    talk.array(**{f"g{THEIRS}": 6})
    talk.result(THEIRS, GoalStatus.ABORTED, 208)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.code, failed.transient) == (208, False)


def way(generation: int, *xs: float) -> DriveGoal:
    first, *rest = (Pose(x, 0.0, 0.0, "hall") for x in xs)
    return DriveGoal(generation, first, deviation_xy=0.3, ahead=tuple(rest))


def on_its_way(talk: Conversation, *xs: float) -> str:
    talk.go_to(way(1, *xs))
    talk.answer()
    return talk.sent[-1]


def test_the_next_pose_of_a_route_needs_no_goal_of_its_own(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0, 15.0)
    talk.go_to(way(2, 10.0, 15.0))
    talk.go_to(way(3, 15.0))
    talk.arrive(15.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.sent == [goal_id]
    assert talk.ends == [Arrived(3)]


def test_an_extended_route_is_sent(talk: Conversation) -> None:
    first = on_its_way(talk, 5.0, 10.0)
    talk.go_to(way(2, 10.0, 15.0))
    talk.answer()
    talk.array(**{f"g{first}": 6, f"g{talk.sent[-1]}": 2})
    assert len(talk.sent) == 2
    assert talk.ends == []


def test_a_skipped_pose_is_driven_to_separately(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.tracker.on_places(goal_id, 1)
    talk.said += talk.tracker.on_pose(Pose(5.0, 0.6, 0.0, "hall"), talk.now)
    talk.said += talk.tracker.on_pose(Pose(6.0, 0.6, 0.0, "hall"), talk.now)
    last = [command for command in talk.said if isinstance(command, SendGoal)][-1]
    assert last.goal == way(1, 5.0)
    assert len(talk.sent) == 2


def test_the_end_of_a_route_waits_for_the_poses_on_it(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.arrive(10.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.ends == []
    talk.go_to(way(2, 10.0))
    assert talk.ends == [Arrived(2)]
    assert talk.sent == [goal_id]


def test_a_pose_not_seen_passed_is_driven_to_after_the_end(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.arrive(10.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    talk.later(GoalSettings().pose_wait + 0.1)
    assert talk.ends == []
    assert len(talk.sent) == 2


def test_goals_of_the_other_action_are_other_clients(talk: Conversation) -> None:
    talk.said += talk.tracker.on_other_statuses([GoalEntry(THEIRS, GoalStatus.EXECUTING)], talk.now)
    assert [goal.goal_id for goal in talk.tables[-1].external] == [THEIRS]
    talk.said += talk.tracker.on_other_statuses([GoalEntry(THEIRS, GoalStatus.SUCCEEDED)], talk.now)
    assert talk.tables[-1].external == ()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (105, "makes no progress"),
        (208, "no path leads to the goal"),
        (308, "no path leads to the goal"),
        (309, "has no poses"),
        (503, "smoother"),
        (701, "recovery"),
        (9001, "navigator"),
        (42, "unknown Nav2 error code"),
    ],
)
def test_names_the_code_and_its_meaning(code: int, text: str) -> None:
    reason = str(meaning_of(code))
    assert text in reason
    assert f"error code {code}" in reason


def test_adds_the_message_of_nav2() -> None:
    assert "Collision ahead" in str(meaning_of(106, "Collision ahead"))


def test_no_code_is_no_reason() -> None:
    assert meaning_of(0) is None


def place(x: float, y: float = 0.0, theta: float = 0.0) -> Pose:
    return Pose(x, y, theta, "hall")


def goal_of_passed_poses(*xs: float) -> DriveGoal:
    first, *rest = (place(x) for x in xs)
    return DriveGoal(1, first, deviation_xy=0.3, ahead=tuple(rest))


def test_covers_the_remaining_route_regardless_of_headings() -> None:
    way = PassedPoses()
    way.begin_route(goal_of_passed_poses(1.0, 2.0, 3.0))
    assert way.covers(goal_of_passed_poses(2.0, 3.0))
    assert way.covers(DriveGoal(2, place(3.0, theta=1.0), deviation_xy=0.3))
    assert not way.covers(goal_of_passed_poses(2.0, 3.0, 4.0))
    assert not way.covers(goal_of_passed_poses(2.0))
    assert not way.covers(goal_of_passed_poses(0.0, 1.0, 2.0, 3.0))


def test_a_single_pose_is_not_a_route() -> None:
    way = PassedPoses()
    way.begin_route(goal_of_passed_poses(1.0))
    assert not way.covers(goal_of_passed_poses(1.0))


def test_a_dropped_pose_that_the_robot_turns_away_from_is_missed() -> None:
    way, wanted = PassedPoses(), goal_of_passed_poses(5.0, 10.0)
    way.begin_route(wanted)
    assert not way.is_missed(wanted, place(4.0, 1.0))
    way.on_places_left(wanted, 2)
    assert not way.is_missed(wanted, place(2.0, 1.0))
    way.on_places_left(wanted, 1)
    assert not way.is_missed(wanted, place(4.5, 0.6))
    assert not way.is_missed(wanted, place(5.0, 0.6))
    assert way.is_missed(wanted, place(6.0, 0.6))


def test_a_reached_pose_is_not_missed() -> None:
    way, wanted = PassedPoses(), goal_of_passed_poses(5.0, 10.0)
    way.begin_route(wanted)
    way.on_places_left(wanted, 1)
    assert not way.is_missed(wanted, place(5.0, 0.2))
    assert not way.is_missed(wanted, place(7.0))


def test_each_pose_is_checked_separately() -> None:
    way = PassedPoses()
    way.begin_route(goal_of_passed_poses(5.0, 10.0, 15.0))
    way.on_places_left(goal_of_passed_poses(5.0, 10.0, 15.0), 2)
    assert not way.is_missed(goal_of_passed_poses(5.0, 10.0, 15.0), place(5.0, 0.6))
    way.advance_goal()
    assert not way.is_missed(goal_of_passed_poses(10.0, 15.0), place(7.0))


READING = FeedbackReading("aa", 1.0, 2.0, 0.5, "map", 7.0, 0)


def test_a_pose_is_reported_after_a_distance() -> None:
    told = FeedbackFilter()
    assert told.has_moved(READING, 0.0)
    assert not told.has_moved(READING, 1.0)
    assert not told.has_moved(replace(READING, x=1.04), 1.1)
    assert told.has_moved(replace(READING, x=1.06), 1.2)


def test_turning_on_the_spot_is_reported_too() -> None:
    told = FeedbackFilter()
    told.has_moved(replace(READING, yaw=3.1), 0.0)
    assert not told.has_moved(replace(READING, yaw=-3.15), 0.1), "nearly the same heading, across the seam"
    assert told.has_moved(replace(READING, yaw=-2.9), 0.2)
    assert told.has_moved(replace(READING, yaw=-2.7), 0.3)


def test_is_fresh_for_a_while() -> None:
    told = FeedbackFilter()
    assert not told.is_fresh(0.0)
    told.has_moved(READING, 0.0)
    assert told.is_fresh(0.4)
    assert not told.is_fresh(0.6)


def test_progress_is_reported_each_second_and_recoveries_at_once() -> None:
    told = FeedbackFilter()
    assert told.progress(READING, "hall", 0.0) == DriveProgress(7.0, 0, "hall")
    assert told.progress(replace(READING, left=6.0), "hall", 0.5) is None
    assert told.progress(replace(READING, recoveries=1), "hall", 0.6) == DriveProgress(7.0, 1, "hall")
    assert told.progress(replace(READING, recoveries=1, left=0.0), "hall", 1.7) == DriveProgress(
        None, 1, "hall"
    ), "0 means that Nav2 has no path"


def test_a_new_drive_is_reported_at_once() -> None:
    told = FeedbackFilter()
    told.progress(READING, "hall", 0.0)
    assert told.progress(replace(READING, goal_id="bb"), "hall", 0.01) == DriveProgress(7.0, 0, "hall")


class Silence:
    """A watch that hears odometry each 50 ms, and what it reports."""

    def __init__(self) -> None:
        self.watch, self.now = SilenceWatch(), 10.0
        self.reported: list[float] = []
        self.watch.on_feedback("a", self.now)

    def passes(self, seconds: float, live: tuple[str, ...] = ("a",), *, period: float = 0.05) -> None:
        for _ in range(round(seconds / period)):
            self.now += period
            if silent := self.watch.on_velocity(self.now, live):
                self.reported.append(silent)


def test_a_silence_is_reported_as_it_grows_and_each_time_once() -> None:
    silence = Silence()
    silence.passes(0.4)
    assert silence.reported == []
    silence.passes(3.0)
    assert silence.reported == pytest.approx([0.5, 1.0, 2.0], abs=0.06)
    silence.watch.on_feedback("a", silence.now)
    silence.passes(0.4)
    assert len(silence.reported) == 3
    silence.passes(0.2)
    assert len(silence.reported) == 4


def test_a_gap_without_any_message_is_not_the_navigators_silence() -> None:
    silence = Silence()
    silence.passes(0.2)
    silence.passes(1.5, period=1.5)
    assert silence.reported == []
    silence.passes(0.3)
    assert len(silence.reported) == 1


def test_a_robot_without_a_goal_expects_no_feedback() -> None:
    silence = Silence()
    silence.passes(5.0, ())
    silence.passes(5.0)
    assert silence.reported == [], "the next goal has had none yet"
    silence.watch.on_feedback("a", silence.now)
    silence.passes(0.6)
    assert len(silence.reported) == 1


def test_the_silence_of_a_goal_that_has_ended_is_not_the_next_ones() -> None:
    """A path may be followed by a goal sent by topic, which never has feedback."""
    silence = Silence()
    silence.passes(0.3)
    silence.passes(5.0, ("b",))
    assert silence.reported == []
    silence.watch.on_feedback("b", silence.now)
    assert silence.watch.silent_for(silence.now + 1.0, ("b",)) == 1.0
    assert silence.watch.silent_for(silence.now + 1.0, ("c",)) == 0.0
    silence.passes(0.6, ("c", "b"))
    assert len(silence.reported) == 1, "the goal before has not ended"


@pytest.mark.ros
async def test_a_client_without_the_types_of_its_action_sends_no_goals() -> None:
    handlers = action_client.ActionHandlers(lambda _: None, lambda _: None, lambda _: None)
    client = action_client.ActionClient(RosSettings(), "navigate_to_pose", None, handlers)
    assert not client.is_ready
    assert await client.send_goal(goal(1), MARK.new()) is None
    client.request_result("aa")


def test_an_abort_without_a_reason_names_likely_causes(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.result(goal_id, GoalStatus.ABORTED, 0)
    talk.array(**{f"g{goal_id}": 6})
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert "deactivated" in failed.description
    assert "default_server_timeout" in failed.description


def others(talk: Conversation, **statuses: int) -> None:
    entries = [GoalEntry(goal_id.removeprefix("g"), GoalStatus.of(s)) for goal_id, s in statuses.items()]
    talk.said += talk.tracker.on_other_statuses(entries, talk.now)


def test_the_robot_yields_to_a_foreign_goal_that_nav2_rejects(talk: Conversation) -> None:
    others(talk, **{f"g{'aa' * 16}": 6})
    goal_id = talk.driving()
    others(talk, **{f"g{THEIRS}": 2})
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.TAKEN_OVER
    assert CancelGoal(goal_id) in talk.said
    others(talk, **{f"g{THEIRS}": 6})
    assert [each.goal_id for each in talk.tables[-1].external] == [THEIRS], "it can be given again"
    talk.array(**{f"g{goal_id}": 5})
    talk.later(YIELD_TIME - 0.5)
    assert talk.tracker.busy
    assert talk.tables[-1].external
    talk.later(1.0)
    assert not talk.tables[-1].external
    assert not talk.tracker.busy


def test_a_resent_foreign_goal_drives_and_ends(talk: Conversation) -> None:
    again = "ee" * 16
    others(talk)
    goal_id = talk.driving()
    others(talk, **{f"g{THEIRS}": 6})
    talk.array(**{f"g{goal_id}": 5})
    others(talk, **{f"g{THEIRS}": 6, f"g{again}": 2})
    talk.later(2 * YIELD_TIME)
    assert [each.goal_id for each in talk.tables[-1].external] == [again]
    others(talk, **{f"g{THEIRS}": 6, f"g{again}": 4})
    assert not talk.tables[-1].external


def test_foreign_goals_that_ended_earlier_do_not_take_over(talk: Conversation) -> None:
    ended = [GoalEntry(THEIRS, GoalStatus.ABORTED)]
    talk.said += talk.tracker.on_other_statuses(ended, 1.0)
    talk.driving()
    talk.said += talk.tracker.on_other_statuses(ended, talk.now)
    assert talk.ends == []


def test_the_robot_also_yields_to_the_very_first_foreign_goal(talk: Conversation) -> None:
    talk.driving()
    others(talk, **{f"g{THEIRS}": 6})
    assert len(talk.ends) == 1


def test_a_route_that_succeeded_without_being_driven_is_resent_at_once(talk: Conversation) -> None:
    ahead = (Pose(9.0, 0.0, 0.0, "hall"), Pose(13.0, 0.0, 0.0, "hall"))
    first = talk.driving()
    talk.array(**{f"g{first}": 2})
    talk.go_to(DriveGoal(2, Pose(7.0, 0.0, 0.0, "hall"), deviation_xy=0.5, ahead=ahead))
    talk.answer()
    second = talk.sent[-1]
    talk.arrive(4.8)
    talk.array(**{f"g{first}": 6, f"g{second}": 4})
    talk.later(0.1)
    assert len(talk.sent) == 3
    assert [command.goal.ahead for command in talk.said if isinstance(command, SendGoal)][-1] == ahead
    assert talk.ends == []
