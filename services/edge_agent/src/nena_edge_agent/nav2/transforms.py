"""The robot's pose from transforms, if no localisation publishes one.

SLAM, nav2_loopback_sim and other localisers publish the transform ``map`` → ``odom`` alone; the robot's
odometry publishes ``odom`` → ``base_link`` many times a second.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nena_edge_agent.nav2.offers import TRANSFORMS, interface
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.settings import PoseSource, RosSettings
from nena_shared.log import get_logger
from nena_shared.ros import wrap, yaw_of
from nena_shared.tasks import StartError

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

LONGEST_CHAIN = 20
"""Maximum number of frames between the robot and the map."""
MOST_FRAMES = 1000
"""Number of frames beyond which outdated ones are dropped: a publisher may use new names each time."""
STEP = 0.05
"""Distance between two reported poses, m or rad."""
PERIOD = 1.0
"""Interval of reported poses at standstill, seconds."""
LOOKS = 3
"""Checks of the graph without a publisher of poses after which transforms are used."""
WAITING = 50
"""Messages that may wait for the event loop."""


@dataclass(frozen=True, slots=True)
class Transform:
    """The position of the frame ``child`` in ``parent``, in the plane: m, rad; stamp in ns."""

    parent: str
    child: str
    x: float
    y: float
    yaw: float
    stamp: int


class Chain:
    """Keeps the newest transform of each frame; times are monotonic seconds of arrival."""

    def __init__(self, top: str, bottom: str, *, timeout: float) -> None:
        """Prepare; ``top`` is the map's frame, ``bottom`` the robot's; transforms last ``timeout`` s."""
        self._top = top
        self._bottom = bottom
        self._timeout = timeout
        self._known: dict[str, tuple[Transform, float]] = {}
        self.missing = ""
        """Why there was no pose at the last check."""

    def put(self, transforms: tuple[Transform, ...], now: float) -> bool:
        """Store transforms; return whether one of them may move the robot."""
        for transform in transforms:
            self._known[transform.child] = (transform, now)
        if len(self._known) > MOST_FRAMES and math.isfinite(now):
            entries = self._known.items()
            self._known = {child: entry for child, entry in entries if now - entry[1] <= self._timeout}
        return any(
            transform.child == self._bottom or transform.parent == self._top for transform in transforms
        )

    def pose(self, now: float) -> PoseReading | None:
        """Return the robot's pose, None if a transform is missing or too old."""
        frame, x, y, yaw, stamp = self._bottom, 0.0, 0.0, 0.0, 0
        for _ in range(LONGEST_CHAIN):
            if frame == self._top:
                self.missing = ""
                return PoseReading(x, y, wrap(yaw), self._top, stamp, 0.0, 0.0, 0.0)
            transform, at = self._known.get(frame, (None, 0.0))
            if transform is None or now - at > self._timeout:
                break
            # The newest of each frame, not interpolated: AMCL dates map -> odom into the future.
            cos, sin = math.cos(transform.yaw), math.sin(transform.yaw)
            x, y = transform.x + cos * x - sin * y, transform.y + sin * x + cos * y
            yaw, stamp, frame = yaw + transform.yaw, max(stamp, transform.stamp), transform.parent
        self.missing = f"no transform from the frame {self._top} to {frame}"
        return None


def transforms_of(message: Any) -> tuple[Transform, ...]:  # noqa: ANN401 - rclpy carries no types
    """Read a tf2_msgs/TFMessage; transforms with invalid numbers are left out."""
    readings = []
    for stamped in message.transforms:
        place, turn = stamped.transform.translation, stamped.transform.rotation
        yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
        if yaw is None or not math.isfinite(place.x + place.y):
            continue
        stamp = stamped.header.stamp.sec * 1_000_000_000 + stamped.header.stamp.nanosec
        parent, child = stamped.header.frame_id.removeprefix("/"), stamped.child_frame_id.removeprefix("/")
        readings.append(Transform(parent, child, place.x, place.y, yaw, stamp))
    return tuple(readings)


