"""The transform between the plant frame and the frame of a robot's map, one for each map.

Plant models and maps are made by different people with different tools: a drawing may be 1:10, turned, and
have its origin in another corner. A position p of the plant, in metres, lies at `scale * R(rotation) * p +
offset` on the map. Headings turn with the rotation; lengths, such as allowed deviations, grow with the scale.

What is in the one frame and what is in the other have types of their own, so that nothing is transformed
twice or not at all: from a plant's place only :meth:`MapTransform.to_map` leads to a map's place.
"""

from dataclasses import dataclass
from math import cos, isfinite, pi, remainder, sin


@dataclass(frozen=True, slots=True)
class PlantPlace:
    """A position in metres of the plant's frame."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class MapPlace:
    """A position in metres of a map's frame."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class PlantPose:
    """A position in metres and a heading in radians, -pi to pi, counter-clockwise from +x of the plant."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class MapPose:
    """A position in metres and a heading in radians, -pi to pi, counter-clockwise from +x of a map."""

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

    def to_map(self, place: PlantPlace | PlantPose) -> MapPlace:
        """Return where a position of the plant lies on the map."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        return MapPlace(
            self.scale * (c * place.x_m - s * place.y_m) + self.offset_x_m,
            self.scale * (s * place.x_m + c * place.y_m) + self.offset_y_m,
        )

    def to_plant(self, place: MapPlace | MapPose) -> PlantPlace:
        """Return where a position on the map lies in the plant."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        dx, dy = (place.x_m - self.offset_x_m) / self.scale, (place.y_m - self.offset_y_m) / self.scale
        return PlantPlace(c * dx + s * dy, c * dy - s * dx)

    def heading_to_map(self, heading_rad: float) -> float:
        """Return a heading of the plant as the map has it, -pi to pi."""
        return normalized(heading_rad + self.rotation_rad)

    def heading_to_plant(self, heading_rad: float) -> float:
        """Return a heading on the map as the plant has it, -pi to pi."""
        return normalized(heading_rad - self.rotation_rad)

    def pose_to_map(self, pose: PlantPose) -> MapPose:
        """Return a pose of the plant as the map has it."""
        place = self.to_map(pose)
        return MapPose(place.x_m, place.y_m, self.heading_to_map(pose.heading_rad))

    def pose_to_plant(self, pose: MapPose) -> PlantPose:
        """Return a pose on the map as the plant has it."""
        place = self.to_plant(pose)
        return PlantPose(place.x_m, place.y_m, self.heading_to_plant(pose.heading_rad))

    def length_to_map(self, length_m: float) -> float:
        """Return a length of the plant as the map has it, in metres."""
        return length_m * self.scale

    def length_to_plant(self, length_m: float) -> float:
        """Return a length on the map as the plant has it, in metres."""
        return length_m / self.scale


def normalized(angle_rad: float) -> float:
    """Return the same angle between -pi and pi, as VDA 5050 has it."""
    return remainder(angle_rad, 2 * pi)
