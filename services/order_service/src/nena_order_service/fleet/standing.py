"""Where a robot stands, in the words of the plant model."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from nena_order_service.fleet.profile import RobotProfile
from nena_shared.plant import PlantModel, Point
from nena_shared.vda5050.state import MobileRobotPosition, State


@dataclass(frozen=True, slots=True)
class Standing:
    """Where routes of a robot begin.

    ``point`` is the point that it stands on or, where ``on_point`` is False, the one that is nearest.
    ``pose`` is the robot's own, in m and rad of its map; None where it reports none that can be trusted.
    """

    point: str
    on_point: bool
    pose: MobileRobotPosition | None


class NotLocatedError(Exception):
    """Nobody knows where on the plant the robot is; ``reason`` says why and what to do, in words."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def locate(plant: PlantModel, state: State, profile: RobotProfile) -> Standing:
    """Tell where the robot stands.

    It stands on a point if it is not farther away than the allowed deviation; the point that it passed last
    is tried first. A robot without a trusted pose stands where it says it passed last. Looks at every point
    of the plant unless the robot stands where it says.

    Raises:
        NotLocatedError: the robot says neither a trusted pose on its map nor a point of the plant.

    """
    last = plant.points_by_name.get(state.last_node_id)
    pose = state.mobile_robot_position
    if pose is None or not pose.localized:
        if last is None:
            raise NotLocatedError("it reports neither a trusted pose nor a known point: set its initial pose")
        return Standing(last.name, on_point=True, pose=None)
    if pose.map_id != profile.map_id:
        reason = f"it is on map {pose.map_id!r}, orders for it are on map {profile.map_id!r}"
        raise NotLocatedError(reason)
    if last and _distance(last, pose, profile) <= profile.deviation_xy:
        return Standing(last.name, on_point=True, pose=pose)
    nearest = min(plant.points, key=lambda point: _distance(point, pose, profile), default=None)
    if nearest is None:
        raise NotLocatedError("the plant model has no points")
    return Standing(nearest.name, _distance(nearest, pose, profile) <= profile.deviation_xy, pose)


def _distance(point: Point, pose: MobileRobotPosition, profile: RobotProfile) -> float:
    """Give the distance in metres of the plant."""
    x, y = profile.transform.to_plant(pose.x, pose.y)
    return hypot(point.x_m - x, point.y_m - y)
