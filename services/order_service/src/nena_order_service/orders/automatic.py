"""Orders that the order service creates itself, for idle vehicles."""

from __future__ import annotations

from typing import Final

from nena_order_service.orders.transport_order import TransportOrder, sortable_id
from nena_order_service.orders.validation import PARK
from nena_shared.fleet_api.transport_order import (
    Destination,
    FailureMeasure,
    FailureStep,
    TransportOrderRequest,
)

# The types and name prefixes of the orders that openTCS creates for idle vehicles.
PARK_TYPE: Final = "Park"
RECHARGE_TYPE: Final = "Charge"
PREFIXES: Final = {PARK_TYPE: "Park-", RECHARGE_TYPE: "Recharge-"}
"""Name prefixes of these orders by type; only for people, because hosts may use the same prefixes."""

JUST_FAIL: Final = (FailureStep(do=FailureMeasure.FAIL),)
"""These orders are not retried: if still needed, a new one is created."""


def park_request(vehicle: str, point: str) -> TransportOrderRequest:
    """Return a request for an order that parks a vehicle, with the lowest priority."""
    return TransportOrderRequest(
        destinations=(Destination(location_name=point, operation=PARK),),
        intended_vehicle=vehicle,
        type=PARK_TYPE,
        dispensable=True,
        on_failure=JUST_FAIL,
    )


def goal_of(request: TransportOrderRequest) -> str:
    """Return the name of the point or location of such a request."""
    return request.destinations[0].location_name or ""


def recharge_request(
    vehicle: str, location: str, operation: str, *, dispensable: bool
) -> TransportOrderRequest:
    """Return a request for an order that recharges a vehicle; ``dispensable`` if it has energy left."""
    return TransportOrderRequest(
        destinations=(Destination(location_name=location, operation=operation),),
        intended_vehicle=vehicle,
        type=RECHARGE_TYPE,
        dispensable=dispensable,
        on_failure=JUST_FAIL,
    )


def is_automatic_recharge(order: TransportOrder) -> bool:
    """Return whether this is an order that the order service created to recharge a vehicle."""
    return order.status.automatic and order.status.type == RECHARGE_TYPE


def automatic_name(request: TransportOrderRequest) -> str:
    """Return a unique name for the order of such a request."""
    return f"{PREFIXES[request.type]}{sortable_id()}"
