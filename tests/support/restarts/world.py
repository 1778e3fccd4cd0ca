"""The robot itself, its navigation, and what its actions have done: all that outlives the agent."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import dist

from nena_edge_agent.driver.port import GoalReport, GoalTable, Pose
from support.robot_core import MAP

STEP = 0.1
"""Seconds between two looks at the motion."""
SPEED = 5.0
"""Metres per second."""
ACCEPTED_AFTER = 0.01
"""Seconds from the publication of a goal to its acceptance."""
CANCELED_AFTER = 0.05
"""Seconds from a cancel to its end."""


@dataclass(slots=True)
class Goal:
    """A goal that navigation has accepted."""

    goal_id: str
    pose: Pose
    status: str = "EXECUTING"

    @property
    def ended(self) -> bool:
        """Whether it runs no more."""
        return self.status not in ("EXECUTING", "CANCELING")


class World:
    """One robot with a Nav2-like driver; ``listener`` is called when goals or the pose have changed."""

    def __init__(self) -> None:
        self.pose = Pose(0.0, 0.0, 0.0, MAP)
        self.goals: dict[str, Goal] = {}
        self.begun_once: Counter[str] = Counter()
        """Actions that cannot be begun again."""
        self.listener: Callable[[], None] | None = None
        self.on_accepted: Callable[[Goal], None] = lambda _: None
        self.on_begun: Callable[[str], None] = lambda _: None
        self._loop = asyncio.get_running_loop()
        self._moving: asyncio.TimerHandle | None = None

    @property
    def running(self) -> Goal | None:
        """The goal that is driven to."""
        return next((goal for goal in self.goals.values() if not goal.ended), None)

    def table(self, own: frozenset[str]) -> GoalTable:
        """Return the goals as reported by an agent whose own goals are ``own``."""
        return GoalTable(
            tuple(
                GoalReport(goal.goal_id, goal.goal_id not in own, goal.status, goal.ended)
                for goal in self.goals.values()
            )
        )

    def publish_goal(self, pose: Pose) -> None:
        """Accept a goal as by topic: without an answer, and a little later."""
        self._loop.call_later(ACCEPTED_AFTER, self._accept, pose)

    def begin(self, action_id: str, *, restartable: bool) -> None:
        """Count that an action has begun."""
        if not restartable:
            self.begun_once[action_id] += 1
        self.on_begun(action_id)

    def cancel(self, goal_id: str) -> None:
        """End a goal, a little later."""
        goal = self.goals[goal_id]
        if goal.status == "EXECUTING":
            goal.status = "CANCELING"
            self._loop.call_later(CANCELED_AFTER, self._end, goal, "CANCELED")
            self._tell()

    def _accept(self, pose: Pose) -> None:
        before = self.running
        goal = Goal(f"g{len(self.goals) + 1}", pose)
        self.goals[goal.goal_id] = goal
        if before:
            before.status = "ABORTED"
        self.on_accepted(goal)
        self._tell()
        if self._moving is None:
            self._moving = self._loop.call_later(STEP, self._move)

    def _move(self) -> None:
        self._moving = None
        goal = self.running
        if goal is None:
            return
        if goal.status == "EXECUTING":
            left = dist((self.pose.x, self.pose.y), (goal.pose.x, goal.pose.y))
            share = min(1.0, SPEED * STEP / left) if left else 1.0
            x = self.pose.x + share * (goal.pose.x - self.pose.x)
            y = self.pose.y + share * (goal.pose.y - self.pose.y)
            self.pose = goal.pose if share >= 1.0 else replace(goal.pose, x=x, y=y)
            if share >= 1.0:
                self._end(goal, "SUCCEEDED")
        self._tell()
        self._moving = self._loop.call_later(STEP, self._move)

    def _end(self, goal: Goal, status: str) -> None:
        if not goal.ended:
            goal.status = status
            self._tell()

    def _tell(self) -> None:
        if self.listener:
            self.listener()
