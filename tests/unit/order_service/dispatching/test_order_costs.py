from __future__ import annotations

from math import inf

from nena_order_service.dispatching.candidates import DispatchedVehicle
from nena_order_service.engine.conditions import Sequences
from nena_order_service.engine.order_knowledge import OrderFit, OrderKnowledge
from nena_order_service.orders.automatic import park_request
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.fleet_api.vehicle import AcceptableOrderType
from nena_shared.plant import Vehicle
from support.order_service import NOW, assigned_order, dispatchable_order
from support.plants import path, plant
from support.scripted_fleet import make_context

PLANT = plant(
    path("A B", 1000), path("B C", 3000), path("B A", 1000), vehicles=(Vehicle(name="V1"), Vehicle(name="V2"))
)


V1, V2 = DispatchedVehicle("V1", start="A"), DispatchedVehicle("V2", start="C")


def knowledge(*assigned: TransportOrder) -> tuple[OrderKnowledge, OrderFit, VehicleRegistry]:
    context = make_context(PLANT)
    fit = OrderFit(context.state.vehicles, Sequences(context))
    for order, vehicle in zip(assigned, context.registry, strict=False):
        context.state.orders.put(order)
        context.state.drives.assign(order, vehicle.key)
    return OrderKnowledge(context, fit), fit, context.registry


def test_costs_cover_only_remaining_destinations() -> None:
    known, *_ = knowledge()
    order = dispatchable_order("B", "C")
    assert [*known.route_costs(order, [V1, V2])] == [(4000, 1000), (inf, inf)]
    begun: TransportOrder = assigned_order("B", "C", number=2).drive_order_finished(0, NOW)
    assert [*known.route_costs(begun, [V1, V2])] == [(4000, 4000), (0, 0)]


def test_outstanding_visits_to_destinations_are_counted() -> None:
    fetched = assigned_order("B", "C", number=2).drive_order_finished(0, NOW)
    known, *_ = knowledge(fetched, assigned_order("B", "C", number=3))
    assert known.outstanding_visits() == {"B": 1, "C": 2}


def test_resources_to_avoid_and_a_missing_route_are_reported() -> None:
    known, *_ = knowledge()
    order = dispatchable_order("C", properties=[{"key": "tcs:resourcesToAvoid", "value": "B"}])
    assert [*known.route_costs(order, [V1])] == [(inf, inf)]
    assert "without 'B'" in str(known.why_no_route(order, V1))
    known.forget_routes()
    assert "No route from 'C'" in str(known.why_no_route(dispatchable_order("A"), V2))


def test_automatic_orders_require_no_type() -> None:
    known, fit, registry = knowledge()
    vehicle = registry.named("V1")
    assert vehicle
    fit.set_order_types(vehicle, (AcceptableOrderType(name="Transport"),))
    seen = DispatchedVehicle("V1", order_types=fit.order_types(vehicle))
    assert "accepts no orders of type 'Park'" in str(
        known.why_unsuitable(dispatchable_order(type="Park"), seen)
    )
    asked = park_request("V1", "A")
    own = TransportOrder.created(asked, number=1, name="Park-1", now=NOW, automatic=True)
    assert known.why_unsuitable(own, seen) is None
    of_a_host = dispatchable_order(type="Park", name="Park-1", intended_vehicle="V1")
    assert "accepts no orders of type 'Park'" in str(known.why_unsuitable(of_a_host, seen))
    assert known.recharges_next(dispatchable_order("A:Charge"))
    assert not known.recharges_next(dispatchable_order("A"))


def test_the_first_pick_of_an_order_precedes_any_drop() -> None:
    known, *_ = knowledge()
    assert known.first_pick(dispatchable_order("A", "B:Load", "C:Unload")) == Pick()
    assert known.first_pick(dispatchable_order("A", "C:Unload", "B:Load")) is None
    assert known.first_pick(dispatchable_order("A")) is None
    assert known.first_pick(assigned_order("A:Load", "B:Unload").drive_order_finished(0, NOW)) is None
    for device in ("lhd", "loadHandlingDevice"):
        told = [{"key": "loadType", "value": "pallet"}, {"key": device, "value": "fork"}]
        asked = {"locationName": "A", "operation": "Load", "properties": told}
        order = dispatchable_order(destinations=[asked])
        assert known.first_pick(order) == Pick("pallet", "fork")
