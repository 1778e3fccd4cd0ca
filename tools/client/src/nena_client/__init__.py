"""Python client of the order service. ``docs/client.md`` has examples."""

from nena_client.client import AsyncClient, Client
from nena_client.exchange import Event, RefusedError, ServiceState, UnreachableError
from nena_shared.fleet_api import operations
from nena_shared.fleet_api.transport_order import (
    Destination,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus

__all__ = [
    "AsyncClient",
    "Client",
    "Destination",
    "Event",
    "RefusedError",
    "ServiceState",
    "TransportOrderRequest",
    "TransportOrderState",
    "TransportOrderStatus",
    "UnreachableError",
    "VehicleStatus",
    "operations",
]