class TransformWatch:
    """Reports poses from the transforms while no localisation publishes its own.

    ``on_pose`` gets each new pose. A transform missing for ``ros.transform_timeout`` makes the pose unknown.
    """

    def __init__(self, settings: RosSettings, on_pose: Callable[[PoseReading], None]) -> None:
        self._settings = settings
        self._on_pose = on_pose
        self._looks = 0
        self._subscriptions: list[Any] = []
        self._session: RosSession | None = None
        self._node: Any = None
        self._chain = self._new_chain()
        self._reported: PoseReading | None = None
        self._reported_at = -math.inf

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        """Use a new node; subscribe when needed."""
        self._session, self._node = session, node
        self._looks, self._subscriptions = 0, []
        self._chain, self._reported = self._new_chain(), None

    def check(self) -> None:
        """Check that the installation has what the settings require.

        Raises:
            StartError: poses by transforms are required, and their type cannot be loaded.
        """
        if self._settings.pose_source is PoseSource.TF and interface(TRANSFORMS) is None:
            raise StartError(
                "ros.pose_source: tf needs tf2_msgs; source the robot's ROS installation before the start"
            )

    @property
    def problem(self) -> str:
        """Return why the pose by transforms is unknown; empty if it is known, or comes from elsewhere."""
        if not self._subscriptions or self._reported is None:
            return ""
        self._chain.pose(time.monotonic())
        missing = self._chain.missing
        return missing and f"{missing} for {self._settings.transform_timeout:g} s"

    def choose_source(self) -> None:
        """Subscribe if nothing publishes poses, and unsubscribe if something does."""
        source = self._settings.pose_source
        if source is PoseSource.TOPIC or self._session is None:
            return
        topic = self._settings.names.pose
        # A localisation that publishes poses tells their covariance, which transforms do not.
        published = source is PoseSource.AUTO and self._node.count_publishers(topic) > 0
        self._looks = 0 if published else self._looks + 1
        if published and self._subscriptions:
            log.info("using poses from the topic", topic=topic)
            for subscription in self._subscriptions:
                self._node.destroy_subscription(subscription)
            self._subscriptions, self._reported = [], None
        elif not self._subscriptions and (self._looks >= LOOKS or source is PoseSource.TF):
            self._subscribe_transforms(self._session)

    def _subscribe_transforms(self, session: RosSession) -> None:
        from nena_edge_agent.nav2.session import LATCHED, SENSOR  # noqa: PLC0415 - needs rclpy

        kind, names = interface(TRANSFORMS), self._settings.names
        if kind is None:
            return
        log.info("using poses from transforms", base=self._settings.base_frame, map=self._settings.frame)
        self._subscriptions = [
            session.subscribe(self._node, kind, topic, qos, read=transforms_of, handle=handle, limit=WAITING)
            for topic, qos, handle in (
                (names.tf, SENSOR, self._on_transforms),
                (names.tf_static, LATCHED, self._on_static),
            )
        ]

    def _on_transforms(self, transforms: tuple[Transform, ...]) -> None:
        now = time.monotonic()
        # Wheels and arms share the topic: only the ends of the chain are worth a computation.
        if not self._chain.put(transforms, now):
            return
        pose = self._chain.pose(now)
        if pose is not None and (self._has_moved(pose) or now - self._reported_at >= PERIOD):
            self._reported, self._reported_at = pose, now
            self._on_pose(pose)

    def _on_static(self, transforms: tuple[Transform, ...]) -> None:
        self._chain.put(transforms, math.inf)

    def _has_moved(self, pose: PoseReading) -> bool:
        last = self._reported
        if last is None:
            return True
        return math.dist((pose.x, pose.y), (last.x, last.y)) >= STEP or abs(wrap(pose.yaw - last.yaw)) >= STEP

    def _new_chain(self) -> Chain:
        settings = self._settings
        return Chain(settings.frame, settings.base_frame, timeout=settings.transform_timeout)
