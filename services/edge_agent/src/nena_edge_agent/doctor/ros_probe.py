"""Observe the robot through a separate ROS node for some seconds."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from std_srvs.srv import Empty, Trigger

from nena_edge_agent.doctor.navigation import Grid, RosView
from nena_edge_agent.nav2 import messages
from nena_edge_agent.nav2.keep_out import misplaced_filter, unused_mask
from nena_edge_agent.nav2.offers import FOLLOW_PATH, interface
from nena_edge_agent.nav2.parameters import ParameterReader
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.presence import Lifecycle
from nena_edge_agent.nav2.session import LATCHED, RELIABLE, SENSOR, RosSession
from nena_edge_agent.nav2.settings import RosSettings, status_of

LOOK_FOR = 5.0
"""Time after which everything not seen counts as missing, seconds; discovery takes up to 3 s."""

LOOK_ELSEWHERE = 3.0
"""Time for observing another domain, seconds."""

POSE_WAIT = 2.0
"""Timeout for a requested pose, seconds."""


async def observe_robot(settings: RosSettings) -> RosView:
    """Observe the robot; if its domain has no nodes, check other likely domains.

    Raises:
        SessionError: the ROS session cannot be started.
    """
    probe = _Probe(settings)
    async with probe.running():
        view = await probe.observe()
    if view.nodes:
        return view
    # A robot whose domain is not set runs in 0, or in that of the shell from which it was started.
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    # Fast DDS ends the whole process for a larger domain ID (measured, 2.14).
    domain_of_shell = int(text) if text.isdecimal() and int(text) <= 232 else 0  # noqa: PLR2004 - ROS's maximum
    busy_domains = []
    for domain_id in sorted({0, domain_of_shell} - {settings.domain_id}):
        probe = _Probe(settings.model_copy(update={"domain_id": domain_id}))
        async with probe.running():
            if await probe.sees_nodes(LOOK_ELSEWHERE):
                busy_domains.append(domain_id)
    return RosView(busy_domains=tuple(busy_domains))


class _Probe:
    """The doctor's node. It subscribes to the same topics as the agent's node, and sends no goals."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings = settings
        self._own = {settings.node_name, f"{settings.node_name}_doctor"}
        self._session = RosSession(
            node_name=f"{settings.node_name}_doctor",
            namespace=settings.namespace,
            domain_id=settings.domain_id,
        )
        self._parameters = ParameterReader(settings)
        self._pose: PoseReading | None = None
        self._grid: Grid | None = None
        self._clock_offset: float | None = None

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Join the ROS graph for the duration of the block; raises like :func:`look`."""
        await self._session.start(self._create_subscriptions)
        try:
            yield
        finally:
            await self._session.stop()

    async def sees_nodes(self, seconds: float) -> bool:
        """Wait up to ``seconds`` for other nodes; return whether there are any."""
        return await _wait_until(lambda: bool(self._node_names()), seconds)

    async def observe(self) -> RosView:
        """Observe until everything is seen or the time is over, and return the result."""
        await _wait_until(self._is_complete, LOOK_FOR)
        if self._pose is None:
            # AMCL sends none while the robot stands, unless asked for a no-motion update.
            await self._session.call(self._fresh_pose, Empty.Request(), seconds=self._settings.call_timeout)
            await _wait_until(lambda: self._pose is not None, POSE_WAIT)
        parameters = await self._parameters.read()
        return RosView(
            nodes=self._node_names(),
            servers=self._count_servers(),
            elsewhere=self._statuses_elsewhere(),
            goal_listeners=self._goals.get_subscription_count(),
            lifecycle=await self._lifecycle_state(),
            pose=self._pose,
            grid=self._grid,
            tolerance=parameters.xy_tolerance,
            theta_tolerance=parameters.yaw_tolerance,
            server_timeout=parameters.server_timeout,
            path_types=interface(FOLLOW_PATH) is not None,
            path_servers=self._path_servers(),
            collision_monitor=self._node.count_publishers(self._settings.names.collision_monitor) > 0,
            unused_mask=self._unused_mask(),
            clock_offset=self._clock_offset,
        )

    def _is_complete(self) -> bool:
        seen = (self._pose, self._grid, self._clock_offset)
        ready = self._lifecycle.service_is_ready() and self._goals.get_subscription_count()
        paths = self._path_servers() or not self._settings.nav2.follow_path
        zones = not self._unused_mask()
        return (
            bool(self._node_names() and self._count_servers() and ready and paths and zones)
            and None not in seen
        )

    def _node_names(self) -> tuple[str, ...]:
        names = self._node.get_node_names_and_namespaces()
        return tuple(
            sorted(
                f"{space.rstrip('/')}/{name}"
                for name, space in names
                # Hidden nodes, such as that of the ros2 command, are no robot.
                if not name.startswith("_") and name not in self._own
            )
        )

    def _count_servers(self) -> int:
        return len(self._node.get_publishers_info_by_topic(self._settings.names.status))

    def _path_servers(self) -> int:
        return len(self._node.get_publishers_info_by_topic(status_of(self._settings.names.follow_path)))

    def _unused_mask(self) -> str:
        """Return why nobody uses the keep-out mask, if the agent publishes it or a costmap waits for it."""
        names = self._settings.names
        published = self._node.count_publishers(self._node.resolve_topic_name(names.zone_filter_info))
        if not self._settings.nav2.keep_out or not (published or misplaced_filter(self._node, names)):
            return ""
        return unused_mask(self._node, names, *self._own)

    def _statuses_elsewhere(self) -> tuple[str, ...]:
        # A Nav2 in another namespace is the usual reason for one that is "missing".
        end = "/" + self._settings.names.status.removeprefix("/")
        here = self._node.resolve_topic_name(self._settings.names.status)
        topics = [name for name, _ in self._node.get_topic_names_and_types()]
        others = [name for name in topics if name.endswith(end) and name != here]
        return tuple(
            sorted(name.removesuffix(end) or "/" for name in others if self._node.count_publishers(name))
        )

    async def _lifecycle_state(self) -> Lifecycle:
        if not self._lifecycle.service_is_ready():
            return Lifecycle.ABSENT
        # During bring-up is_active exists and does not answer (Jazzy, 1.3): silence is no absence.
        answer = await self._session.call(
            self._lifecycle, Trigger.Request(), seconds=2 * self._settings.call_timeout
        )
        if answer is None:
            return Lifecycle.SILENT
        return Lifecycle.ACTIVE if answer.success else Lifecycle.INACTIVE

    def _create_subscriptions(self, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        names, subscribe = self._settings.names, self._session.subscribe
        self._node = node
        self._parameters.enter(self._session, node)
        self._goals = node.create_publisher(PoseStamped, names.goal_pose, RELIABLE)
        self._lifecycle = node.create_client(Trigger, names.lifecycle)
        self._fresh_pose = node.create_client(Empty, names.fresh_pose)
        # AMCL latches its pose and is silent at rest, other localisers publish best effort: a latched
        # subscription gets nothing from those, and SENSOR never gets a latched message.
        for qos in (LATCHED, SENSOR):
            subscribe(
                node,
                PoseWithCovarianceStamped,
                names.pose,
                qos,
                read=messages.pose_reading,
                handle=partial(setattr, self, "_pose"),
            )
        # Robots of a fleet often share one map outside their namespaces.
        for topic in {node.resolve_topic_name("map"), "/map"}:
            subscribe(
                node, OccupancyGrid, topic, LATCHED, read=_read_grid, handle=partial(setattr, self, "_grid")
            )
        subscribe(
            node,
            Odometry,
            names.odometry,
            SENSOR,
            read=_read_clock_offset,
            handle=partial(setattr, self, "_clock_offset"),
        )


def _read_grid(message: Any) -> Grid:  # noqa: ANN401 - rclpy carries no types
    """Read a nav_msgs/OccupancyGrid."""
    info = message.info
    corner = info.origin.position
    return Grid(
        message.header.frame_id,
        corner.x,
        corner.y,
        info.width * info.resolution,
        info.height * info.resolution,
    )


def _read_clock_offset(message: Any) -> float:  # noqa: ANN401
    """Return how far the stamp of a nav_msgs/Odometry is ahead of the current time, s."""
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec / messages.NANOSECONDS - time.time())


async def _wait_until(condition: Callable[[], bool], seconds: float) -> bool:
    """Wait up to ``seconds`` for ``condition``; return whether it holds."""
    for _ in range(int(seconds / 0.05)):
        if condition():
            return True
        await asyncio.sleep(0.05)
    return condition()
