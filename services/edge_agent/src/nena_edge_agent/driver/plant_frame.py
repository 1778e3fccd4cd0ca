"""Conversion between the plant's frame and the robot's maps, for drivers on the robot's own map.

The core and all MQTT messages use the plant's frame; these drivers use the map's. Speeds are equal in both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

from nena_edge_agent.driver import map_port, port
from nena_shared.plant import geometry
from nena_shared.plant.geometry import MapTransform, parse_transform

SAME = MapTransform()
"""The transform of a map whose frame is the plant's."""


@dataclass(frozen=True, slots=True)
class PlantFrame:
    """Transforms from the plant to the robot's maps, by map ID; other maps use the plant's frame."""

    transforms: Mapping[str, MapTransform]

    @classmethod
    def of(cls, texts: Mapping[str, str]) -> Self:
        """Parse the transforms of the settings.

        Raises:
            ValueError: a transform is invalid.
        """
        return cls({map_id: parse_transform(text) for map_id, text in texts.items()})

    def on(self, map_id: str) -> MapTransform:
        """Return the transform from the plant to a map."""
        return self.transforms.get(map_id, SAME)

    def to_map(self, pose: port.Pose) -> map_port.MapPose:
        """Convert a pose from the plant to the robot's map."""
        found = self.on(pose.map_id).pose_to_map(geometry.PlantPose(pose.x, pose.y, pose.theta))
        return map_port.MapPose(found.x_m, found.y_m, found.heading_rad, pose.map_id)

    def to_plant(self, pose: map_port.MapPose) -> port.Pose:
        """Convert a pose from the robot's map to the plant."""
        found = self.on(pose.map_id).pose_to_plant(geometry.MapPose(pose.x, pose.y, pose.theta))
        return port.Pose(found.x_m, found.y_m, found.heading_rad, pose.map_id)

    def goal(self, goal: port.DriveGoal) -> map_port.MapGoal:
        """Convert a goal to the robot's map."""
        return map_port.MapGoal(
            goal.generation,
            self.to_map(goal.pose),
            deviation_xy=self.on(goal.pose.map_id).length_to_map(goal.deviation_xy),
            deviation_theta=goal.deviation_theta,
            maximum_speed=goal.maximum_speed,
            ahead=tuple(map(self.to_map, goal.ahead)),
            behavior_tree=goal.behavior_tree,
            path=tuple(map(self.to_map, goal.path)),
        )

    def area(self, area: port.Area) -> map_port.MapArea:
        """Convert an area to the robot's map."""
        to_map = self.on(area.map_id).pose_to_map
        places = (to_map(geometry.PlantPose(x, y, 0.0)) for x, y in area.points)
        return map_port.MapArea(area.map_id, tuple((place.x_m, place.y_m) for place in places))

    def event(self, event: map_port.MapDriverEvent) -> port.DriverEvent:
        """Convert an event of the driver to the plant's frame."""
        match event:
            case map_port.MapPoseReport(pose):
                rest = (event.localized, event.vx, event.omega, event.problem)
                return port.PoseReport(self.to_plant(pose), *rest)
            case map_port.MapPlanReport(points, map_id):
                to_plant = self.on(map_id).to_plant
                places = (to_plant(geometry.MapPlace(x, y)) for x, y in points)
                return port.PlanReport(tuple((place.x_m, place.y_m) for place in places))
            case port.DriveProgress(left, recoveries, map_id):
                in_plant = None if left is None else self.on(map_id).length_to_plant(left)
                return port.DriveProgress(in_plant, recoveries, map_id)
            case port.DriveLimits(tolerance, hand_over, map_id):
                to_length = self.on(map_id).length_to_plant
                contour = tuple((to_length(x), to_length(y)) for x, y in event.contour)
                lengths = (to_length(tolerance), to_length(hand_over))
                return port.DriveLimits(*lengths, map_id, contour, event.theta_tolerance)
            case _:
                return event


class PlantFrameDriver:
    """A driver in the plant's frame that wraps one on the robot's map."""

    def __init__(
        self, make: Callable[[map_port.MapEmit], map_port.MapDriver], frame: PlantFrame, emit: port.Emit
    ) -> None:
        """Create the driver with ``make``; ``emit`` receives its events in the plant's frame."""
        self._frame = frame
        self._driver = make(lambda event: emit(frame.event(event)))
        self.start = self._driver.start
        self.stop = self._driver.stop
        self.halt = self._driver.halt
        self.limit_speed = self._driver.limit_speed

    def reclaim(self, goals: port.OwnGoals) -> None:
        """Pass on own goals of an earlier run."""
        to_map = self._frame.to_map
        given = to_map(goals.given) if goals.given else None
        self._driver.reclaim(map_port.MapOwnGoals(goals.goal_ids, to_map(goals.pose), given, goals.behind))

    def go_to(self, goal: port.DriveGoal) -> None:
        """Pass on a goal."""
        self._driver.go_to(self._frame.goal(goal))

    def keep_out(self, areas: tuple[port.Area, ...]) -> None:
        """Pass on the areas that the robot must not enter."""
        self._driver.keep_out(tuple(map(self._frame.area, areas)))

    def initialize_position(self, pose: port.Pose) -> None:
        """Pass on the robot's pose."""
        self._driver.initialize_position(self._frame.to_map(pose))
