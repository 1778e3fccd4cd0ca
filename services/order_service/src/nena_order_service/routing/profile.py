"""What a router must know of a vehicle."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from nena_shared.plant import BoundingBox, DirectedEdge, Path, Vehicle
from nena_shared.plant.geometry import MM_PER_M
from nena_shared.plant.vehicle_type import VehicleTypeOnPath


@dataclass(frozen=True, slots=True)
class RoutingProfile:
    """The traits of a vehicle that make a difference for its routes; None means without bound (mm/s, mm)."""

    group: str = ""
    max_velocity_mm_s: int | None = None
    max_reverse_velocity_mm_s: int | None = None
    vehicle_types: frozenset[str] = frozenset()
    """The types of which it may be; it goes only where each of them may."""
    loaded: bool | None = None
    """Whether it carries anything; None: nobody knows."""
    bounding_box: BoundingBox | None = None
    allowed_maps: frozenset[str] | None = None

    @classmethod
    def of(
        cls,
        vehicle: Vehicle | None,
        known_types: frozenset[str] = frozenset(),
        *,
        loaded: bool | None = None,
    ) -> Self:
        """Return the profile of a vehicle, or that of any vehicle at all.

        A vehicle that names no type may be of each type that the plant knows.
        """
        if vehicle is None:
            return cls()
        named = frozenset({vehicle.vehicle_type}) if vehicle.vehicle_type else known_types
        return cls(
            group=vehicle.routing_group,
            max_velocity_mm_s=vehicle.max_velocity_mm_s,
            max_reverse_velocity_mm_s=vehicle.max_reverse_velocity_mm_s,
            vehicle_types=named if known_types else frozenset(),
            loaded=loaded if known_types else None,
            bounding_box=vehicle.bounding_box,
            allowed_maps=vehicle.allowed_maps,
        )

    def uses_of(self, path: Path) -> Iterator[VehicleTypeOnPath]:
        """Yield how the path may be used by the types of which the vehicle may be."""
        return (use for use in path.vehicle_types if use.vehicle_type_id in self.vehicle_types)

    def speed_mm_s(self, edge: DirectedEdge) -> int:
        """Return how fast such a vehicle may drive along an edge; 0 if it cannot.

        A type that LIF has drive an edge with its back first goes by its reverse speed.
        """
        speeds = [edge.max_velocity_mm_s]
        backward = not edge.is_forward
        for use in self.uses_of(edge.path):
            backward = backward or use.is_backward
            if use.max_speed is not None:
                speeds.append(round(use.max_speed * MM_PER_M))
        own = self.max_reverse_velocity_mm_s if backward else self.max_velocity_mm_s
        return min(speeds) if own is None else min(*speeds, own)
