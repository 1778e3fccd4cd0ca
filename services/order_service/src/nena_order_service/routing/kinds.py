"""Kinds of vehicles: those of one kind have the same ways, so that these need be found only once."""

from dataclasses import dataclass

from nena_order_service.routing.profile import RoutingProfile
from nena_shared.plant import Vehicle


@dataclass(frozen=True, slots=True)
class Kind:
    """A routing profile, and a number for it that is quick to compare."""

    number: int
    profile: RoutingProfile


class VehicleKinds:
    """Knows the kind of each vehicle; as many are remembered as the plant model has vehicles."""

    def __init__(self, known_types: frozenset[str]) -> None:
        """``known_types`` are the vehicle types that the plant tells apart."""
        self._known_types = known_types
        self._anybody = Kind(0, RoutingProfile())
        self._kinds = {self._anybody.profile: self._anybody}
        self._of: dict[str, tuple[Vehicle, Kind]] = {}

    def of(self, vehicle: Vehicle | None) -> Kind:
        """Return the kind of a vehicle; None: of any vehicle at all."""
        if vehicle is None:
            return self._anybody
        known = self._of.get(vehicle.name)
        if known is None or known[0] is not vehicle:
            profile = RoutingProfile.of(vehicle, self._known_types)
            known = vehicle, self._kinds.setdefault(profile, Kind(len(self._kinds), profile))
            self._of[vehicle.name] = known
        return known[1]
