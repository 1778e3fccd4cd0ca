from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from nena_edge_agent.driver.map_port import MapDriverEvent, MapGoal, MapOwnGoals, MapPose
from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    GoalTable,
    Halted,
    NavigationReport,
)
from nena_edge_agent.ros.action_tracker import REASON_WAIT, ActionTracker
from nena_edge_agent.ros.commands import AskResult, CancelGoal, Command, PublishGoal, Report, SendGoal
from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.goal_status import GoalEntry, GoalStatus
from nena_edge_agent.ros.settings import GoalSettings

MARK = GoalMark("agent")
THEIRS = "ff" * 16


def goal(generation: int, x: float = 5.0) -> MapGoal:
    return MapGoal(generation, MapPose(x, 0.0, 0.0, "hall"), deviation_xy=0.5)


@dataclass
class Conversation:
    """A tracker that drives by the action, the time, and all that it has said."""

    tracker: ActionTracker = field(default_factory=lambda: ActionTracker(GoalSettings(), MARK))
    now: float = 10.0
    said: list[Command] = field(default_factory=list)

    def ready(self) -> Conversation:
        self.said += self.tracker.on_servers(frozenset({"gid"}), 0.0)
        self.said += self.tracker.on_navigation(NavigationReport(available=True, reason=""), 0.0)
        self.said += self.tracker.on_pose(MapPose(0.0, 0.0, 0.0, "hall"), 0.0)
        self.tracker.by_action = True
        self.said += self.tracker.tick(self.now)
        return self

    def go_to(self, wanted: MapGoal) -> None:
        self.said += self.tracker.go_to(wanted, self.now)

    def driving(self, generation: int = 1) -> str:
        """Give a goal and have it accepted; gives its id."""
        self.go_to(goal(generation))
        self.answer()
        return self.sent[-1]

    def answer(self, goal_id: str = "", *, accepted: bool | None = True) -> None:
        self.said += self.tracker.on_goal_answer(goal_id or self.sent[-1], self.now, accepted=accepted)

    def result(self, goal_id: str, status: GoalStatus, code: int = 0) -> None:
        self.said += self.tracker.on_result(goal_id, status, (code, ""), self.now)

    def array(self, **statuses: int) -> None:
        entries = [GoalEntry(goal_id.removeprefix("g"), GoalStatus.of(s)) for goal_id, s in statuses.items()]
        self.said += self.tracker.on_statuses(entries, self.now)

    def arrive(self, x: float = 5.0) -> None:
        self.said += self.tracker.on_pose(MapPose(x, 0.0, 0.0, "hall"), self.now)

    def later(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + 0.05, end)
            self.said += self.tracker.tick(self.now)

    @property
    def sent(self) -> list[str]:
        return [command.goal_id for command in self.said if isinstance(command, SendGoal)]

    @property
    def ends(self) -> list[MapDriverEvent]:
        told = [command.event for command in self.said if isinstance(command, Report)]
        return [event for event in told if isinstance(event, Arrived | DriveFailed | Halted)]

    @property
    def tables(self) -> list[GoalTable]:
        told = [command.event for command in self.said if isinstance(command, Report)]
        return [event for event in told if isinstance(event, GoalTable)]


@pytest.fixture
def talk() -> Conversation:
    return Conversation().ready()


def test_a_goal_has_an_id_of_ours_is_accepted_and_its_result_is_asked_for(talk: Conversation) -> None:
    goal_id = talk.driving()
    assert MARK.bears(goal_id)
    assert talk.tracker.goal_id == goal_id
    assert talk.said.count(AskResult(goal_id)) == 1
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


def test_the_reason_may_come_after_the_array(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6})
    assert talk.ends == []
    assert talk.tracker.busy
    talk.later(REASON_WAIT / 2)
    talk.result(goal_id, GoalStatus.ABORTED, 208)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.ABORTED
    assert "no way to the place (error code 208)" in failed.description


def test_a_reason_that_does_not_come_is_not_waited_for_long(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6})
    talk.later(REASON_WAIT + 0.1)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert "Nav2's log" in failed.description
    assert not talk.tracker.busy


