"""initializePosition (initPosition in 2.x): the robot is told where it is (section 6.2.3)."""

from __future__ import annotations

from math import pi

from nena_edge_agent.driver.port import Pose, PositionInitialized
from nena_edge_agent.protocol.declaration import INITIALIZE_POSITION
from nena_edge_agent.protocol.events import SetPosition
from nena_edge_agent.protocol.order_acceptance import listed
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus

PATIENCE = 30.0
"""Seconds that the localisation has to take over a position."""


class PositionSetting:
    """Hands a position to the localisation, one at a time, and notes the node that came with it."""

    def __init__(self, parts: RobotParts) -> None:
        self._parts = parts
        self._node_id = ""
        self._asked_at: float | None = None

    @property
    def waits(self) -> bool:
        """Whether the localisation has not answered."""
        return self._asked_at is not None

    def request(self, action: Action) -> None:
        """Begin, unless that would contradict what the robot is doing."""
        problem = self._problem(action)
        if problem:
            self._parts.instants.change(action.action_id, ActionStatus.FAILED, problem)
            return
        self._parts.instants.change(action.action_id, ActionStatus.RUNNING)
        self._node_id = _text(action, "lastNodeId")
        self._asked_at = self._parts.now
        self._parts.effects.append(SetPosition(_pose(action)))

    def answered(self, answer: PositionInitialized) -> None:
        """Finish with the localisation's answer."""
        parts = self._parts
        if self._asked_at is None:
            return
        self._asked_at = None
        if not answer.succeeded:
            parts.end_instants(INITIALIZE_POSITION, ActionStatus.FAILED, answer.description)
            return
        if self._node_id != parts.progress.last_node_id or parts.idle:
            parts.progress.place_at(self._node_id)
        parts.end_instants(INITIALIZE_POSITION, ActionStatus.FINISHED)

    def interrupted(self) -> None:
        """Fail what the agent's restart has interrupted."""
        text = "the agent was interrupted before the localisation answered"
        self._parts.end_instants(INITIALIZE_POSITION, ActionStatus.FAILED, text)

    def advance(self) -> None:
        """Fail when the localisation takes too long."""
        if self._asked_at is not None and self._parts.now - self._asked_at >= PATIENCE:
            self._asked_at = None
            text = f"the localisation has not answered in {PATIENCE:.0f} s"
            self._parts.end_instants(INITIALIZE_POSITION, ActionStatus.FAILED, text)

    def _problem(self, action: Action) -> str | None:
        parts = self._parts
        node_id, map_id = _text(action, "lastNodeId"), _text(action, "mapId")
        if map_id not in parts.map_ids:
            return f"the robot has {listed(parts.map_ids)}, not '{map_id}'"
        if abs(_number(action, "theta")) > pi + 1e-6:
            return "theta must be within -π and π"
        if parts.goal.moving:
            return "the robot drives; pause it or cancel its order first"
        if not parts.idle and node_id != parts.progress.last_node_id:
            return f"an order is active at node '{parts.progress.last_node_id}'; cancel it first"
        if len(parts.instants_running(INITIALIZE_POSITION)) > 1:
            return "another position is being set"
        return None


def _pose(action: Action) -> Pose:
    return Pose(_number(action, "x"), _number(action, "y"), _number(action, "theta"), _text(action, "mapId"))


def _number(action: Action, key: str) -> float:
    value = action.parameter(key)
    return float(value) if isinstance(value, int | float) else 0.0


def _text(action: Action, key: str) -> str:
    value = action.parameter(key)
    return value if isinstance(value, str) else ""
