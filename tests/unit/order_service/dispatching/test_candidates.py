from __future__ import annotations

from nena_order_service.dispatching.candidates import WaitingOrders
from support.order_service import assigned_order, dispatchable_order


def test_the_oldest_order_is_the_first_created() -> None:
    assert WaitingOrders().oldest is None
    waiting = WaitingOrders()
    for number in (2, 1, 3):
        waiting.put(dispatchable_order(number=number, priority=number))
    assert waiting.oldest == 1
    waiting.put(assigned_order(number=1))
    assert waiting.oldest == 2
