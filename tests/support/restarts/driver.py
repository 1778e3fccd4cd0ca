"""The driver of the robot in the world; what its agent does at a deadly moment does not reach it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import dist

from nena_edge_agent.driver.port import (
    Area,
    Arrived,
    BatteryReport,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriverEvent,
    Emit,
    GoalTable,
    Halted,
    NavigationReport,
    OwnGoals,
    Pose,
    PoseReport,
    PositionInitialized,
)
from support.restarts.fate import Fate
from support.restarts.world import Goal, World


class WorldDriver:
    """Follows its goals by their ids, as the driver for Nav2 does."""

    def __init__(self, world: World, fate: Fate, emit: Emit) -> None:
        self._world = world
        self._fate = fate
        self._emit = emit
        self._goal: DriveGoal | None = None
        self._goal_id: str | None = None
        self._own: set[str] = set()
        self._awaited = 0
        self._known: set[str] = set()
        self._reclaimed: OwnGoals | None = None
        self._halting = False
        self._table = GoalTable()

    async def start(self) -> None:
        """Observe the world."""
        self._claim_unconfirmed()
        self._known = set(self._world.goals)
        self._world.listener = self._look
        self._tell(PoseReport(self._world.pose, localized=True, vx=0.0, omega=0.0))
        self._tell(BatteryReport(80.0, charging=False))
        self._report_table()
        self._tell(NavigationReport(available=True, reason=""))

    async def stop(self) -> None:
        """Stop observing."""

    def reclaim(self, goals: OwnGoals) -> None:
        """Treat running goals as ours."""
        self._reclaimed = goals
        self._own |= set(goals.goal_ids)

    def go_to(self, goal: DriveGoal) -> None:
        """Drive, or go on driving."""
        self._goal, self._goal_id = goal, None
        earlier = self._same(goal)
        if earlier:
            self._goal_id = earlier.goal_id
            asyncio.get_running_loop().call_soon(self._look)
        else:
            self._guarded("give a goal", lambda: self._give(goal))

    def halt(self) -> None:
        """Cancel all that is ours."""
        self._goal, self._goal_id, self._halting, self._reclaimed = None, None, True, None
        self._guarded("halt", self._cancel_own)
        asyncio.get_running_loop().call_soon(self._look)

    def keep_out(self, areas: tuple[Area, ...]) -> None:
        self.areas = areas

    def limit_speed(self, speed: float | None) -> None:
        """Do nothing: the speed stays the same."""

    def initialize_position(self, pose: Pose) -> None:
        """Move to the pose at once."""

        def place() -> None:
            self._world.pose = pose
            self._tell(PositionInitialized(succeeded=True, description=""))

        self._guarded("set the position", lambda: asyncio.get_running_loop().call_later(0.05, place))

    def _claim_unconfirmed(self) -> None:
        """Treat the last goal as ours, if the earlier run could not see it accepted."""
        goals, listed = self._reclaimed, list(self._world.goals)
        if goals and goals.given and goals.behind in ("", *listed):
            later = listed[listed.index(goals.behind) + 1 :] if goals.behind else listed[-1:]
            self._own |= set(later[:1])

    def _same(self, goal: DriveGoal) -> Goal | None:
        """Return the goal of an earlier run that leads to the same place and runs, or has got there."""
        goals, self._reclaimed = self._reclaimed, None
        mine = [each for each in self._world.goals.values() if each.goal_id in self._own]
        if goals is None or not mine or mine[-1].status not in ("EXECUTING", "SUCCEEDED"):
            return None
        known = mine[-1].goal_id in goals.goal_ids
        pose = goals.pose if known else goals.given
        reached = mine[-1].status == "EXECUTING" or self._near(goal)
        same = pose is not None and dist((pose.x, pose.y), (goal.pose.x, goal.pose.y)) < 0.001
        return mine[-1] if same and reached else None

    def _near(self, goal: DriveGoal) -> bool:
        pose = self._world.pose
        return dist((pose.x, pose.y), (goal.pose.x, goal.pose.y)) <= goal.deviation_xy

    def _give(self, goal: DriveGoal) -> None:
        self._awaited += 1
        self._world.publish_goal(goal.pose)

    def _cancel_own(self) -> None:
        for goal in self._world.goals.values():
            if goal.goal_id in self._own:
                self._world.cancel(goal.goal_id)

    def _look(self) -> None:
        if not self._fate.alive:
            return
        for goal_id in self._world.goals:
            if goal_id not in self._known and self._awaited:
                self._own.add(goal_id)
                self._awaited -= 1
                self._goal_id = goal_id if self._goal and not self._awaited else None
            self._known.add(goal_id)
        if self._halting:
            self._cancel_own()
        self._tell(PoseReport(self._world.pose, localized=True, vx=0.0, omega=0.0))
        self._report_table()
        self._follow()

    def _follow(self) -> None:
        running = any(goal.goal_id in self._own and not goal.ended for goal in self._world.goals.values())
        if self._halting and not running and not self._awaited:
            self._halting = False
            self._tell(Halted())
        goal, status = self._goal, self._world.goals[self._goal_id].status if self._goal_id else ""
        if goal and status == "SUCCEEDED" and self._near(goal):
            self._goal = None
            self._tell(Arrived(goal.generation))
        elif goal and status not in ("", "EXECUTING", "CANCELING"):
            self._goal = None
            self._tell(DriveFailed(goal.generation, DriveFailure.ABORTED, status))

    def _report_table(self) -> None:
        table = self._world.table(frozenset(self._own))
        if table != self._table:
            self._table = table
            self._tell(table)

    def _tell(self, event: DriverEvent) -> None:
        if self._fate.spares(f"tell {type(event).__name__}"):
            self._emit(event)

    def _guarded(self, what: str, step: Callable[[], object]) -> None:
        if self._fate.spares(f"before: {what}"):
            step()
            self._fate.spares(f"after: {what}")
