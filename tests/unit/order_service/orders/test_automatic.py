from __future__ import annotations

from nena_order_service.orders.automatic import (
    automatic_name,
    is_automatic_recharge,
    park_request,
    recharge_request,
)
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from support.order_service import NOW, dispatchable_order

PARK = park_request("V1", "P")
RECHARGE = recharge_request("V1", "Dock", "Charge", dispensable=False)


def made(request: TransportOrderRequest) -> TransportOrder:
    return TransportOrder.created(request, number=1, name=automatic_name(request), now=NOW, automatic=True)


def test_automatic_orders_are_named_by_purpose() -> None:
    park, recharge = made(PARK), made(RECHARGE)
    assert park.name.startswith("Park-")
    assert recharge.name.startswith("Recharge-")
    assert (is_automatic_recharge(park), is_automatic_recharge(recharge)) == (False, True)
    assert automatic_name(PARK) != automatic_name(PARK)


def test_parking_is_always_dispensable_and_recharging_depends_on_energy() -> None:
    assert PARK.dispensable
    assert not RECHARGE.dispensable
    assert recharge_request("V1", "Dock", "Charge", dispensable=True).dispensable


def test_host_orders_are_never_taken_for_automatic_ones() -> None:
    name = automatic_name(RECHARGE)
    order = dispatchable_order("Dock:Charge", type="Charge", intended_vehicle="V1", name=name)
    assert not order.status.automatic
    assert not is_automatic_recharge(order)
