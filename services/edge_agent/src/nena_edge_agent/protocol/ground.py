"""The ground that a robot covers with its contour, and the zones in it (section 6.4)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.polygon import Polygon, box, boxes_meet, overlap, rectangle, turning_circle
from nena_edge_agent.protocol.zone_sets import EnabledZone
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.zone_set import ZoneType

CLOSED = (ZoneType.BLOCKED, ZoneType.LINE_GUIDED)
"""Zones that a robot must not drive in when it chooses its way itself: it cannot keep to a trajectory."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """The robot's contour: a rectangle around its centre, in m."""

    length: float
    width: float

    def stand(self, pose: Pose) -> tuple[Polygon, ...]:
        """Give what the robot covers where it stands."""
        place = (pose.x, pose.y)
        return (rectangle(place, place, length=self.length, width=self.width, theta=pose.theta),)

    def way(self, start: Pose | NodePosition, end: NodePosition) -> tuple[Polygon, ...]:
        """Give what the robot covers on the straight way to ``end``, where it may turn."""
        begin, place = (start.x, start.y), (end.x, end.y)
        return (
            rectangle(begin, place, length=self.length, width=self.width, theta=start.theta or 0.0),
            turning_circle(place, length=self.length, width=self.width),
        )


def zones_in(ground: Iterable[Polygon], map_id: str, zones: Iterable[EnabledZone]) -> list[EnabledZone]:
    """Give the zones of one map that ``ground`` touches."""
    parts = [(part, box(part)) for part in ground]
    return [
        each
        for each in zones
        if each.map_id == map_id
        and any(boxes_meet(frame, each.box) and overlap(part, each.contour) for part, frame in parts)
    ]


def first_closed(zones: Iterable[EnabledZone]) -> EnabledZone | None:
    """Give the first of ``zones`` that the robot must not drive in."""
    return next((each for each in zones if each.zone.zone_type in CLOSED), None)
