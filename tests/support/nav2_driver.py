"""The Nav2 driver under test, and a Nav2 controlled by the test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self, TypeVar
from uuid import UUID

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.qos import qos_profile_system_default

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveGoal,
    DriverEvent,
    GoalReport,
    GoalTable,
    Halted,
    NavigationReport,
    Pose,
)
from nena_edge_agent.driver.port import PoseReport as PoseTold
from nena_edge_agent.nav2.driver import Nav2Driver
from nena_edge_agent.nav2.settings import GoalSettings, Navigation, RosSettings
from nena_robot_simulator.messages import pose_message, stamp_of
from nena_robot_simulator.motion import Pose as Place
from nena_shared.clock import SystemClock
from support.ros import LATCHED, Inbox, RosPeer
from support.waiting import PATIENCE, until

Told = DriverEvent | GoalReport
E = TypeVar("E", bound=Told)

MAP = "hall"
QUICK = GoalSettings(
    confirmation_time=0.5, settle_time=0.3, pose_wait=1.0, cancel_time=0.5, localisation_wait=0.1
)
"""Short timeouts, for tests in which something never arrives."""
PATIENT = GoalSettings(settle_time=0.3, pose_wait=3.0, localisation_wait=0.1)
"""Long timeouts, so that a slow machine fails nothing that is still coming."""


def goal_at(generation: int, x: float, y: float = 0.0, *, theta: float = 0.0, xy: float = 0.5) -> DriveGoal:
    return DriveGoal(generation, Pose(x, y, theta, MAP), deviation_xy=xy)


class DrivenRobot:
    """A started driver and all of its events."""

    def __init__(self, domain_id: int, namespace: str = "", **settings: Any) -> None:
        self.events: list[Told] = []
        self._goals: dict[str, GoalReport] = {}
        fields = {
            "goals": PATIENT,
            "watch_period": 0.1,
            "call_timeout": 3.0,
            "navigation": Navigation.TOPICS,
            **settings,
        }
        chosen = RosSettings(domain_id=domain_id, namespace=namespace, **fields)
        self.driver = Nav2Driver(chosen, MAP, self._hear, SystemClock())

    async def __aenter__(self) -> Self:
        await self.driver.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.driver.stop()

    def _hear(self, event: DriverEvent) -> None:
        """Store an event, and each new or changed row of a goal table."""
        self.events.append(event)
        if isinstance(event, GoalTable):
            self.events += [goal for goal in event.goals if self._goals.get(goal.goal_id) != goal]
            self._goals = {goal.goal_id: goal for goal in event.goals}

    @property
    def ends(self) -> list[DriverEvent]:
        """Return the events that end drives and halts, without progress information."""
        return [event for event in self.events if isinstance(event, Arrived | DriveFailed | Halted)]

    def all(self, kind: type[E]) -> list[E]:
        return [event for event in self.events if isinstance(event, kind)]

    @property
    def events_but_poses(self) -> list[Told]:
        """Return all events without the poses."""
        return [event for event in self.events if not isinstance(event, PoseTold)]

    async def hears(
        self, kind: type[E], accept: Callable[[E], bool] = lambda _: True, *, seconds: float = PATIENCE
    ) -> E:
        """Return the first event of a kind for which ``accept`` is true, also an earlier one."""
        return await until(
            lambda: next((event for event in self.all(kind) if accept(event)), None),
            timeout=seconds,
            what=lambda: f"{kind.__name__} (told: {self.events_but_poses[-8:]})",
        )

    async def ready(self) -> Self:
        await self.hears(NavigationReport, lambda report: report.available)
        return self

    async def driving(self, goal: DriveGoal) -> GoalReport:
        """Return a goal and wait until navigation has it."""
        before = len(self.all(GoalReport))
        self.driver.go_to(goal)
        return await until(
            lambda: next((r for r in self.all(GoalReport)[before:] if not r.external), None),
            what=f"goal {goal.generation} under way",
        )


class ScriptedNav2:
    """Nav2's topics, with only the test behind them."""

    def __init__(self, peer: RosPeer) -> None:
        self._stamp = 0
        self._statuses = peer.node.create_publisher(
            GoalStatusArray, "navigate_to_pose/_action/status", LATCHED
        )
        self._poses = peer.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        self.goals: Inbox[Any] = peer.subscribe(PoseStamped, "goal_pose", qos_profile_system_default)
        self.cancels: list[UUID] = []
        peer.node.create_service(CancelGoal, "navigate_to_pose/_action/cancel_goal", self._on_cancel)
        self.pose(0.0)

    def array(self, text: str) -> None:
        """Publish an array written as ``A:2 B:6``."""
        array = GoalStatusArray()
        for name, status in (part.split(":") for part in text.split()):
            entry = GoalStatus(status=int(status))
            entry.goal_info.goal_id.uuid = list(uuid_of(name).bytes)
            array.status_list.append(entry)
        self._statuses.publish(array)

    def pose(self, x: float) -> None:
        self._stamp += 1
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.header.stamp = stamp_of(self._stamp)
        message.pose.pose = pose_message(Place(x, 0.0, 0.0))
        self._poses.publish(message)

    def _on_cancel(self, request: CancelGoal.Request, response: CancelGoal.Response) -> Any:
        self.cancels.append(UUID(bytes=bytes(request.goal_info.goal_id.uuid)))
        return response


def uuid_of(name: str) -> UUID:
    """Return the goal ID for a letter."""
    return UUID(bytes=name.encode().ljust(16, b"-"))
