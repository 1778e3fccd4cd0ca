"""Operating modes: a person takes the robot over, and gives it back (section 6.6.6)."""

from __future__ import annotations

from nena_edge_agent.protocol.clearing import Clearing
from nena_edge_agent.protocol.events import OperatingModeSwitched
from nena_edge_agent.protocol.geometry import in_place
from nena_edge_agent.protocol.parts import RobotParts


class ModeSwitch:
    """Changes the mode at once, or when the order is cleared if the new mode has no place for one."""

    def __init__(self, parts: RobotParts, clearing: Clearing) -> None:
        self._parts = parts
        self._clearing = clearing

    def switch(self, event: OperatingModeSwitched) -> None:
        """Begin to change the mode; from now on the new mode decides what fleet control may send."""
        parts = self._parts
        if event.mode is parts.coming_mode:
            return
        parts.wanted_mode = event.mode
        if event.mode.clears_order:
            self._clearing.begin()
        if not event.mode.fleet_controls:
            parts.progress.leave_node()  # a person may move the robot, and no driver tells of it
        self.advance()

    def advance(self) -> None:
        """Show the new mode once no order is cleared for it, and forget the node that the robot left."""
        parts = self._parts
        if parts.wanted_mode and not parts.clearing:
            parts.operating_mode, parts.wanted_mode = parts.wanted_mode, None
            if parts.operating_mode in parts.capabilities.rules.node_forgotten_in:
                parts.progress.place_at("")
        if parts.operating_mode in parts.capabilities.rules.node_left_in and self._left_node():
            parts.progress.place_at("")

    def _left_node(self) -> bool:
        """Tell whether the node reached last cannot be the start of an order where the robot is now."""
        parts = self._parts
        if not parts.progress.last_node_id:
            return False
        node, pose = parts.progress.last_node, parts.senses.trusted_pose
        if node is None or node.node_position is None:
            return True
        return pose is not None and not in_place(
            pose, node.node_position, parts.capabilities.default_deviation_xy
        )
