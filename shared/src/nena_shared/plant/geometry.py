"""Shapes in the plant frame: x to the right, y up, whole millimetres."""

from pydantic import Field

from nena_shared.plant.record import PlantRecord

MM_PER_M = 1000


class Vertex(PlantRecord):
    """A corner of an envelope, or a drawn position, in mm of the plant frame."""

    x_mm: int
    y_mm: int


class Envelope(PlantRecord):
    """The area that vehicles with this envelope key cover; closed: the last vertex is the first."""

    key: str
    vertices: tuple[Vertex, ...]


class BoundingBox(PlantRecord):
    """Size of a vehicle in mm; the reference offset leads from the box's centre to the vehicle's origin."""

    length_mm: int = Field(default=1000, ge=1)
    width_mm: int = Field(default=1000, ge=1)
    height_mm: int = Field(default=1000, ge=1)
    reference_offset_x_mm: int = 0
    reference_offset_y_mm: int = 0


class LabelLayout(PlantRecord):
    """Where the label of a drawn object stands, in pixels from it, and the layer that shows it."""

    label_offset_x_px: int = -10
    label_offset_y_px: int = -20
    layer_id: int = 0
