"""Why the order service rejects a request: each reason with its HTTP status."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from http import HTTPStatus


class Refusal(Enum):
    """A reason to reject a request, with its HTTP status and description."""

    NAME_TAKEN = HTTPStatus.CONFLICT, "The name is taken."
    KEY_REUSED = HTTPStatus.UNPROCESSABLE_ENTITY, "The idempotency key was used for a different request."
    NOT_IN_PLANT = HTTPStatus.UNPROCESSABLE_ENTITY, "The request does not fit the plant model."
    UNKNOWN_IN_PLANT = HTTPStatus.NOT_FOUND, "The request names something unknown to the plant model."
    UNKNOWN_ORDER = HTTPStatus.NOT_FOUND, "Unknown transport order."
    UNKNOWN_DEPENDENCY = HTTPStatus.NOT_FOUND, "Unknown dependency."
    ORDER_ENDED = HTTPStatus.CONFLICT, "The transport order has ended."
    ORDER_WITHDRAWN = HTTPStatus.CONFLICT, "The transport order is withdrawn."
    UNKNOWN_SEQUENCE = HTTPStatus.NOT_FOUND, "Unknown order sequence."
    SEQUENCE_REFUSES = HTTPStatus.CONFLICT, "The order sequence refuses the order."
    VERSION_CHANGED = HTTPStatus.PRECONDITION_FAILED, "The object has another version."
    UNKNOWN_VEHICLE = HTTPStatus.NOT_FOUND, "Unknown vehicle."
    NOT_REACHED = HTTPStatus.CONFLICT, "The vehicle cannot be reached."
    VEHICLE_BUSY = HTTPStatus.CONFLICT, "The vehicle has an order."
    NOT_REROUTABLE = HTTPStatus.CONFLICT, "The vehicle has no order that can be rerouted."
    UNKNOWN_POINT = HTTPStatus.NOT_FOUND, "Unknown point."
    UNKNOWN_LOCATION = HTTPStatus.NOT_FOUND, "Unknown location."
    UNKNOWN_PATH = HTTPStatus.NOT_FOUND, "Unknown path."
    UNKNOWN_STOP = HTTPStatus.NOT_FOUND, "Unknown stop."
    TOO_MANY_STOPS = HTTPStatus.CONFLICT, "Too many stops are active."
    VEHICLE_STOPPED = HTTPStatus.CONFLICT, "A stop pauses the vehicle."
    UNKNOWN_ZONE_SET = HTTPStatus.NOT_FOUND, "Unknown zone set."
    ZONE_SET_CHANGED = HTTPStatus.CONFLICT, "A different zone set has this id."
    UNKNOWN_PERIPHERAL = HTTPStatus.NOT_FOUND, "Unknown peripheral device."
    UNKNOWN_JOB = HTTPStatus.NOT_FOUND, "Unknown peripheral job."
    JOB_ENDED = HTTPStatus.CONFLICT, "The peripheral job has ended."
    INVALID_PLANT = HTTPStatus.UNPROCESSABLE_ENTITY, "The plant model is invalid."
    PLANT_IN_USE = HTTPStatus.CONFLICT, "Orders or vehicles use elements missing in the new plant model."
    UNKNOWN_SCHEDULE = HTTPStatus.NOT_FOUND, "Unknown schedule."
    INVALID_SCHEDULE = HTTPStatus.UNPROCESSABLE_ENTITY, "The schedule is invalid."
    TOO_MANY_SCHEDULES = HTTPStatus.CONFLICT, "There are too many schedules."
    TOO_MANY_CLIENTS = HTTPStatus.SERVICE_UNAVAILABLE, "The event stream has too many clients."
    NOT_SAVED = HTTPStatus.SERVICE_UNAVAILABLE, "The database is unavailable; nothing was saved."

    def __init__(self, status: HTTPStatus, meaning: str) -> None:
        self.status = status
        self.meaning = meaning


def by_status(refusals: Iterable[Refusal]) -> dict[HTTPStatus, str]:
    """Return the descriptions of refusals by HTTP status."""
    found: dict[HTTPStatus, str] = {}
    for each in sorted(refusals, key=lambda each: each.status):
        found[each.status] = f"{found[each.status]} {each.meaning}" if each.status in found else each.meaning
    return found
