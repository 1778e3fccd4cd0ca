"""Whose goals are in the status array, where this agent gives them their ids itself."""

from __future__ import annotations

from collections.abc import Sequence

from nena_edge_agent.driver.port import GoalReport, GoalTable
from nena_edge_agent.ros.goal_ledger import Goal, GoalLedger
from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.goal_status import GoalEntry, GoalStatus


class MarkedLedger(GoalLedger):
    """Nothing has to be worked out: an id with the agent's mark is ours, and no other one.

    Goals given by topic, before or in between, are told as ever.
    """

    def __init__(self, mark: GoalMark, *, confirmation_time: float, settle_time: float) -> None:
        super().__init__(confirmation_time=confirmation_time, settle_time=settle_time)
        self._mark = mark
        self._others: tuple[GoalReport, ...] = ()

    @property
    def table(self) -> GoalTable:
        """The goals of the last array, and before them those that run at the other action."""
        return GoalTable((*self._others, *super().table.goals))

    def set_others(self, entries: Sequence[GoalEntry]) -> None:
        """Take the goals of the action that only others give goals to."""
        self._others = tuple(
            GoalReport(entry.goal_id, external=True, status=entry.status.name)
            for entry in entries
            if not entry.status.terminal and not self._mark.bears(entry.goal_id)
        )

    def sent(self, now: float) -> None:
        """Note that a goal with an id of ours is sent; its answer is awaited."""
        self._expire(now)
        self._awaited, self._given_at = True, now

    def accept(self, goal_id: str) -> None:
        """Take the server's word that it drives for a goal of ours; its array may come later."""
        self._awaited = False
        self._goals.setdefault(goal_id, Goal(ours=True, status=GoalStatus.ACCEPTED))

    def settle(self, goal_id: str, status: GoalStatus) -> None:
        """Take the end of a goal from its result, which may come before the array."""
        goal = self._goals.get(goal_id)
        if goal is not None and not goal.status.terminal and status.terminal:
            goal.status = status

    def _owns(self, goal_id: str, claimed: Sequence[str]) -> bool:
        return self._mark.bears(goal_id) or super()._owns(goal_id, claimed)

    def _claim(self, fresh: Sequence[str], *, first: bool) -> tuple[str, ...]:
        return super()._claim([each for each in fresh if not self._mark.bears(each)], first=first)

    def _find_given_before(self, listed: list[str]) -> None:
        """Know the goal that an earlier run gave last by its mark; one given by topic by its place."""
        newest = next((each for each in reversed(listed) if self._mark.bears(each)), None)
        if self._given_behind is None or newest is None:
            super()._find_given_before(listed)
            return
        behind, self._given_behind = self._given_behind, None
        self.given_before = None if newest in self._orphans or newest == behind else newest
