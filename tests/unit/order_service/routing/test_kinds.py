from __future__ import annotations

from nena_order_service.routing.graph import RoutingProfile, VehicleKinds
from nena_shared.plant import Vehicle


def test_vehicles_that_are_alike_for_routes_are_of_one_kind() -> None:
    kinds = VehicleKinds(frozenset())
    one, twin = Vehicle(name="V1"), Vehicle(name="V2")
    slow = Vehicle(name="V3", max_velocity_mm_s=1)
    assert kinds.of(one) is kinds.of(twin)
    assert kinds.of(slow).number != kinds.of(one).number
    assert kinds.of(slow).profile == RoutingProfile.of(slow)
    assert kinds.of(None).profile == RoutingProfile()


def test_a_vehicle_that_has_changed_is_looked_at_anew() -> None:
    kinds = VehicleKinds(frozenset())
    before = kinds.of(Vehicle(name="V1"))
    assert kinds.of(Vehicle(name="V1", max_velocity_mm_s=1)) is not before
