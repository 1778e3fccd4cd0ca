"""Locations: places beside the track where something is done, linked to the points where vehicles stand."""

from collections.abc import Mapping

from pydantic import Field

from nena_shared.plant.geometry import MM_PER_M, LabelLayout, Millimetres, Vertex
from nena_shared.plant.record import PlantRecord


class LocationType(PlantRecord):
    """What can be done at the locations of this type, by vehicles and by peripheral devices."""

    name: str = Field(min_length=1)
    allowed_operations: tuple[str, ...] = ()
    allowed_peripheral_operations: tuple[str, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    representation: str | None = None


class Link(PlantRecord):
    """A point from which a location is served; without operations of its own it allows all of the type's."""

    point: str
    allowed_operations: tuple[str, ...] = ()


class LocationLayout(LabelLayout):
    """How a location is drawn; `position` only where a file draws it elsewhere than the model has it."""

    representation: str | None = None
    position: Vertex | None = None


class Location(PlantRecord):
    """A location; `type` names its location type. A peripheral's location may have no link."""

    name: str = Field(min_length=1)
    type: str
    x_mm: Millimetres = 0
    y_mm: Millimetres = 0
    z_mm: Millimetres = 0
    locked: bool = False
    links: tuple[Link, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: LocationLayout = LocationLayout()

    @property
    def x_m(self) -> float:
        """The x coordinate in metres of the plant frame."""
        return self.x_mm / MM_PER_M

    @property
    def y_m(self) -> float:
        """The y coordinate in metres of the plant frame."""
        return self.y_mm / MM_PER_M
