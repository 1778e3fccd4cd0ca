from __future__ import annotations

from dataclasses import replace

from nena_order_service.api.orders import delivery_status
from nena_order_service.fleet.robot import Availability, LinkStatus, RobotView, VdaOrderPhase
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.transport_order import DeliveryPhase
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.topics import RobotKey
from support.fleet_examples import state
from support.order_service import NOW, assigned_order

VIEW = RobotView(
    key=RobotKey("NeNa", "V-1"),
    link=LinkStatus.ONLINE,
    vehicle_state=VehicleState.EXECUTING,
    availability=Availability(can_take_order=False, reason=Reason.of("has an order")),
    state=None,
    state_at=None,
    factsheet=None,
    malformed=0,
    order_id="T-1-0",
    order_phase=VdaOrderPhase.SENT,
    wait_reason=Reason.of("no state echoes it yet"),
)


def test_sent_order_is_not_delivered_before_a_state_echoes_it() -> None:
    told = delivery_status(assigned_order().status, VIEW)
    assert (told.phase, told.order_id, told.echoed_update_id) == (DeliveryPhase.SENT, "T-1-0", None)
    assert told.note == "no state echoes it yet"
    other = replace(VIEW, state=state(order_id="another", order_update_id=7))
    assert delivery_status(assigned_order().status, other).echoed_update_id is None


def test_delivered_order_has_the_robots_update_id() -> None:
    echo = replace(VIEW, order_phase=VdaOrderPhase.RUNNING, state=state(order_id="T-1-0", order_update_id=2))
    told = delivery_status(assigned_order().status, echo)
    assert (told.phase, told.echoed_update_id) == (DeliveryPhase.DELIVERED, 2)


def test_orders_without_a_vehicle_or_ended_are_undelivered() -> None:
    order = assigned_order()
    for status, view in (
        (order.status, None),
        (order.finished(NOW).status, VIEW),
        (order.status, replace(VIEW, order_id="T-9-0")),
        (order.status, replace(VIEW, order_id=None, order_phase=None)),
    ):
        told = delivery_status(status, view)
        assert (told.phase, told.order_id) == (DeliveryPhase.NONE, None)


def test_a_retried_drive_order_is_delivered_by_its_newest_vda_order() -> None:
    again = replace(VIEW, order_id="T-1-0~2", order_phase=VdaOrderPhase.RUNNING)
    told = delivery_status(assigned_order().status, again)
    assert (told.phase, told.order_id) == (DeliveryPhase.DELIVERED, "T-1-0~2")
