"""Life of a ROS session, for those who must not load rclpy."""

from __future__ import annotations

from enum import StrEnum


class SessionState(StrEnum):
    """Life of a session."""

    NOT_ACTIVE = "NOT_ACTIVE"
    INITIATING = "INITIATING"
    ACTIVE = "ACTIVE"
    TERMINATING = "TERMINATING"
    FAILED = "FAILED"


class SessionError(Exception):
    """The session could not begin; ``reason`` is ROS's own."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the ROS session has failed: {reason}")
        self.reason = reason
