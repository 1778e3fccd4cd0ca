"""Who has topics and services of its own on the agent's node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from nena_edge_agent.ros.session import RosSession


class NodeGuest(Protocol):
    """Comes to every node that the agent makes; its session says whether that is still there."""

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Furnish a new node, in the ROS thread, before its callbacks run."""
        ...
