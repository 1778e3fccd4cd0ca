"""Transport orders and requests for tests of the order service."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.transport_order import TransportOrderRequest

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def request(*stops: str, **fields: Any) -> TransportOrderRequest:
    """Make a request from stops such as ``"Storage:Unload cargo"``; without an operation it is MOVE."""
    destinations = []
    for stop in stops or ("A",):
        name, _, operation = stop.partition(":")
        destinations.append({"locationName": name, "operation": operation or "MOVE"})
    return TransportOrderRequest.model_validate({"destinations": destinations, **fields})


def raw_order(*stops: str, number: int = 1, name: str = "", **fields: Any) -> TransportOrder:
    """Make an order that was just created."""
    name = name or f"T-{number}"
    return TransportOrder.created(request(*stops, **fields), number=number, name=name, now=NOW)


def dispatchable_order(*stops: str, number: int = 1, name: str = "", **fields: Any) -> TransportOrder:
    """Make an order that waits for a vehicle."""
    return raw_order(*stops, number=number, name=name, **fields).activated().dispatchable()


def assigned_order(*stops: str, vehicle: str = "V-1", number: int = 1, **fields: Any) -> TransportOrder:
    """Make an order that a vehicle works on."""
    order = dispatchable_order(*stops, number=number, **fields)
    routes = [("A", "B") for _ in order.status.drive_orders]
    return order.assigned(vehicle, routes, Reason.of("it is near"), NOW)


def codes(of: TransportOrder | OrderSequence) -> list[str]:
    """Return the event codes of its history."""
    return [entry.event_code for entry in of.status.history]
