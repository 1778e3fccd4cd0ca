"""Where a robot stands, in the words of the plant model."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from nena_order_service.fleet.profile import RobotProfile
from nena_order_service.fleet.reported import Position, State
from nena_shared.plant import MapPlace, PlantModel, PlantPlace, Point


@dataclass(frozen=True, slots=True)
class Standing:
    """Where routes of a robot begin.

    ``point`` is the point that it stands on or, where ``on_point`` is False, the one that is nearest.
    ``pose`` is the robot's own, in m and rad of its map; None where it reports none that can be trusted.
    """

    point: str
    on_point: bool
    pose: Position | None


class NotLocatedError(Exception):
    """Nobody knows where on the plant the robot is; ``reason`` says why and what to do, in words."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def locate(plant: PlantModel, state: State, profile: RobotProfile) -> Standing:
    """Tell where the robot stands.

    It stands on a point if it is not farther away than the allowed deviation; the point that it passed last
    is tried first. A robot without a trusted pose stands where it says it passed last.

    Raises:
        NotLocatedError: the robot says neither a trusted pose on its map nor a point of the plant.

    """
    last = plant.points_by_name.get(state.last_node_id)
    pose = state.mobile_robot_position
    if pose is None or not pose.localized:
        if last is None:
            raise NotLocatedError("it reports neither a trusted pose nor a known point: set its initial pose")
        return Standing(last.name, on_point=True, pose=None)
    if not profile.knows_frame(pose.map_id):
        reason = "whether it tells its place in the plant's frame is not known until its factsheet has come"
        raise NotLocatedError(reason)
    here = profile.on(pose.map_id).to_plant(MapPlace(pose.x, pose.y))
    if last and _on(last, pose, profile) and _distance(last, here) <= profile.deviation_xy:
        return Standing(last.name, on_point=True, pose=pose)
    nearest = _nearest(plant, here, pose.map_id, profile)
    if nearest is None:
        reason = f"it is on map {pose.map_id!r}, orders for it are on map {profile.map_id!r}"
        raise NotLocatedError(reason if plant.points else "the plant model has no points")
    return Standing(nearest.name, _distance(nearest, here) <= profile.deviation_xy, pose)


def _nearest(plant: PlantModel, here: PlantPlace, map_id: str, profile: RobotProfile) -> Point | None:
    """Give the nearest point of a map; those that name no map are on that of the robot."""
    maps = (map_id or None, None) if map_id == profile.map_id else (map_id,)
    indices = (plant.points_by_map.get(each) for each in dict.fromkeys(maps))
    found = (index.nearest(here.x_m, here.y_m) for index in indices if index)
    return min(filter(None, found), key=lambda point: _distance(point, here), default=None)


def _on(point: Point, pose: Position, profile: RobotProfile) -> bool:
    """Tell whether the point is on the map that the robot is on."""
    return (point.map_id or profile.map_id) == pose.map_id


def _distance(point: Point, here: PlantPlace) -> float:
    """Give the distance in metres of the plant."""
    return hypot(point.x_m - here.x_m, point.y_m - here.y_m)
