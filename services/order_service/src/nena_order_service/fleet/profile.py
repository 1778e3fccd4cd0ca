"""What orders to one robot need: its map, and how exactly it must drive."""

from __future__ import annotations

from dataclasses import dataclass
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
    transform: MapTransform = IDENTITY
    """From the plant's frame to that of the robot's map."""

    @classmethod
    def of(cls, vehicle: Vehicle, *, default_map_id: str, transform: MapTransform | None = None) -> Self:
        """Take from the vehicle's properties what they say, and defaults for the rest."""
        deviation_xy, deviation_theta = vehicle.deviation_xy_m, vehicle.deviation_theta_rad
        return cls(
            map_id=vehicle.map_id or default_map_id,
            deviation_xy=DEFAULT_DEVIATION_XY if deviation_xy is None else deviation_xy,
            deviation_theta=DEFAULT_DEVIATION_THETA if deviation_theta is None else deviation_theta,
            transform=transform or IDENTITY,
        )
