"""A client that makes the same calls as nav2_simple_commander's BasicNavigator, without its code."""

from __future__ import annotations

from typing import Any

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from nena_shared.ros import interface
from support.action_client import answer_of
from support.ros import LATCHED, Inbox, RosPeer
from support.simulator import goal, initial_pose
from support.waiting import wait_until

ALLOWANCE = Duration(sec=10)
"""Default timeout of behaviours in BasicNavigator."""
MANAGERS = 2
"""Number of Nav2's lifecycle managers."""
ATTEMPT = 1.0
"""Seconds between two attempts to set the initial pose."""

FRESH = 3
"""Feedback messages after which the server has handled every request from before the first of them."""


class SimpleCommander:
    """Sends one goal at a time, and polls until it has ended."""

    def __init__(self, peer: RosPeer, *, start: tuple[float, float] = (0.0, 0.0)) -> None:
        self._peer = peer
        self._start = start
        self._types = action_types()
        self._clients = {each: ActionClient(peer.node, self._types[each], each.value) for each in Action}
        self._poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        self._initial = peer.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
        self._handle: Any = None
        self._result: Any = None
        self.feedback: Inbox[Any] = Inbox()

    def wait_until_nav2_active(self, navigator: str = "bt_navigator", localizer: str = "amcl") -> None:
        """Wait for the localisation, publish an initial pose until it responds, wait for the navigator."""
        self._wait_for_node_to_activate(localizer)
        self._wait_for_initial_pose()
        self._wait_for_node_to_activate(navigator)

    def go_to_pose(self, x: float, y: float) -> bool:
        request = self._types[Action.TO_POSE].Goal(pose=goal(x, y))
        return self._go(Action.TO_POSE, request)

    def go_through_poses(self, *places: tuple[float, float]) -> bool:
        request = self._types[Action.THROUGH_POSES].Goal(poses=[goal(x, y) for x, y in places])
        return self._go(Action.THROUGH_POSES, request)

    def follow_path(self, *places: tuple[float, float]) -> bool:
        request = self._types[Action.FOLLOW_PATH].Goal()
        request.path.header.frame_id = "map"
        request.path.poses = [goal(x, y) for x, y in places]
        return self._go(Action.FOLLOW_PATH, request)

    def spin(self, angle: float) -> bool:
        kind: Any = interface("nav2_msgs/action/Spin")
        return self._do("spin", kind, kind.Goal(target_yaw=angle, time_allowance=ALLOWANCE))

    def backup(self, distance: float, speed: float) -> bool:
        kind: Any = interface("nav2_msgs/action/BackUp")
        request = kind.Goal(target=Point(x=distance), speed=speed, time_allowance=ALLOWANCE)
        return self._do("backup", kind, request)

    def drive_on_heading(self, distance: float, speed: float) -> bool:
        kind: Any = interface("nav2_msgs/action/DriveOnHeading")
        request = kind.Goal(target=Point(x=distance), speed=speed, time_allowance=ALLOWANCE)
        return self._do("drive_on_heading", kind, request)

    def dock(self, dock_id: str) -> bool:
        kind: Any = interface("nav2_msgs/action/DockRobot")
        return self._do("dock_robot", kind, kind.Goal(use_dock_id=True, dock_id=dock_id))

    def undock(self) -> bool:
        kind: Any = interface("nav2_msgs/action/UndockRobot")
        return self._do("undock_robot", kind, kind.Goal())

    def follow_waypoints(self, *places: tuple[float, float]) -> bool:
        kind: Any = interface("nav2_msgs/action/FollowWaypoints")
        return self._do("follow_waypoints", kind, kind.Goal(poses=[goal(x, y) for x, y in places]))

    @property
    def missed_waypoints(self) -> list[int]:
        """Return the indices of the waypoints that followWaypoints() has missed."""
        return [each.index for each in answer_of(self._result).result.missed_waypoints]

    def get_path(self, start: tuple[float, float] | None, end: tuple[float, float]) -> Any | None:
        """Plan a path from ``start``; None: from the robot's position."""
        kind: Any = interface("nav2_msgs/action/ComputePathToPose")
        request = kind.Goal(start=goal(*start or (0.0, 0.0)), goal=goal(*end), use_start=start is not None)
        return self._planned("compute_path_to_pose", kind, request)

    def get_path_through_poses(self, *places: tuple[float, float]) -> Any | None:
        kind: Any = interface("nav2_msgs/action/ComputePathThroughPoses")
        request = kind.Goal(goals=[goal(x, y) for x, y in places])
        return self._planned("compute_path_through_poses", kind, request)

    def get_costmap(self, name: str) -> Any:
        """Read the global or the local costmap."""
        kind: Any = interface("nav2_msgs/srv/GetCostmap")
        return self._peer.call(self._peer.client(kind, f"{name}/get_costmap"), kind.Request()).map

    def lifecycle_startup(self) -> list[bool]:
        """Start the servers of all lifecycle managers; return the answers, which BasicNavigator ignores."""
        return self._manage("STARTUP")

    def lifecycle_shutdown(self) -> list[bool]:
        return self._manage("SHUTDOWN")

    def _manage(self, command: str) -> list[bool]:
        kind: Any = interface("nav2_msgs/srv/ManageLifecycleNodes")
        request = kind.Request(command=getattr(kind.Request, command))

        def found() -> list[str]:
            services = self._peer.node.get_service_names_and_types()
            return [name for name, types in services if types[0] == "nav2_msgs/srv/ManageLifecycleNodes"]

        wait_until(lambda: len(found()) == MANAGERS, what="the lifecycle managers")
        return [bool(self._peer.call(self._peer.client(kind, name), request).success) for name in found()]

    def _planned(self, name: str, kind: Any, request: Any) -> Any | None:
        if not self._do(name, kind, request):
            return None
        ended = answer_of(self._result)
        return ended.result.path if ended.status == GoalStatus.STATUS_SUCCEEDED else None

    def clear_all_costmaps(self) -> None:
        kind: Any = interface("nav2_msgs/srv/ClearEntireCostmap")
        for name in ("local_costmap", "global_costmap"):
            client = self._peer.client(kind, f"{name}/clear_entirely_{name}")
            self._peer.call(client, kind.Request())

    def change_map(self, file: str) -> bool:
        kind: Any = interface("nav2_msgs/srv/LoadMap")
        client = self._peer.client(kind, "map_server/load_map")
        return bool(self._peer.call(client, kind.Request(map_url=file)).result == 0)

    def is_task_complete(self) -> bool:
        return bool(self._result is None or self._result.done())

    def wait_for_progress(self) -> None:
        """Wait for feedback that is newer than the result request, which the server has then received.

        A server that shuts down answers only requests that it has already received.
        """
        self.feedback.clear()
        wait_until(lambda: len(self.feedback.messages) >= FRESH, what="feedback")

    def cancel_task(self) -> None:
        answer_of(self._handle.cancel_goal_async())

    def result(self) -> str:
        """Return the name of the result that getResult() would return."""
        names = {
            GoalStatus.STATUS_SUCCEEDED: "SUCCEEDED",
            GoalStatus.STATUS_ABORTED: "FAILED",
            GoalStatus.STATUS_CANCELED: "CANCELED",
        }
        return names.get(answer_of(self._result).status, "UNKNOWN")

    def change_state(self, server: str, transition: int) -> bool:
        """Change a server's state, as lifecycleStartup and lifecycleShutdown do by the managers."""
        request = ChangeState.Request()
        request.transition.id = transition
        client = self._peer.client(ChangeState, f"{server}/change_state")
        return bool(self._peer.call(client, request).success)

    def _wait_for_node_to_activate(self, name: str) -> None:
        client = self._peer.client(GetState, f"{name}/get_state")
        wait_until(
            lambda: self._peer.call(client, GetState.Request()).current_state.label == "active",
            what=f"{name} active",
        )

    def _wait_for_initial_pose(self) -> None:
        while not self._poses.messages:
            self._initial.publish(initial_pose(*self._start))
            self._poses.stays_silent(ATTEMPT)

    def _do(self, name: str, kind: Any, request: Any) -> bool:
        return self._send(ActionClient(self._peer.node, kind, name), name, request)

    def _go(self, action: Action, request: Any) -> bool:
        return self._send(self._clients[action], action.value, request)

    def _send(self, client: Any, name: str, request: Any) -> bool:
        wait_until(client.server_is_ready, what=f"the server of {name}")
        self._handle = answer_of(
            client.send_goal_async(request, lambda told: self.feedback.add(told.feedback))
        )
        self._result = self._handle.get_result_async() if self._handle.accepted else None
        return bool(self._handle.accepted)
