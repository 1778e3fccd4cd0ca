"""What orders to one robot need: its map, and how exactly it must drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Self

from nena_shared.plant import MapTransform, Vehicle

DEFAULT_DEVIATION_XY: Final = 0.5
"""m; wide enough to pass a node without a stop, and above the goal tolerance that Nav2 has by default."""

DEFAULT_DEVIATION_THETA: Final = 0.35
"""rad, about 20 degrees; above the goal tolerance that Nav2 has by default."""

IDENTITY: Final = MapTransform()
"""Plant and map have the same frame."""


@dataclass(frozen=True, slots=True)
class RobotProfile:
    """How missions for one robot are built. ``map_id`` is the id of the map in the robot."""

    map_id: str
    deviation_xy: float = DEFAULT_DEVIATION_XY
    """m of the plant: how far from a node the robot may pass or stop."""
    deviation_theta: float = DEFAULT_DEVIATION_THETA
    """rad: how far from the wanted heading the robot may stop."""
    transforms: Mapping[str, MapTransform] = field(default_factory=dict, hash=False)
    """How the plant lies on maps, by their ids, for robots that do not transform themselves."""
    transforms_itself: bool | None = None
    """Whether the robot speaks in the plant's frame; None: its factsheet, which says so, has not come."""

    @classmethod
    def of(cls, vehicle: Vehicle, *, default_map_id: str, transforms: Mapping[str, MapTransform]) -> Self:
        """Take from the vehicle's properties what they say, and defaults for the rest."""
        deviation_xy, deviation_theta = vehicle.deviation_xy_m, vehicle.deviation_theta_rad
        return cls(
            map_id=vehicle.map_id or default_map_id,
            deviation_xy=DEFAULT_DEVIATION_XY if deviation_xy is None else deviation_xy,
            deviation_theta=DEFAULT_DEVIATION_THETA if deviation_theta is None else deviation_theta,
            transforms=transforms,
        )

    def on(self, map_id: str) -> MapTransform:
        """Give what leads from the plant's frame to that in which messages to and from the robot are."""
        return IDENTITY if self.transforms_itself else self.transforms.get(map_id, IDENTITY)

    def knows_frame(self, map_id: str) -> bool:
        """Tell whether it is certain who transforms: this side or, as its factsheet says, the robot."""
        return self.transforms_itself is not None or map_id not in self.transforms
