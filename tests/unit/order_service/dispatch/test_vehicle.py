from __future__ import annotations

from math import inf

from nena_order_service.dispatching.dispatcher import Carried, DispatchedVehicle, Pick
from nena_shared.fleet_api.order_types import AcceptableOrderType
from support.order_service import dispatchable_order


def test_obstacles_count_before_all_else() -> None:
    vehicle = DispatchedVehicle("V1", "is offline", restriction="has to recharge", kept_for=2)
    assert vehicle.why_not(dispatchable_order(), recharges=True) == "is offline"


def test_a_restriction_lets_it_recharge() -> None:
    vehicle = DispatchedVehicle("V1", restriction="has to recharge")
    assert vehicle.why_not(dispatchable_order(), recharges=False) == "has to recharge"
    assert vehicle.why_not(dispatchable_order(), recharges=True) == ""


def test_it_is_kept_for_one_order() -> None:
    vehicle = DispatchedVehicle("V1", kept_for=2)
    assert vehicle.why_not(dispatchable_order(number=1), recharges=False) == "is kept for another order"
    assert vehicle.why_not(dispatchable_order(number=2), recharges=False) == ""


def test_a_vehicle_with_a_load_takes_what_does_not_begin_with_another_one() -> None:
    vehicle = DispatchedVehicle("V1", carried=Carried(("",)))
    order = dispatchable_order()
    assert vehicle.why_not(order, recharges=False, pick=Pick()).startswith("carries a load")
    assert vehicle.why_not(order, recharges=False) == ""
    assert DispatchedVehicle("V1").why_not(order, recharges=False, pick=Pick()) == ""


def test_types_have_priorities() -> None:
    vehicle = DispatchedVehicle("V1", order_types=(AcceptableOrderType(name="Transport", priority=4),))
    assert vehicle.type_priority(dispatchable_order(type="Transport")) == 4
    assert vehicle.type_priority(dispatchable_order(type="Park")) == inf
