"""Why a transport order is done by no vehicle yet, vehicle by vehicle."""

from __future__ import annotations

from nena_shared.fleet_api.base import Resource
from nena_shared.fleet_api.transport_order import TransportOrderState


class VehicleForOrder(Resource):
    """What is between an order and one vehicle."""

    vehicle: str
    fits: bool
    """Whether it does the order, or could do it now."""
    reason: str
    """Why not, in words that follow its name."""
    cost: float | None = None
    """Of its way, where it could do it; the unit is that of ``routing.costs``, mm by default."""


class AssignmentStatus(Resource):
    """How the dispatcher sees one transport order now."""

    transport_order: str
    state: TransportOrderState
    reason: str
    """Why it is in this state, or what it waits for."""
    processing_vehicle: str | None = None
    vehicles: tuple[VehicleForOrder, ...] = ()
    """Those that could do it first, the cheapest way before others; none for an order at its end."""
    left_out: int = 0
    """How many vehicles more there are."""
