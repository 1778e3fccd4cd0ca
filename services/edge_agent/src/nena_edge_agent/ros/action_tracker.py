"""Gives goals to Nav2's action and follows them, with what an action says beside the statuses.

A goal has an id of ours from the beginning, it is accepted or refused in so many words, and its result says
why a drive has failed. The status array tells the rest, as it does of goals given by topic; those are given
where the action's server is not there and the settings allow it.
"""

from __future__ import annotations

from nena_edge_agent.driver.port import DriveFailure
from nena_edge_agent.ros.commands import AskResult, Command, SendGoal
from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.goal_status import GoalStatus
from nena_edge_agent.ros.goal_tracker import Drive, GoalTracker
from nena_edge_agent.ros.marked_ledger import MarkedLedger
from nena_edge_agent.ros.navigation_error import reason_of
from nena_edge_agent.ros.settings import GoalSettings

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
        self._sent.append(goal_id)
        self._ledger.sent(now)
        self._out.append(SendGoal(drive.goal, goal_id))

    def _bind(self, drive: Drive, claimed: tuple[str, ...]) -> None:
        """Find the goal in the array, should the answer to it be lost."""
        super()._bind(drive, claimed)
        if drive.goal_id is None and drive is self._sent_for:
            listed = [each for each in self._sent if self._ledger.status(each) is not None]
            drive.goal_id = listed[-1] if listed else None

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
