from __future__ import annotations

from nena_order_service.dispatching.dispatcher import BUSY, COULD, Carried, DispatchedVehicle, explain
from support.dispatching import Told, vehicles
from support.order_service import assigned_order, dispatchable_order

FLEET = [
    *vehicles(far="", near="", lost="", out="is offline"),
    DispatchedVehicle("low", restriction="has to recharge"),
]
TOLD = Told({"far": 9, "near": 2, "low": 1})


def test_each_vehicle_has_a_reason_and_those_that_could_come_first() -> None:
    found = explain(dispatchable_order(), FLEET, TOLD)
    assert [(each.vehicle, each.fits) for each in found[:2]] == [("near", True), ("far", True)]
    assert [each.cost for each in found] == [2, 9, None, None, None]
    assert {each.vehicle: each.reason for each in found} == {
        "near": COULD,
        "far": COULD,
        "lost": "has no way: No route for T-1 and lost.",
        "low": "has to recharge",
        "out": "is offline",
    }


def test_who_is_not_meant_is_told_who_is() -> None:
    order = dispatchable_order(intended_vehicle="near")
    reasons = {each.vehicle: each.reason for each in explain(order, FLEET, TOLD)}
    assert reasons["near"] == COULD
    assert reasons["far"] == "is not 'near', which it is for"
    kept = {each.vehicle: each.reason for each in explain(dispatchable_order(), FLEET, TOLD, kept={1: "far"})}
    assert kept["near"] == "is not 'far', which is kept for it"


def test_who_does_it_is_said() -> None:
    found = explain(assigned_order(vehicle="V-1"), vehicles(**{"V-1": BUSY}), TOLD)
    assert [(each.fits, each.reason) for each in found] == [(True, "does it")]


def test_a_load_that_is_in_the_way_is_told() -> None:
    loaded = [DispatchedVehicle("near", carried=Carried(("",)))]
    (pick,), (drop,) = (explain(dispatchable_order(stop), loaded, TOLD) for stop in ("A:Load", "A:Unload"))
    assert (pick.fits, pick.reason) == (False, "carries a load, and has no room for another one")
    assert (drop.fits, drop.reason) == (True, COULD)
