"""Conversion between the plant's frame and the robot's maps, for a driver whose robot has its own map.

The core and all MQTT messages use the plant's frame; such a driver uses the map's, and converts goals and
events as they pass its port. Speeds are equal in both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from nena_edge_agent.driver.port import (
    Area,
    DriveGoal,
    DriveLimits,
    DriveProgress,
    DriverEvent,
    OwnGoals,
    PlanReport,
    Pose,
    PoseReport,
)
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
        """Parse the transforms of the settings; raises ValueError if a transform is invalid."""
        return cls({map_id: parse_transform(text) for map_id, text in texts.items()})

    def on(self, map_id: str) -> MapTransform:
        """Return the transform from the plant to a map."""
        return self.transforms.get(map_id, SAME)

    def to_map(self, pose: Pose) -> Pose:
        """Convert a pose from the plant to the robot's map."""
        place = self.on(pose.map_id).pose_to_map(geometry.PlantPose(pose.x, pose.y, pose.theta))
        return Pose(place.x_m, place.y_m, place.heading_rad, pose.map_id)

    def to_plant(self, pose: Pose) -> Pose:
        """Convert a pose from the robot's map to the plant."""
        place = self.on(pose.map_id).pose_to_plant(geometry.MapPose(pose.x, pose.y, pose.theta))
        return Pose(place.x_m, place.y_m, place.heading_rad, pose.map_id)

    def goal_to_map(self, goal: DriveGoal) -> DriveGoal:
        """Convert a goal to the robot's map."""
        return replace(
            goal,
            pose=self.to_map(goal.pose),
            deviation_xy=self.on(goal.pose.map_id).length_to_map(goal.deviation_xy),
            ahead=tuple(map(self.to_map, goal.ahead)),
            path=tuple(map(self.to_map, goal.path)),
        )

    def own_goals_to_map(self, goals: OwnGoals) -> OwnGoals:
        """Convert own goals of an earlier run to the robot's map."""
        sent = self.to_map(goals.given) if goals.given else None
        return replace(goals, pose=self.to_map(goals.pose), given=sent)

    def area_to_map(self, area: Area) -> Area:
        """Convert an area to the robot's map."""
        to_map = self.on(area.map_id).pose_to_map
        places = (to_map(geometry.PlantPose(x, y, 0.0)) for x, y in area.points)
        return Area(area.map_id, tuple((place.x_m, place.y_m) for place in places))

    def event_to_plant(self, event: DriverEvent) -> DriverEvent:
        """Convert an event of the driver to the plant's frame."""
        match event:
            case PoseReport(pose):
                return replace(event, pose=self.to_plant(pose))
            case PlanReport(points, map_id):
                to_plant = self.on(map_id).to_plant
                places = (to_plant(geometry.MapPlace(x, y)) for x, y in points)
                return PlanReport(tuple((place.x_m, place.y_m) for place in places), map_id)
            # A transform may scale: lengths are in metres of the map, speeds are equal in both.
            case DriveProgress(left, _, map_id):
                return replace(event, left=None if left is None else self.on(map_id).length_to_plant(left))
            case DriveLimits(tolerance, hand_over, map_id, contour):
                to_length = self.on(map_id).length_to_plant
                return replace(
                    event,
                    tolerance=to_length(tolerance),
                    hand_over=to_length(hand_over),
                    contour=tuple((to_length(x), to_length(y)) for x, y in contour),
                )
            case _:
                return event


NO_TRANSFORMS = PlantFrame({})
"""The frame of a robot whose maps all have the plant's frame."""
