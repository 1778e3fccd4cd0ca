"""What a router must know of a vehicle."""

from dataclasses import dataclass
from typing import Self

from nena_shared.plant import DirectedEdge, Orientation, Vehicle


@dataclass(frozen=True, slots=True)
class RoutingProfile:
    """The traits of a vehicle that make a difference for its routes; None means without bound (mm/s)."""

    group: str = ""
    max_velocity_mm_s: int | None = None
    max_reverse_velocity_mm_s: int | None = None

    @classmethod
    def of(cls, vehicle: Vehicle | None) -> Self:
        """Return the profile of a vehicle, or that of any vehicle at all."""
        if vehicle is None:
            return cls()
        return cls(vehicle.routing_group, vehicle.max_velocity_mm_s, vehicle.max_reverse_velocity_mm_s)

    def speed_mm_s(self, edge: DirectedEdge) -> int:
        """Return how fast such a vehicle may drive along an edge; 0 if it cannot."""
        forward = edge.orientation is Orientation.FORWARD
        own = self.max_velocity_mm_s if forward else self.max_reverse_velocity_mm_s
        return edge.max_velocity_mm_s if own is None else min(edge.max_velocity_mm_s, own)
