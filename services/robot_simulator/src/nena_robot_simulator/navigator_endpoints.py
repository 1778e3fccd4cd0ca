"""What bt_navigator has in the ROS graph: gone while it is unconfigured, and others after a restart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.srv import GetState
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_system_default

from nena_robot_simulator import messages
from nena_robot_simulator.session import RosSession
from nena_robot_simulator.status_array import Snapshot

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class NavigatorEndpoints:
    """The goal topic, the status topic, the cancel service and the lifecycle service; closed at first."""

    def __init__(
        self,
        session: RosSession,
        *,
        on_goal: Callable[[Any], None],
        on_cancel: Callable[[Any, Any], None],
        on_get_state: Callable[[Any, Any], None],
    ) -> None:
        self._session = session
        self._on_goal = on_goal
        self._on_cancel = on_cancel
        self._on_get_state = on_get_state
        self._status: Any = None
        self._others: list[Any] = []

    def show(self, *, there: bool) -> None:
        """Appear in the graph or leave it; each appearance is a new server with an empty list."""
        if there and self._status is None:
            self._open()
        elif not there and self._status is not None:
            self._close()

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status array, if anybody is there to do so."""
        if self._status is not None:
            self._status.publish(messages.status_array(snapshot))

    def _open(self) -> None:
        session = self._session
        self._status = session.publisher(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
        self._others = [
            session.subscribe(PoseStamped, "goal_pose", self._on_goal, qos_profile_system_default),
            session.serve(CancelGoal, "navigate_to_pose/_action/cancel_goal", self._on_cancel),
            session.serve(GetState, "bt_navigator/get_state", self._on_get_state),
        ]

    def _close(self) -> None:
        for entity in (self._status, *self._others):
            self._session.destroy(entity)
        self._status, self._others = None, []
