"""The transform between the plant frame and the frame of a robot's map, one for each map.

Plant models and maps are made by different people with different tools: a drawing may be 1:10, turned, and
have its origin in another corner. A position p of the plant, in metres, lies at `scale * R(rotation) * p +
offset` on the map. Headings turn with the rotation; lengths, such as allowed deviations, grow with the scale.
"""

from dataclasses import dataclass
from math import cos, isfinite, pi, remainder, sin


@dataclass(frozen=True, slots=True)
class Pose:
    """A position in metres and a heading in radians, -pi to pi, counter-clockwise from +x."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class MapTransform:
    """How the plant lies on a map: scale, rotation (rad, counter-clockwise) and offset (m of the map frame).

    Raises ValueError for a scale that is not above 0 and for numbers that are not finite.
    """

    scale: float = 1.0
    rotation_rad: float = 0.0
    offset_x_m: float = 0.0
    offset_y_m: float = 0.0

    def __post_init__(self) -> None:
        values = (self.scale, self.rotation_rad, self.offset_x_m, self.offset_y_m)
        if not all(map(isfinite, values)) or self.scale <= 0:
            msg = f"a map transform needs finite numbers and a scale above 0, not {self}"
            raise ValueError(msg)

    def to_map(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return where a position of the plant lies on the map, in metres."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        return (
            self.scale * (c * x_m - s * y_m) + self.offset_x_m,
            self.scale * (s * x_m + c * y_m) + self.offset_y_m,
        )

    def to_plant(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return where a position on the map lies in the plant, in metres."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        dx, dy = (x_m - self.offset_x_m) / self.scale, (y_m - self.offset_y_m) / self.scale
        return c * dx + s * dy, c * dy - s * dx

    def heading_to_map(self, heading_rad: float) -> float:
        """Return a heading of the plant as the map has it, -pi to pi."""
        return normalized(heading_rad + self.rotation_rad)

    def heading_to_plant(self, heading_rad: float) -> float:
        """Return a heading on the map as the plant has it, -pi to pi."""
        return normalized(heading_rad - self.rotation_rad)

    def pose_to_map(self, pose: Pose) -> Pose:
        """Return a pose of the plant as the map has it."""
        return Pose(*self.to_map(pose.x_m, pose.y_m), self.heading_to_map(pose.heading_rad))

    def pose_to_plant(self, pose: Pose) -> Pose:
        """Return a pose on the map as the plant has it."""
        return Pose(*self.to_plant(pose.x_m, pose.y_m), self.heading_to_plant(pose.heading_rad))

    def length_to_map(self, length_m: float) -> float:
        """Return a length of the plant as the map has it, in metres."""
        return length_m * self.scale

    def length_to_plant(self, length_m: float) -> float:
        """Return a length on the map as the plant has it, in metres."""
        return length_m / self.scale


def normalized(angle_rad: float) -> float:
    """Return the same angle between -pi and pi, as VDA 5050 has it."""
    return remainder(angle_rad, 2 * pi)
