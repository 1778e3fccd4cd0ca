"""Locate robots in the plant: frames, deviations, and the point that a robot is on or nearest to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, pi
from typing import Final, Self

from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import MapPlace, MapTransform, PlantModel, PlantPlace, Point, Vehicle
from nena_shared.vda5050.state import MobileRobotPosition, State

R = ReasonCode

DEFAULT_DEVIATION_XY: Final = 0.5
"""Default deviation, m: enough to pass a node without stopping, and above Nav2's goal tolerance."""

DEFAULT_DEVIATION_THETA: Final = 0.35
"""Default deviation, rad (about 20 degrees): above Nav2's goal tolerance."""

IDENTITY: Final = MapTransform()
"""The transform of a map with the plant's frame."""


@dataclass(frozen=True, slots=True)
class RobotProfile:
    """Parameters of the VDA orders for one robot; ``map_id`` is the robot's map."""

    map_id: str
    deviation_xy: float = DEFAULT_DEVIATION_XY
    """Maximum distance from a node at which the robot may pass or stop, m in the plant's frame."""
    deviation_theta: float = DEFAULT_DEVIATION_THETA
    """Maximum deviation from the heading at which the robot may stop, rad."""
    corridor_width: float | None = None
    """Maximum width of corridors to each side, m in the plant's frame; None: as the layout allows."""
    transforms: Mapping[str, MapTransform] = field(default_factory=dict, hash=False)
    """Transforms from the plant's frame to maps, by map ID, for robots that use their map's frame."""
    max_distance_m: float = inf
    """Distance from the nearest point beyond which the robot's position counts as wrong."""
    transforms_itself: bool | None = None
    """Whether the robot uses the plant's frame; None: unknown until its factsheet arrives."""

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        *,
        default_map_id: str,
        transforms: Mapping[str, MapTransform],
        max_distance_m: float = inf,
    ) -> Self:
        """Read the profile from the vehicle's properties, with defaults for missing ones."""
        deviation_xy, deviation_theta = vehicle.deviation_xy_m, vehicle.deviation_theta_rad
        return cls(
            map_id=vehicle.map_id or default_map_id,
            deviation_xy=DEFAULT_DEVIATION_XY if deviation_xy is None else deviation_xy,
            deviation_theta=DEFAULT_DEVIATION_THETA if deviation_theta is None else deviation_theta,
            corridor_width=vehicle.corridor_width_m,
            transforms=transforms,
            max_distance_m=max_distance_m,
        )

    def deviation_xy_at(self, point: Point | None) -> float:
        """Return the deviation at a point, m; its own takes precedence."""
        own = point.deviation_xy_m if point else None
        return self.deviation_xy if own is None else own

    def deviation_theta_at(self, point: Point | None) -> float:
        """Return the deviation from the heading at a point, rad; its own takes precedence."""
        own = point.deviation_theta_rad if point else None
        return self.deviation_theta if own is None else min(own, pi)

    def on(self, map_id: str) -> MapTransform:
        """Return the transform from the plant's frame to that of the robot's messages."""
        return IDENTITY if self.transforms_itself else self.transforms.get(map_id, IDENTITY)

    def knows_frame(self, map_id: str) -> bool:
        """Return whether the frame of the robot's positions on a map is known."""
        return self.transforms_itself is not None or map_id not in self.transforms


@dataclass(frozen=True, slots=True)
class Standing:
    """The start of a robot's routes.

    ``point`` is the point that it is on or, if ``on_point`` is False, the nearest one. ``pose`` is its
    reported pose, m and rad; None if it reports no localised one.
    """

    point: str
    on_point: bool
    pose: MobileRobotPosition | None
    distance_m: float = field(default=0.0, compare=False)
    """Distance from the pose to the point, m."""


class NotLocatedError(Exception):
    """The robot's position in the plant is unknown; ``reason`` says why and what to do."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


class TooFarError(NotLocatedError):
    """The robot's position is too far from all points; ``last`` is the point that it has passed last."""

    def __init__(self, distance_m: float, nearest: Point, last: Point | None) -> None:
        super().__init__(Reason(R.TOO_FAR, metres=round(distance_m), point=nearest.name))
        self.last = last


GOAL_PREFIX: Final = "goal:"
"""Begins the IDs of nodes at coordinates to which orders send robots."""

LEAST_MAX_DISTANCE_M: Final = 5.0
"""Default maximum distance from the points of a plant with short paths or none, m."""


def max_distance_m(plant: PlantModel) -> float:
    """Return twice the longest path of a plant: farther from all points, no vehicle is on its way."""
    ends = plant.points_by_name
    lines = ((ends[path.source], ends[path.destination]) for path in plant.paths)
    straight = (hypot(end.x_m - start.x_m, end.y_m - start.y_m) for start, end in lines)
    longest = max((*straight, *(path.length_m for path in plant.paths)), default=0.0)
    return max(LEAST_MAX_DISTANCE_M, 2 * longest)


def locate(plant: PlantModel, state: State, profile: RobotProfile) -> Standing:
    """Return the robot's position in the plant.

    It is on a point if it is within the allowed deviation; its last node is tried first. A robot that is not
    localised counts as being at its last node.

    Raises:
        NotLocatedError: the robot reports neither a localised pose on its map nor a point of the plant.
        TooFarError: its pose is farther from all points than its profile allows.
    """
    last = plant.points_by_name.get(state.last_node_id)
    pose = state.mobile_robot_position
    if pose is None or not pose.localized:
        if last is None:
            raise NotLocatedError(Reason(R.NO_POSE))
        return Standing(last.name, on_point=True, pose=None)
    # VDA 5050 allows neither NaN nor infinity, and no distance to them can be compared.
    if not (isfinite(pose.x) and isfinite(pose.y) and isfinite(pose.theta)):
        raise NotLocatedError(Reason(R.INVALID_POSITION, x=str(pose.x), y=str(pose.y)))
    if not profile.knows_frame(pose.map_id):
        raise NotLocatedError(Reason(R.UNKNOWN_FRAME))
    here = profile.on(pose.map_id).to_plant(MapPlace(pose.x, pose.y))
    on_its_map = last is not None and (last.map_id or profile.map_id) == pose.map_id
    if last and on_its_map and _distance_to(last, here) <= profile.deviation_xy_at(last):
        return Standing(last.name, on_point=True, pose=pose)
    # The plant indexes points without a map under None: they are on the robot's own map.
    maps = (pose.map_id or None, None) if pose.map_id == profile.map_id else (pose.map_id,)
    indices = (plant.points_by_map.get(name) for name in dict.fromkeys(maps))
    candidates = (index.nearest(here.x_m, here.y_m) for index in indices if index)
    nearest = min(filter(None, candidates), key=lambda point: _distance_to(point, here), default=None)
    if nearest is None:
        # not the robot's own alone: by default that is the map that it reports
        own = ", ".join(sorted(name or profile.map_id for name in plant.points_by_map))
        raise NotLocatedError(Reason(R.OTHER_MAP, map=pose.map_id, own=own) if own else Reason(R.NO_POINTS))
    distance = _distance_to(nearest, here)
    # An order may have sent it to a coordinate, however far from all points.
    at_coordinate = state.last_node_id.startswith(GOAL_PREFIX)
    if distance > profile.max_distance_m and not at_coordinate:
        raise TooFarError(distance, nearest, last)
    return Standing(nearest.name, distance <= profile.deviation_xy_at(nearest), pose, distance)


def _distance_to(point: Point, here: PlantPlace) -> float:
    """Return the distance, m, in the plant's frame."""
    return hypot(point.x_m - here.x_m, point.y_m - here.y_m)
