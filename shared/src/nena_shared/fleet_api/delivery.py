"""How far orders have come on their way to the robots."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Resource


class DeliveryPhase(StrEnum):
    """Where the VDA 5050 order of a transport order is."""

    NONE = "NONE"
    """There is none: no vehicle has the transport order, or it is at its end."""
    WAITING = "WAITING"
    """It is not sent: the robot cannot be sent anything now."""
    SENT = "SENT"
    """It is sent, and sent again, until a state of the robot echoes it."""
    DELIVERED = "DELIVERED"
    """The robot has it."""
    CANCELLING = "CANCELLING"
    """It is to end early, and the robot has not confirmed that yet."""


class DeliveryStatus(Resource):
    """The delivery of one transport order."""

    transport_order: str
    phase: DeliveryPhase
    vehicle: str | None = None
    order_id: str | None = None
    """orderId of VDA 5050."""
    echoed_update_id: int | None = None
    """orderUpdateId that the robot's last state echoes; None: it echoes none of this order."""
    note: str = ""
    """What it waits for, in words; empty where it waits for nothing but the robot's driving."""
