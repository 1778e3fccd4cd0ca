"""rclpy's own action server in place of Nav2's: independent of NeNa, and controlled by the test."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.qos import qos_profile_system_default
from rclpy.task import Future

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from nena_robot_simulator.messages import pose_message
from nena_robot_simulator.motion import Pose
from support.ros import LATCHED, RosPeer


class RclpyNav2:
    """Runs one goal at a time, and ends it when :meth:`end` is called."""

    def __init__(self, peer: RosPeer, action: Action = Action.TO_POSE) -> None:
        self._peer = peer
        self._types = action_types()[action]
        self._poses = peer.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        self.by_topic = peer.subscribe(PoseStamped, "goal_pose", qos_profile_system_default)
        self.goals: list[Any] = []
        self.accepts = True
        self._end: Future = Future()
        self._server = ActionServer(
            peer.node,
            self._types,
            str(action),
            self._execute,
            goal_callback=self._on_goal,
            cancel_callback=lambda _handle: CancelResponse.ACCEPT,
        )
        self.pose(0.0)

    def pose(self, x: float) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.header.stamp.sec = int(x * 100) + 1
        message.pose.pose = pose_message(Pose(x, 0.0, 0.0))
        self._poses.publish(message)

    def end(self, error_code: int = 0, error_msg: str = "") -> None:
        """End the goal: SUCCEEDED without a code, else ABORTED; CANCELED if that was requested."""
        # In the thread of the server, which would sleep on otherwise.
        self._peer._executor.create_task(lambda: self._end.set_result((error_code, error_msg)))

    def close(self) -> None:
        """Leave the graph; rclpy's node would not destroy its action servers."""
        self._server.destroy()

    def _on_goal(self, goal: Any) -> Any:
        self.goals.append(goal)
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    async def _execute(self, handle: Any) -> Any:
        feedback = self._types.Feedback()
        feedback.current_pose.header.frame_id = "map"
        feedback.current_pose.pose = pose_message(Pose(1.5, 0.0, 0.0))
        feedback.distance_remaining = 3.5
        feedback.number_of_recoveries = 2
        handle.publish_feedback(feedback)
        code, text = await self._end
        self._end = Future()
        if handle.is_cancel_requested:
            handle.canceled()
        elif code:
            handle.abort()
        else:
            handle.succeed()
        return self._types.Result(error_code=code, error_msg=text)
