"""Shapes in the plant frame: x to the right, y up, whole millimetres."""

from typing import Annotated, Final

from pydantic import Field

from nena_shared.plant.record import PlantRecord

MM_PER_M = 1000

FAR_MM: Final = 10**18
"""Farther and longer than anything on earth; keeps what is computed from a file finite."""

Millimetres = Annotated[int, Field(ge=-FAR_MM, le=FAR_MM)]


class Vertex(PlantRecord):
    """A corner of an envelope, or a drawn position, in mm of the plant frame."""

    x_mm: Millimetres
    y_mm: Millimetres


class Envelope(PlantRecord):
    """The area that vehicles with this envelope key cover; closed: the last vertex is the first."""

    key: str
    vertices: tuple[Vertex, ...]


class BoundingBox(PlantRecord):
    """Size of a vehicle in mm; the reference offset leads from the box's centre to the vehicle's origin."""

    length_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    width_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    height_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    reference_offset_x_mm: Millimetres = 0
    reference_offset_y_mm: Millimetres = 0

    def holds(self, other: "BoundingBox") -> bool:
        """Whether another box lies within this one when their reference points lie on each other."""
        x_mm = abs(self.reference_offset_x_mm - other.reference_offset_x_mm)
        y_mm = abs(self.reference_offset_y_mm - other.reference_offset_y_mm)
        return (
            other.length_mm + 2 * x_mm <= self.length_mm
            and other.width_mm + 2 * y_mm <= self.width_mm
            and other.height_mm <= self.height_mm
        )


class LabelLayout(PlantRecord):
    """Where the label of a drawn object stands, in pixels from it, and the layer that shows it."""

    label_offset_x_px: int = -10
    label_offset_y_px: int = -20
    layer_id: int = 0
