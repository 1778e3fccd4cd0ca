"""Operations on vehicles."""

from __future__ import annotations

from http import HTTPStatus
from typing import Final

from nena_shared.fleet_api import requests, transport_order
from nena_shared.fleet_api.operations.operation import ORDERS, VEHICLES, Operation
from nena_shared.fleet_api.operations.orders import NEW_ORDER_REFUSALS
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.vehicle import ReroutingAnswer, VehicleStatus

_CHANGE: Final = (Refusal.UNKNOWN_VEHICLE, Refusal.NOT_SAVED)

LIST_VEHICLES = Operation(
    "vehicles",
    "List the vehicles, also robots that are not in the plant model.",
    "GET",
    VEHICLES,
    requests.VehicleList,
    request=requests.VehiclesQuery,
    refusals=(Refusal.UNKNOWN_VEHICLE,),
)

SHOW_VEHICLE = Operation(
    "vehicle",
    "Return a vehicle.",
    "GET",
    f"{VEHICLES}/{{name:path}}",
    VehicleStatus,
    refusals=(Refusal.UNKNOWN_VEHICLE,),
)

INTEGRATION_LEVEL = Operation(
    "integrationLevel",
    "Set the integration level of a vehicle: whether it gets orders, and whether others avoid it.",
    "PUT",
    f"{VEHICLES}/{{name:path}}/integrationLevel",
    VehicleStatus,
    request=requests.IntegrationLevelRequest,
    result="vehicle",
    refusals=_CHANGE,
)

ORDER_TYPES = Operation(
    "acceptableOrderTypes",
    "Set the order types that a vehicle accepts. It finishes its current order.",
    "PUT",
    f"{VEHICLES}/{{name:path}}/acceptableOrderTypes",
    VehicleStatus,
    request=requests.OrderTypesRequest,
    result="vehicle",
    refusals=_CHANGE,
)

DISPATCH = Operation(
    "dispatch",
    "Send a vehicle to a point, location or coordinate with a new transport order.",
    "POST",
    f"{VEHICLES}/{{name:path}}/dispatch",
    transport_order.TransportOrderStatus,
    request=requests.DispatchRequest,
    creates=ORDERS,
    result="transport_order",
    refusals=(*NEW_ORDER_REFUSALS, Refusal.UNKNOWN_VEHICLE),
)

INSTANT_ACTION = Operation(
    "instantAction",
    "Send an instant action to a vehicle and wait for its end, up to a timeout.",
    "POST",
    f"{VEHICLES}/{{name:path}}/instantActions",
    requests.InstantActionAnswer,
    request=requests.InstantActionRequest,
    also={HTTPStatus.ACCEPTED: "It is still running."},
    result="instant_action",
    refusals=(
        Refusal.UNKNOWN_VEHICLE,
        Refusal.NOT_REACHED,
        Refusal.VEHICLE_BUSY,
        Refusal.VEHICLE_STOPPED,
    ),
)

REROUTE = Operation(
    "reroute",
    "Replan the route of a vehicle's current order, from the end of its base.",
    "POST",
    f"{VEHICLES}/{{name:path}}/rerouting",
    ReroutingAnswer,
    request=requests.ReroutingRequest,
    result="rerouting",
    refusals=(*_CHANGE, Refusal.NOT_REROUTABLE, Refusal.NOT_REACHED),
)
