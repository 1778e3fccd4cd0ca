"""From what is known of a transport order to what is told of it."""

from __future__ import annotations

from nena_shared.fleet_api.failure_policy import Hold
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.utc import iso
from nena_status_aggregator.fleet_model.order_book import TrackedOrder, progress
from nena_status_aggregator.fleet_model.robot_view import short
from nena_status_aggregator.fleet_model.views import HoldView, OrderView


def view_order(order: TrackedOrder, last_node: str | None) -> OrderView:
    """Tell everything about an order; ``last_node``: where its vehicle was last."""
    status = order.status
    return {
        "id": status.name,
        "name": status.name,
        "version": status.version,
        "state": status.state.value,
        "final": status.state.final,
        "confirmed": order.confirmed,
        "reason": short(status.reason) or "",
        "held": held(status.held) if status.held else None,
        "type": status.type,
        "priority": status.priority,
        "intendedVehicle": status.intended_vehicle,
        "processingVehicle": status.processing_vehicle,
        "destinations": [
            {
                "place": place(each.destination),
                "operation": each.destination.operation,
                "state": each.state.value,
            }
            for each in status.drive_orders
        ],
        "currentDestination": status.current_drive_order_index,
        "progress": progress(status, last_node),
        "deadline": iso(status.deadline) if status.deadline else None,
        "created": iso(status.created),
        "finished": iso(status.finished) if status.finished else None,
    }


def held(hold: Hold) -> HoldView:
    """Tell who holds an order."""
    return {"by": hold.by, "reason": short(hold.reason) or "", "since": iso(hold.since)}


def place(destination: Destination) -> str:
    """Name a destination: the point or location, or the coordinate in m."""
    at = destination.coordinate
    if at is None:
        return destination.location_name or ""
    return f"({at.x:.2f}, {at.y:.2f})"
