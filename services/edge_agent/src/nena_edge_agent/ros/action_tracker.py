"""Gives goals to Nav2's action and follows them, with what an action says beside the statuses.

A goal has an id of ours from the beginning, it is accepted or refused in so many words, and its result says
why a drive has failed. The status array tells the rest, as it does of goals given by topic; those are given
where the action's server is not there and the settings allow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.driver.port import DriveFailure
from nena_edge_agent.ros.commands import AskResult, Command, SendGoal
from nena_edge_agent.ros.drive import Drive
from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.goal_status import GoalEntry, GoalStatus
from nena_edge_agent.ros.goal_tracker import GoalTracker
from nena_edge_agent.ros.marked_ledger import MarkedLedger
from nena_edge_agent.ros.navigation_error import reason_of
from nena_edge_agent.ros.pose import agrees
from nena_edge_agent.ros.settings import GoalSettings
from nena_edge_agent.ros.way_driven import WayDriven
from nena_shared.log import get_logger

log = get_logger(__name__)

REASON_WAIT = 1.0
"""Seconds that the result of an aborted goal may come after the array that shows its end."""


class ActionTracker(GoalTracker):
    """``by_action`` is set by whoever sees the action's server: the next goal is sent to it."""

    def __init__(self, settings: GoalSettings, mark: GoalMark) -> None:
        super().__init__(settings)
        self._mark = mark
        self._ledger: MarkedLedger = MarkedLedger(
            mark, confirmation_time=settings.confirmation_time, settle_time=settings.settle_time
        )
        self.by_action = False
        self._way = WayDriven()
        self._sent_for: Drive | None = None
        self._sent: list[str] = []
        self._refused = False
        self._asked = ""
        self._reason: tuple[str, str | None] = ("", None)
        self._aborted: tuple[str, float] | None = None

    @property
    def goal_id(self) -> str | None:
        """The goal that Nav2 drives to for us, once it has taken it."""
        return self._drive.goal_id if self._drive is not None else None

    @property
    def busy(self) -> bool:
        """Whether something is waited for, so that :meth:`tick` is needed."""
        return self._aborted is not None or super().busy

    def go_to(self, goal: MapGoal, now: float) -> list[Command]:
        """Drive to ``goal``; where the one that is driven leads there anyway, nothing is sent."""
        drive = self._drive
        same = drive is not None and drive is self._sent_for and drive.goal_id in self._sent
        if drive is not None and same and self._aborted is None and self._way.covers(goal):
            drive.goal = goal
            self._way.go_on()
            return self._advance(now)
        return super().go_to(goal, now)

    def on_pose(self, pose: MapPose, now: float) -> list[Command]:
        """Take a pose; a place that the robot leaves out on a way over several is driven to anew."""
        drive = self._drive
        if drive is not None and drive.reached_at is None and self._way.missed(drive.goal, pose):
            self._give_alone(drive)
        return super().on_pose(pose, now)

    def on_places(self, goal_id: str, left: int) -> None:
        """Take how many places of its way navigation still means to drive to."""
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id:
            self._way.left(drive.goal, left)

    def on_other_statuses(self, entries: Sequence[GoalEntry], now: float) -> list[Command]:
        """Take the status array of the action that this agent gives no goals to."""
        self._ledger.set_others(entries)
        self._tell_table()
        return self._advance(now)

    def on_goal_answer(self, goal_id: str, now: float, *, accepted: bool | None) -> list[Command]:
        """Take the answer to a goal that was sent; None: there was none, and the array will show it."""
        drive = self._drive
        if accepted:
            self._ledger.accept(goal_id)
            if drive is not None and drive is self._sent_for and goal_id in self._sent:
                drive.goal_id, drive.reached_at = goal_id, None
            self._tell_table()
        elif accepted is False:
            self._refused = True
        return self._advance(now)

    def on_result(
        self, goal_id: str, status: GoalStatus, reason: tuple[int, str], now: float
    ) -> list[Command]:
        """Take the result of a goal: its last status, the ``error_code`` and the ``error_msg``."""
        self._ledger.settle(goal_id, status)
        if status.terminal:
            self._reason = (goal_id, reason_of(*reason))
            self._tell_table()
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id and drive.reached_at is None:
            self._follow(drive, goal_id, now, lost=False)
        return self._advance(now)

    def _publish(self, drive: Drive, now: float) -> None:
        if not self.by_action:
            super()._publish(drive, now)
            return
        if drive is not self._sent_for:
            self._sent_for, self._sent, self._refused = drive, [], False
        goal_id = self._mark.new()
        self._way.begin(drive.goal)
        self._sent.append(goal_id)
        self._ledger.sent(now)
        self._out.append(SendGoal(drive.goal, goal_id))

    def _bind(self, drive: Drive, claimed: tuple[str, ...]) -> None:
        """Find the goal in the array, should the answer to it be lost."""
        super()._bind(drive, claimed)
        if drive.goal_id is None and drive is self._sent_for:
            listed = [each for each in self._sent if self._ledger.status(each) is not None]
            drive.goal_id = listed[-1] if listed else None

    def _judge_arrival(self, now: float) -> None:
        """Wait at the end of a way for the nodes on it to be told passed; one that was not is driven to."""
        drive, pose = self._drive, self._pose
        if drive is None or drive.reached_at is None or not drive.goal.ahead or pose is None:
            super()._judge_arrival(now)
        elif agrees(pose, drive.goal):
            self._arrive(drive)
        elif now - drive.reached_at >= self._settings.pose_wait:
            self._give_alone(drive)

    def _give_alone(self, drive: Drive) -> None:
        """Give a goal again without what comes behind it."""
        log.info("a node on the way was left out and is driven to", generation=drive.goal.generation)
        self._drive = Drive(replace(drive.goal, ahead=()))

    def _advance(self, now: float) -> list[Command]:
        drive = self._drive
        if self._aborted is not None:
            goal_id = self._aborted[0]
            if drive is not None and drive.goal_id == goal_id:
                self._follow(drive, goal_id, now, lost=False)
            else:
                self._aborted = None
        self._ask_result()
        return super()._advance(now)

    def _ask_result(self) -> None:
        """Ask once what becomes of the goal that is driven, of an earlier run's too."""
        goal_id = self.goal_id
        if goal_id is not None and goal_id != self._asked and self._mark.bears(goal_id):
            self._asked = goal_id
            self._out.append(AskResult(goal_id))

    def _follow(self, drive: Drive, goal_id: str, now: float, *, lost: bool) -> None:
        """Let an end that needs a reason wait for it a little."""
        aborted = self._ledger.status(goal_id) is GoalStatus.ABORTED and self._mark.bears(goal_id)
        if aborted and not lost and self._reason[0] != goal_id:
            self._aborted = self._aborted or (goal_id, now)
            if now - self._aborted[1] < REASON_WAIT:
                return
        self._aborted = None
        super()._follow(drive, goal_id, now, lost=lost)

    def _fail_aborted(self, drive: Drive, goal_id: str) -> None:
        reason = self._reason[1] if self._reason[0] == goal_id else None
        if reason is None:
            super()._fail_aborted(drive, goal_id)
        else:
            self._fail(drive, DriveFailure.ABORTED, f"Nav2 has aborted the goal {goal_id}: {reason}")

    def _refusal(self, drive: Drive) -> str:
        if drive is self._sent_for and self._refused:
            return f"Nav2 has refused the goal, given {drive.times_given} times: is bt_navigator active?"
        return super()._refusal(drive)
