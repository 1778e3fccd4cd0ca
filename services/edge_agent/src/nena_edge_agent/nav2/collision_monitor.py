"""What Nav2's collision monitor does to the robot: it stops it without a word to the navigator."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nena_edge_agent.driver.port import CollisionReport
from nena_edge_agent.nav2.offers import COLLISION_MONITOR, interface
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

STOP = 1
"""Value of ``action_type`` while the robot is stopped; above, it is slowed down."""


class CollisionMonitor:
    """Listens to a collision monitor, which reports its state on each change."""

    def __init__(self, topic: str, tell: Callable[[CollisionReport], None]) -> None:
        self._topic = topic
        self._tell = tell

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Subscribe on a new node."""
        from nena_edge_agent.nav2.node import RELIABLE  # noqa: PLC0415 - needs rclpy

        kind = interface(COLLISION_MONITOR)
        session.subscribe(node, kind, self._topic, RELIABLE, read=report_of, handle=self._heard)

    def _heard(self, report: CollisionReport) -> None:
        log.info("collision monitor", stops=report.stops, polygon=report.polygon)
        self._tell(report)


def report_of(message: Any) -> CollisionReport:  # noqa: ANN401
    """Read a nav2_msgs/CollisionMonitorState."""
    return CollisionReport(stops=message.action_type == STOP, polygon=message.polygon_name)
