"""An honest robot that takes time to drive, and whose body is on points and paths of a plant."""

from __future__ import annotations

from dataclasses import dataclass, field

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.plant import PlantModel
from nena_shared.plant.model import BlockType
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.order import Edge

SPEED_MM_S = 1000.0

CHARGE_RATE = 0.5
"""Percent per second."""


@dataclass
class DrivingRobot(HonestRobot):
    """Drives one edge at a time, and stops for a cancel at the next node.

    ``body`` names the points and paths that it is really on, oldest first.
    """

    plant: PlantModel = field(default_factory=lambda: PlantModel(name="none"))
    length_mm: int = 0
    body: list[str] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    driving: bool = False
    cancelling: Action | None = None
    drain: float = 0.0
    """Percent of charge that 1 m takes."""
    progress: int = 0
    """Counts what it has done."""

    def put_on(self, point: str) -> None:
        """Place it on a point."""
        place = self.plant.point(point)
        self.position = (place.x_m, place.y_m, 0.0)
        self.last_node_id, self.body, self.lengths = point, [point], [0.0]

    def depart(self) -> float | None:
        """Start the next edge, if it may; return the seconds until it arrives."""
        if self.driving or not self.nodes or not self.nodes[0].released:
            return None
        self.driving, self.charging = True, False
        path = self.plant.paths_by_name.get(_path_of(self.edges[0]))
        if path is None:
            return 1.0  # it turns where it stands
        self._cover(path.name, float(path.length_mm))
        self.charge = max(0.0, self.charge - self.drain * path.length_mm / 1000)
        return path.length_mm / SPEED_MM_S

    def recharge(self, seconds: float) -> None:
        """Advance the time, during which it may be at a charger."""
        if self.charging:
            self.charge = min(100.0, self.charge + seconds * CHARGE_RATE)

    def arrive(self) -> None:
        """Arrive at the end of the edge."""
        self.driving = False
        self.progress += 1
        node = self.nodes[0]
        if self.body[-1] != node.node_id and node.node_id in self.plant.points_by_name:
            self._cover(node.node_id, 0.0)
        self._drive(node)
        if self.cancelling:
            self.instants[self.cancelling.action_id] = (self.cancelling, ActionStatus.FINISHED)
            self.cancelling = None
            self._clear()

    def begins_action(self) -> bool:
        """Begin the next action, if it is time for one."""
        if self.nodes or self.driving:
            return False
        waiting = [each for each in self.actions if self.statuses[each.action_id] is ActionStatus.WAITING]
        if not waiting:
            return False
        self.statuses[waiting[0].action_id] = ActionStatus.RUNNING
        self.executed.append(waiting[0].action_id)
        return True

    def end_actions(self) -> None:
        """End the actions that run; a cancel may have ended them before."""
        for action in self.actions:
            if self.statuses[action.action_id] is ActionStatus.RUNNING:
                self.progress += 1
                self.charging = action.action_type == "startCharging"
                self._end(action)

    def resources(self) -> set[str]:
        """Name the points, paths and blocks for one vehicle that its body is on."""
        on = set(self.body)
        single = (each for each in self.plant.blocks if each.type is BlockType.SINGLE_VEHICLE_ONLY)
        return on | {block.name for block in single if on.intersection(block.members)}

    def _run_instant(self, action: Action) -> ActionStatus:
        if action.action_type == "stateRequest":
            return ActionStatus.FINISHED
        if action.action_type == "cancelOrder" and self.driving:
            self.cancelling = action
            return ActionStatus.RUNNING
        return super()._run_instant(action)

    def _cover(self, place: str, length: float) -> None:
        """Move its front to ``place``, and its tail after it."""
        self.body.append(place)
        self.lengths.append(length)
        beginning = length  # of a path that is driven now, none lies behind yet
        while len(self.body) > 1 and sum(self.lengths[1:]) - beginning >= self.length_mm:
            del self.body[0], self.lengths[0]


def _path_of(edge: Edge) -> str:
    return edge.edge_id.removesuffix(":backward")
