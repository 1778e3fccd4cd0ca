"""What bt_navigator has in the ROS graph: gone while it is unconfigured, and others after a restart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.srv import GetState
from rclpy.qos import qos_profile_system_default

from nena_robot_simulator.action import Action
from nena_robot_simulator.action_endpoints import ActionEndpoints, ActionServer
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.session import RosSession
from nena_robot_simulator.status_array import Snapshot


class NavigatorEndpoints:
    """Two actions, the goal topic and the lifecycle service; closed at first.

    ``types`` are those of the actions that this machine has: without them NavigateToPose shows its statuses
    and can be cancelled, which is all that driving by the topic needs.
    """

    def __init__(
        self,
        session: RosSession,
        server: ActionServer,
        types: Mapping[Action, Any],
        *,
        on_goal_pose: Callable[[Any], None],
        on_get_state: Callable[[Any, Any], None],
    ) -> None:
        self._session = session
        self._on_goal_pose = on_goal_pose
        self._on_get_state = on_get_state
        self._actions = {
            action: ActionEndpoints(session, action, types.get(action), server)
            for action in (Action.TO_POSE, *types)
        }
        self._others: list[Any] = []

    def show(self, *, there: bool) -> None:
        """Appear in the graph or leave it; each appearance is a new server with an empty list."""
        if there and not self._others:
            self._open()
        elif not there and self._others:
            self._close()

    def publish(self, action: Action, snapshot: Snapshot) -> None:
        """Publish a status array, if anybody is there to do so."""
        if action in self._actions:
            self._actions[action].publish(snapshot)

    def answer(self, action: Action) -> None:
        """Answer those who wait for a result that is there now."""
        if action in self._actions:
            self._actions[action].answer()

    def tell(
        self, feedback: Callable[[Action], Feedback | None], frame_id: str, stamp: Callable[[], int]
    ) -> None:
        """Publish the feedback of the action that is driven for, where somebody listens."""
        for action, endpoints in self._actions.items():
            told = feedback(action) if endpoints.wants_feedback else None
            if told is not None:
                endpoints.publish_feedback(told, frame_id, stamp())

    def _open(self) -> None:
        for endpoints in self._actions.values():
            endpoints.open()
        session = self._session
        self._others = [
            session.subscribe(PoseStamped, "goal_pose", self._on_goal_pose, qos_profile_system_default),
            session.serve(GetState, "bt_navigator/get_state", self._on_get_state),
        ]

    def _close(self) -> None:
        for endpoints in self._actions.values():
            endpoints.close()
        for entity in self._others:
            self._session.destroy(entity)
        self._others = []
