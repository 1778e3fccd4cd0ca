"""Points: places where a vehicle can be and report being. A VDA 5050 node is made from each."""

from collections.abc import Mapping
from enum import StrEnum
from math import radians

from pydantic import Field

from nena_shared.plant import property_keys as keys
from nena_shared.plant.geometry import MM_PER_M, BoundingBox, Envelope, LabelLayout, Millimetres
from nena_shared.plant.record import PlantRecord
from nena_shared.plant.transform import normalized
from nena_shared.plant.vehicle_type import VehicleTypeAtPoint


class PointType(StrEnum):
    """What a vehicle may do at a point."""

    HALT_POSITION = "HALT_POSITION"
    PARK_POSITION = "PARK_POSITION"


class Point(PlantRecord):
    """A point of the plant; `orientation_deg` is None where any heading will do."""

    name: str = Field(min_length=1)
    x_mm: Millimetres
    y_mm: Millimetres
    z_mm: Millimetres = 0
    orientation_deg: float | None = None
    type: PointType = PointType.HALT_POSITION
    max_vehicle_bounding_box: BoundingBox = BoundingBox()
    envelopes: tuple[Envelope, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: LabelLayout = LabelLayout()
    vehicle_types: tuple[VehicleTypeAtPoint, ...] = ()
    """The vehicle types that may be here, where the plant tells them apart; empty: all."""

    @property
    def map_id(self) -> str | None:
        """The map that the point is on (property `vda5050:mapId`); None: that of each vehicle."""
        return self.properties.get(keys.VDA5050_MAP_ID)

    @property
    def x_m(self) -> float:
        """The x coordinate in metres of the plant frame."""
        return self.x_mm / MM_PER_M

    @property
    def y_m(self) -> float:
        """The y coordinate in metres of the plant frame."""
        return self.y_mm / MM_PER_M

    @property
    def heading_rad(self) -> float | None:
        """The wanted heading in radians, -pi to pi, counter-clockwise from +x; None where any will do."""
        return None if self.orientation_deg is None else normalized(radians(self.orientation_deg))

    def is_open_to(self, vehicle_type: str) -> bool:
        """Whether vehicles of a type may be here."""
        return not self.vehicle_types or any(
            use.vehicle_type_id == vehicle_type for use in self.vehicle_types
        )
