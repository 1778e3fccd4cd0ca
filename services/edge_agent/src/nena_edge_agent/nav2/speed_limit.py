"""Speed limits for Nav2's controller, sent by topic (nav2_msgs/SpeedLimit)."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any

from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure, DriverEvent, Halted, SessionState
from nena_edge_agent.nav2.offers import SPEED_LIMIT, interface
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

NO_LIMIT = 0.0
"""Value that withdraws a limit."""
SLOWEST = 0.01
"""Lowest limit that is sent, m/s; 0 would withdraw it."""
REPEATED_AFTER = 0.3
"""Interval at which a current limit is resent while the robot drives, seconds."""


class SpeedLimiter:
    """Sends the lower one of two limits to the controller: that of the goal, and that of the position.

    A limit above the controller's own speed would become its speed, so it is not sent. The topic is not
    latched, so the limit is sent to each controller that appears. A current limit is repeated, because MPPI
    drops it whenever it resets itself: after idling, in its fallback, and at the end of a goal. After a
    restart of the agent, nothing is sent while Nav2 may still drive to a goal of the earlier run, whose limit
    is known only with the next goal.
    """

    def __init__(self, topic: str, own_speed: float) -> None:
        """Prepare; ``own_speed`` is the controller's own, m/s."""
        self._topic = topic
        self._own_speed = own_speed
        self._of_goal: float | None = None
        self._of_place: float | None = None
        self._reclaimed = False
        self._listeners: frozenset[bytes] = frozenset()
        self._sent: float | None = None
        self._logged = NO_LIMIT
        self._repeated_at = -inf
        self._session: RosSession | None = None
        self._node: Any = None
        self._publisher: Any = None
        self._kind: Any = None

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Publish on a new node."""
        from nena_edge_agent.nav2.session import NO_EVENTS, RELIABLE  # noqa: PLC0415 - needs rclpy

        kind = interface(SPEED_LIMIT)
        self._publisher = node.create_publisher(kind, self._topic, RELIABLE, event_callbacks=NO_EVENTS)
        self._session, self._node, self._kind = session, node, kind
        # The subscriptions of the previous node say nothing about who has heard this publisher.
        self._listeners, self._sent = frozenset(), None

    def controller_drives(self, speed: float) -> None:
        """Record the controller's own speed from its parameters, m/s: a higher limit would make it faster."""
        if speed != self._own_speed:
            log.warning(
                "the controller's speed differs from description.maximum_speed: set the latter to it",
                controller=speed,
                noted=self._own_speed,
            )
            self._own_speed = speed
            self._send_limit()

    @property
    def limit(self) -> float:
        """Return the current limit, m/s; 0: none."""
        limits = (limit for limit in (self._of_goal, self._of_place) if limit is not None)
        # in this order, NaN becomes the lowest limit as well; with a negative one, the robot would reverse
        lowest = min((max(SLOWEST, limit) for limit in limits), default=self._own_speed)
        return NO_LIMIT if lowest >= self._own_speed else lowest

    def reclaim(self) -> None:
        """Keep the limit until the next goal or the end of all goals."""
        self._reclaimed = True

    def problem(self, goal_limit: float | None) -> str:
        """Return why the robot would be too fast for a goal with this limit; empty if it would not."""
        too_fast = goal_limit is not None and goal_limit < self._own_speed
        if not too_fast or self.listened:
            return ""
        return (
            f"no node subscribes to {self._topic}, and the next goal has a limit of {goal_limit:g} m/s: "
            "is controller_server running?"
        )

    def limit_goal(self, limit: float | None) -> None:
        """Set the limit of the current goal, m/s; None: no limit."""
        self._of_goal, self._reclaimed = limit, False
        self._repeat_limit()

    def on_event(self, event: DriverEvent) -> None:
        """End the goal's limit if the robot no longer drives to a goal of ours."""
        if isinstance(event, DriveFailed):
            # after these, the controller may drive on to the previous goal
            ends = event.failure not in (DriveFailure.NAVIGATION_GONE, DriveFailure.NOT_TAKEN_UP)
        else:
            ends = isinstance(event, Arrived | Halted)
        if ends:
            self.limit_goal(None)

    def limit_place(self, limit: float | None) -> None:
        """Set the limit at the robot's current or next position, m/s; None: no limit."""
        self._of_place = limit
        self._send_limit()

    def check_controllers(self) -> None:
        """Send the limit to a controller that has appeared since the last check, and repeat a current one."""
        if self._session is None or not self._is_active:
            return
        subscriptions = self._node.get_subscriptions_info_by_topic(self._topic)
        listeners = frozenset(bytes(subscription.endpoint_gid) for subscription in subscriptions)
        # A restarted controller has no limit: controller_server only passes messages on to its plug-ins, and
        # subscribes without durability (nav2_controller).
        if listeners - self._listeners:
            self._sent = None
        self._listeners = listeners
        self._repeat_limit()

    def repeat_while_driving(self, now: float) -> None:
        """Repeat a current limit while the robot drives; ``now`` is the monotonic time in s."""
        if now - self._repeated_at >= REPEATED_AFTER:
            self._repeated_at = now
            self._repeat_limit()

    @property
    def _is_active(self) -> bool:
        return self._session is not None and self._session.state is SessionState.ACTIVE

    @property
    def listened(self) -> bool:
        """Return whether a controller accepts limits."""
        return self._is_active and self._publisher.get_subscription_count() > 0

    def _repeat_limit(self) -> None:
        if self.limit != NO_LIMIT:
            self._sent = None
        self._send_limit()

    def _send_limit(self) -> None:
        limit = self.limit
        if self._reclaimed or limit == self._sent or not self.listened:
            return
        self._sent = limit
        message = self._kind()
        # Seen in RPP: above the own speed the robot drives faster, and at negative values backward.
        message.percentage, message.speed_limit = False, float(limit)
        self._publisher.publish(message)
        if limit != self._logged:
            self._logged = limit
            log.info("speed limit", limit=limit or None)
