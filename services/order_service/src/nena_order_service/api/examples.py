"""Examples of bodies and answers in the OpenAPI document, by operation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api.operations import Operation

_ORDER: Final = {
    "name": "Pallet-4711",
    "idempotencyKey": "wms-4711",
    "destinations": [
        {"locationName": "Goods in", "operation": "Load cargo"},
        {"locationName": "Storage", "operation": "Unload cargo"},
    ],
}
_ZONE_SET: Final = {
    "zoneSetId": "night",
    "mapId": "hall",
    "zones": [
        {
            "zoneId": "aisle-3",
            "zoneType": "SPEED_LIMIT",
            "vertices": [{"x": 2, "y": 0}, {"x": 8, "y": 0}, {"x": 8, "y": 4}],
            "maximumSpeed": 0.5,
        }
    ],
}
_SCHEDULE: Final = {
    "transportOrder": {"destinations": _ORDER["destinations"], "timeout": 3600},
    "cron": "30 6 * * MON-FRI",
    "timeZone": "Europe/Berlin",
    "catchUp": 1,
}
_POINT: Final = {
    "name": "Packing stand",
    "type": "HALT_POSITION",
    "x": 23.0,
    "y": 7.0,
    "theta": 0.0,
    "mapId": "hall",
    "locations": ["Packing"],
    "occupiedBy": ["Robot-01"],
    "reservedBy": ["Robot-01"],
}
_LOCATION: Final = {
    "name": "Packing",
    "type": "Transfer station",
    "x": 23.6,
    "y": 7.0,
    "locked": False,
    "operations": ["Load cargo", "Unload cargo"],
    "peripheralOperations": [],
    "links": [{"point": "Packing stand", "operations": ["Load cargo", "Unload cargo"]}],
}

BODIES: Final[Mapping[str, Any]] = {
    operation.name: example
    for operation, example in (
        (table.CREATE_ORDER, _ORDER),
        (table.CREATE_ORDERS, {"transportOrders": [_ORDER], "checkOnly": True}),
        (table.WITHDRAW, {"reason": "customer cancelled"}),
        (table.HOLD, {"by": "Anna", "reason": "aisle is blocked"}),
        (table.RESUME, {"by": "Anna", "reason": "aisle is free"}),
        (table.CREATE_SEQUENCE, {"name": "Tour-1", "failureFatal": True}),
        (table.INTEGRATION_LEVEL, {"integrationLevel": "TO_BE_RESPECTED"}),
        (table.ORDER_TYPES, {"acceptableOrderTypes": [{"name": "Transport", "priority": 1}]}),
        (table.DISPATCH, {"point": "Parking bay"}),
        (table.INSTANT_ACTION, {"actionType": "pause"}),
        (table.REROUTE, {"type": "REGULAR"}),
        (table.LOCK_PATH, {"locked": True}),
        (table.STOP, {"by": "Anna", "reason": "oil on the floor"}),
        (table.END_STOP, {"by": "Ben", "reason": "cleaned"}),
        (table.PUT_ZONE_SET, _ZONE_SET),
        (table.PUT_SCHEDULE, _SCHEDULE),
        (table.ENABLE_SCHEDULE, {"enabled": False}),
        (table.CREATE_JOB, {"location": "Door 1", "operation": "open", "reservationToken": "host"}),
    )
}
"""Bodies of requests."""

ANSWERS: Final[Mapping[str, Any]] = {
    operation.name: example
    for operation, example in (
        (table.LIST_POINTS, {"points": [_POINT], "next": "Packing stand"}),
        (table.SHOW_POINT, _POINT),
        (table.LIST_LOCATIONS, {"locations": [_LOCATION], "next": "Packing"}),
        (table.SHOW_LOCATION, _LOCATION),
    )
}
"""Answers of operations whose fields need no long history to be understood."""


def examples_of(operation: Operation[Any], status: int) -> dict[str, Any]:
    """Return the parts of an operation's OpenAPI description with its examples; ``status``: of its answer."""

    def content(example: object) -> dict[str, Any]:
        return {"content": {"application/json": {"example": example}}}

    found: dict[str, Any] = {}
    if operation.name in BODIES:
        found["requestBody"] = content(BODIES[operation.name])
    if operation.name in ANSWERS:
        found["responses"] = {str(status): content(ANSWERS[operation.name])}
    return found
