"""Tells how far an order has come on its way to its robot."""

from __future__ import annotations

from nena_order_service.fleet import RobotView
from nena_order_service.fleet.mission_builder import mission_id
from nena_order_service.fleet.view import MissionPhase
from nena_shared.fleet_api.delivery import DeliveryPhase, DeliveryStatus
from nena_shared.fleet_api.transport_order import TransportOrderStatus

PHASES = {
    MissionPhase.WAITING: DeliveryPhase.WAITING,
    MissionPhase.SENT: DeliveryPhase.SENT,
    MissionPhase.RUNNING: DeliveryPhase.DELIVERED,
    MissionPhase.CANCELLING: DeliveryPhase.CANCELLING,
}


def delivery_status(order: TransportOrderStatus, view: RobotView | None) -> DeliveryStatus:
    """Tell it of an order and the robot of its vehicle; None: no vehicle has the order, or it is gone."""
    first = mission_id(order.name, order.current_drive_order_index)
    own = view.mission_id if view else None
    tried = own is not None and (own == first or own.startswith(f"{first}~"))
    if order.state.final or not tried or view is None or view.mission_phase is None:
        return DeliveryStatus(transport_order=order.name, phase=DeliveryPhase.NONE)
    echoed = view.state is not None and view.state.order_id == own
    return DeliveryStatus(
        transport_order=order.name,
        phase=PHASES[view.mission_phase],
        vehicle=order.processing_vehicle,
        order_id=own,
        echoed_update_id=view.state.order_update_id if view.state and echoed else None,
        note=view.mission_note,
    )