def test_an_aborted_goal_without_a_code_fails_at_once(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.result(goal_id, GoalStatus.ABORTED)
    assert [type(end) for end in talk.ends] == [DriveFailed]


def test_a_goal_of_ours_in_place_of_another_one_is_no_failure(talk: Conversation) -> None:
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


def test_a_refused_goal_is_sent_again_under_another_id_and_then_fails(talk: Conversation) -> None:
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
    assert "has refused" in failed.description


def test_an_answer_that_is_lost_is_made_up_for_by_the_array(talk: Conversation) -> None:
    talk.go_to(goal(1))
    (goal_id,) = talk.sent
    talk.answer(accepted=None)
    talk.array(**{f"g{goal_id}": 2})
    assert talk.tracker.goal_id == goal_id
    assert AskResult(goal_id) in talk.said or talk.tracker.tick(talk.now) == [AskResult(goal_id)]
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


def test_a_goal_of_somebody_else_takes_over(talk: Conversation) -> None:
    goal_id = talk.driving()
    talk.array(**{f"g{goal_id}": 6, f"g{THEIRS}": 2})
    talk.result(goal_id, GoalStatus.ABORTED)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.TAKEN_OVER


def test_a_goal_of_an_earlier_run_goes_on_and_its_result_is_asked_for() -> None:
    goal_id = MARK.new()
    talk = Conversation()
    talk.tracker.reclaim(MapOwnGoals((goal_id,), goal(1).pose))
    talk.ready()
    talk.array(**{f"g{goal_id}": 2})
    talk.go_to(goal(7))
    talk.later(0.1)
    assert talk.tracker.goal_id == goal_id
    assert AskResult(goal_id) in talk.said
    assert talk.sent == []
    talk.result(goal_id, GoalStatus.ABORTED, 105)
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert (failed.generation, failed.failure) == (7, DriveFailure.ABORTED)


def test_a_goal_sent_just_before_a_restart_is_taken_up_by_its_mark() -> None:
    goal_id = MARK.new()
    talk = Conversation()
    talk.tracker.reclaim(MapOwnGoals((), goal(1).pose, goal(1).pose, ""))
    talk.ready()
    talk.array(**{f"g{goal_id}": 2})
    talk.go_to(goal(7))
    assert talk.tracker.goal_id == goal_id
    assert talk.sent == []


def test_a_running_goal_of_ours_that_nobody_knows_is_cancelled() -> None:
    goal_id = MARK.new()
    talk = Conversation().ready()
    talk.array(**{f"g{goal_id}": 2})
    assert CancelGoal(goal_id) in talk.said


def test_without_the_action_goals_are_given_by_topic(talk: Conversation) -> None:
    talk.tracker.by_action = False
    talk.go_to(goal(1))
    assert any(isinstance(command, PublishGoal) for command in talk.said)
    talk.array(**{f"g{THEIRS}": 2})
    assert talk.tracker.goal_id == THEIRS
    talk.array(**{f"g{THEIRS}": 6})
    (failed,) = talk.ends
    assert isinstance(failed, DriveFailed)
    assert failed.failure is DriveFailure.ABORTED


def way(generation: int, *xs: float) -> MapGoal:
    first, *rest = (MapPose(x, 0.0, 0.0, "hall") for x in xs)
    return MapGoal(generation, first, deviation_xy=0.3, ahead=tuple(rest))


def on_its_way(talk: Conversation, *xs: float) -> str:
    talk.go_to(way(1, *xs))
    talk.answer()
    return talk.sent[-1]


def test_the_next_place_of_a_way_needs_no_goal_of_its_own(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0, 15.0)
    talk.go_to(way(2, 10.0, 15.0))
    talk.go_to(way(3, 15.0))
    talk.arrive(15.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.sent == [goal_id]
    assert talk.ends == [Arrived(3)]


def test_a_way_that_has_become_longer_is_sent(talk: Conversation) -> None:
    first = on_its_way(talk, 5.0, 10.0)
    talk.go_to(way(2, 10.0, 15.0))
    talk.answer()
    talk.array(**{f"g{first}": 6, f"g{talk.sent[-1]}": 2})
    assert len(talk.sent) == 2
    assert talk.ends == []


def test_a_place_that_the_robot_leaves_out_is_driven_to_alone(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.tracker.on_places(goal_id, 1)
    talk.said += talk.tracker.on_pose(MapPose(5.0, 0.6, 0.0, "hall"), talk.now)
    talk.said += talk.tracker.on_pose(MapPose(6.0, 0.6, 0.0, "hall"), talk.now)
    last = [command for command in talk.said if isinstance(command, SendGoal)][-1]
    assert last.goal == way(1, 5.0)
    assert len(talk.sent) == 2


def test_the_end_of_a_way_waits_for_the_places_on_it(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.arrive(10.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    assert talk.ends == []
    talk.go_to(way(2, 10.0))
    assert talk.ends == [Arrived(2)]
    assert talk.sent == [goal_id]


def test_a_place_that_nobody_saw_passed_is_driven_to_after_the_end(talk: Conversation) -> None:
    goal_id = on_its_way(talk, 5.0, 10.0)
    talk.arrive(10.0)
    talk.result(goal_id, GoalStatus.SUCCEEDED)
    talk.later(GoalSettings().pose_wait + 0.1)
    assert talk.ends == []
    assert len(talk.sent) == 2


def test_goals_at_the_other_action_are_somebody_elses(talk: Conversation) -> None:
    talk.said += talk.tracker.on_other_statuses([GoalEntry(THEIRS, GoalStatus.EXECUTING)], talk.now)
    assert [goal.goal_id for goal in talk.tables[-1].external] == [THEIRS]
    talk.said += talk.tracker.on_other_statuses([GoalEntry(THEIRS, GoalStatus.SUCCEEDED)], talk.now)
    assert talk.tables[-1].external == ()
