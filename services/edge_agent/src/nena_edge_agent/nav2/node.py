"""The agent's node: Nav2, the localisation and the robot's base as topics and services.

All names are relative unless the settings say otherwise, so that the namespace applies. Readings are
passed as plain data to the event loop, and messages are sent from there.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import BatteryState
from std_srvs.srv import Empty, Trigger

from nena_edge_agent.driver.port import Pose, SessionState
from nena_edge_agent.nav2 import action_client, messages
from nena_edge_agent.nav2.action_client import ActionClient, ActionHandlers
from nena_edge_agent.nav2.commands import Server
from nena_edge_agent.nav2.goals import GoalEntry
from nena_edge_agent.nav2.offers import FOLLOW_PATH, interface
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.presence import LifecycleWatch, Presence, endpoints
from nena_edge_agent.nav2.robot_base import BatteryReading
from nena_edge_agent.nav2.session import LATCHED, NO_EVENTS, RELIABLE, SENSOR, RosSession
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.nav2.settings import RosSettings, status_of


class Nav2Node:
    """The node for Nav2; call :meth:`start` first and :meth:`stop` last."""

    def __init__(
        self,
        settings: RosSettings,
        extensions: Sequence[NodeExtension] = (),
        *,
        actions: Mapping[Server, ActionHandlers],
        on_other_statuses: Callable[[list[GoalEntry]], None],
        on_pose: Callable[[PoseReading], None],
        on_velocity: Callable[[tuple[float, float]], None],
        on_battery: Callable[[BatteryReading], None],
        on_plan: Callable[[tuple[str, tuple[tuple[float, float], ...]]], None],
    ) -> None:
        """Prepare the node, in the event loop that it will work for, in which it calls the handlers.

        ``actions`` are those of the servers that drive for us.
        """
        self._extensions = extensions
        self._settings = settings
        names = {
            Server.NAVIGATOR: (settings.action, action_client.action_type(settings.navigation)),
            Server.CONTROLLER: (settings.names.follow_path, interface(FOLLOW_PATH)),
        }
        self.clients = {
            server: ActionClient(settings, *names[server], handlers) for server, handlers in actions.items()
        }
        self._on_other_statuses = on_other_statuses
        self._on_pose, self._on_velocity = on_pose, on_velocity
        self._on_battery, self._on_plan = on_battery, on_plan
        self._lifecycle_watch, self._localiser_watch = LifecycleWatch(), LifecycleWatch()
        self._volatile_poses = False
        self._session = RosSession(
            node_name=settings.node_name, namespace=settings.namespace, domain_id=settings.domain_id
        )

    async def start(self, on_failure: Callable[[str], None]) -> None:
        """Join the ROS graph; ``on_failure`` is called if the node leaves it unexpectedly.

        Raises:
            SessionError: ROS refuses.
        """
        await self._session.start(self._create_endpoints, on_failure=on_failure)

    async def stop(self) -> None:
        """Leave the ROS graph."""
        await self._session.stop()

    def publish_goal(self, pose: Pose) -> None:
        """Publish a goal; the status array shows whether it is accepted."""
        self._goals.publish(messages.goal_message(pose, self._settings.frame))

    def publish_initial_pose(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation."""
        spread = self._settings.localisation
        message = messages.initial_pose_message(
            pose,
            self._settings.frame,
            xy_variance=spread.initial_xy_variance,
            theta_variance=spread.initial_theta_variance,
        )
        self._initial_poses.publish(message)

    async def stop_motion(self) -> bool:
        """Cancel all goals of servers that move the robot; return whether the controller answered."""
        request, seconds = CancelGoal.Request(), self._settings.call_timeout
        # Zero ID and zero stamp cancel all goals, also those of a navigator that has died (CancelGoal.srv).
        answered, *_ = await asyncio.gather(
            self._call_service(self._controller, request),
            *(client.call(request, seconds=seconds) for client in self._motions),
        )
        return answered is not None

    def prepare_stop(self) -> None:
        """Discover the servers that may move the robot, so that a stop need not wait for discovery."""
        for client in self._motions:
            client.prepare()

    async def request_pose(self) -> bool:
        """Make the localisation send a pose at standstill; return whether it accepted the request."""
        seconds = self._settings.call_timeout
        return await self._fresh_pose.call(Empty.Request(), seconds=seconds) is not None

    async def presence(self) -> Presence | None:
        """Return what the ROS graph shows of Nav2; takes at most the timeout of one call.

        None if the session ends meanwhile.
        """
        there, localiser = self._lifecycle.service_is_ready(), self._localiser.service_is_ready()
        # is_active exists during the bring-up of Nav2, and does not answer.
        active, state = await asyncio.gather(
            self._call_service(self._lifecycle, Trigger.Request()),
            self._call_service(self._localiser, GetState.Request()),
        )
        if self._session.state is not SessionState.ACTIVE:
            return None
        self._subscribe_to_volatile_poses()
        return Presence(
            servers=self.clients[Server.NAVIGATOR].server_ids(),
            goal_listeners=self._goals.get_subscription_count(),
            lifecycle=self._lifecycle_watch.update(
                there=there, active=None if active is None else bool(active.success)
            ),
            localisers=endpoints(self._node.get_publishers_info_by_topic(self._settings.names.pose)),
            localiser=self._localiser_watch.update(
                there=localiser,
                active=None if state is None else state.current_state.id == State.PRIMARY_STATE_ACTIVE,
            ),
        )

    def planners(self) -> frozenset[str]:
        """Return the endpoint IDs of the planner's publishers; those of other nodes may come and go."""
        names = self._settings.names
        publishers = self._node.get_publishers_info_by_topic(names.plan)
        return endpoints(publishers, node_name=names.planner.rpartition("/")[2])

    async def _call_service(self, client: Any, request: Any) -> Any:  # noqa: ANN401 - rclpy carries no types
        return await self._session.call(client, request, seconds=self._settings.call_timeout)

    def _create_endpoints(self, node: Any) -> None:  # noqa: ANN401
        names, session, subscribe = self._settings.names, self._session, self._session.subscribe
        self._node = node
        # Reliable matches bt_navigator's system default, which Fast DDS makes best effort, and Lyrical's
        # reliable one.
        publish = partial(node.create_publisher, qos_profile=RELIABLE, event_callbacks=NO_EVENTS)
        self._goals = publish(PoseStamped, names.goal_pose)
        self._initial_poses = publish(PoseWithCovarianceStamped, names.initial_pose)
        # Each client delays the start; the others are created with the first goal that may need a stop.
        controller, *others = (f"{action}/_action/cancel_goal" for action in names.motions)
        self._controller = node.create_client(CancelGoal, controller)
        self._motions = [session.late_client(node, CancelGoal, name) for name in others]
        self._fresh_pose = session.late_client(node, Empty, names.fresh_pose)
        self._lifecycle = node.create_client(Trigger, names.lifecycle)
        self._localiser = node.create_client(GetState, names.localiser)
        subscribe(
            node,
            GoalStatusArray,
            status_of(self._settings.other_action),
            LATCHED,
            read=messages.status_entries,
            handle=self._on_other_statuses,
        )
        # AMCL latches its pose: at rest a late subscriber gets it only if it is reliable and transient
        # local.
        self._subscribe_to_pose(LATCHED)
        subscribe(node, Odometry, names.odometry, SENSOR, read=messages.velocity, handle=self._on_velocity)
        subscribe(node, Path, names.plan, RELIABLE, read=messages.plan_points, handle=self._on_plan)
        subscribe(
            node, BatteryState, names.battery, SENSOR, read=messages.battery_reading, handle=self._on_battery
        )
        for extension in (*self.clients.values(), *self._extensions):
            extension.enter(session, node)

    def _subscribe_to_volatile_poses(self) -> None:
        """Add a volatile subscription when needed.

        With both from the start, each pose of AMCL would arrive twice.
        """
        publishers = self._node.get_publishers_info_by_topic(self._settings.names.pose)
        # SLAM and other localisers publish volatile, which a latched subscription does not match.
        latches = (
            publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for publisher in publishers
        )
        if not self._volatile_poses and not all(latches):
            self._volatile_poses = True
            self._subscribe_to_pose(SENSOR)

    def _subscribe_to_pose(self, qos: QoSProfile) -> None:
        self._session.subscribe(
            self._node,
            PoseWithCovarianceStamped,
            self._settings.names.pose,
            qos,
            read=messages.pose_reading,
            handle=self._on_pose,
        )
