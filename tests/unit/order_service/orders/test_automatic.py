from __future__ import annotations

from nena_order_service.orders.automatic import (
    automatic_name,
    is_automatic_recharge,
    park_request,
    recharge_request,
)
from nena_order_service.orders.transport_order import TransportOrder
from support.order_service import NOW, dispatchable_order

PARK = park_request("V1", "P")
RECHARGE = recharge_request("V1", "Dock", "Charge", dispensable=False)


def test_parking_is_always_dispensable_and_recharging_depends_on_energy() -> None:
    assert PARK.dispensable
    assert not RECHARGE.dispensable
    assert recharge_request("V1", "Dock", "Charge", dispensable=True).dispensable


def test_host_orders_are_never_taken_for_automatic_ones() -> None:
    name = automatic_name(RECHARGE)
    order = dispatchable_order("Dock:Charge", type="Charge", intended_vehicle="V1", name=name)
    assert not order.status.automatic
    assert not is_automatic_recharge(order)
    own = TransportOrder.created(RECHARGE, number=1, name=name, now=NOW, automatic=True)
    assert is_automatic_recharge(own)
