"""Ids of goals that this agent gives itself: whoever reads one sees whose it is, journal or no journal."""

from __future__ import annotations

import hashlib
import secrets

LENGTH = 8
"""Bytes of an id, of 16, that are the same in all ids of an agent; the others are drawn by lot."""


class GoalMark:
    """The mark of the agent whose ROS node has the name ``node_name``; ids are hexadecimal digits."""

    def __init__(self, node_name: str) -> None:
        self._mark = hashlib.sha256(f"nena {node_name}".encode()).digest()[:LENGTH].hex()

    def new(self) -> str:
        """Draw an id that no goal has had."""
        return self._mark + secrets.token_hex(16 - LENGTH)

    def bears(self, goal_id: str) -> bool:
        """Tell whether a goal is one of this agent, of this run or an earlier one."""
        return goal_id.startswith(self._mark)
