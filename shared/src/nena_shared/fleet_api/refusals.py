"""Why the order service rejects a request: each reason with its HTTP status."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from http import HTTPStatus
from typing import Final

PROBLEMS: Final = "/problems"
"""Path under which the order service describes each problem type."""


class ProblemType(Enum):
    """A kind of problem (RFC 9457) with its HTTP status, description and remedy."""

    def __init__(self, status: HTTPStatus, meaning: str, remedy: str) -> None:
        self.status = status
        self.meaning = meaning
        self.remedy = remedy

    @property
    def uri(self) -> str:
        """Return the ``type`` of problems: a relative reference that never changes."""
        return f"{PROBLEMS}/{self.name.lower().replace('_', '-')}"


class MalformedRequest(ProblemType):
    """A request that no operation can read, or a fault of the service."""

    NOT_JSON = (
        HTTPStatus.BAD_REQUEST,
        "The body is not JSON.",
        "Send a JSON object with `Content-Type: application/json`.",
    )
    INVALID_REQUEST = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The request does not fit its description.",
        "Fix what `errors` lists; `/docs` describes each request.",
    )
    UNKNOWN_RESOURCE = (
        HTTPStatus.NOT_FOUND,
        "The service has nothing at this path.",
        "Check the path; `/docs` lists the operations.",
    )
    INTERNAL_ERROR = (
        HTTPStatus.INTERNAL_SERVER_ERROR,
        "The order service failed.",
        "Look at its log, and report the error.",
    )


class Refusal(ProblemType):
    """A reason to reject a request."""

    NAME_TAKEN = (
        HTTPStatus.CONFLICT,
        "The name is taken.",
        "Choose another name, or set `incompleteName` to have a suffix added. Names are never reused.",
    )
    # 422, as the IETF's draft of the header Idempotency-Key recommends
    KEY_REUSED = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The idempotency key was used for a different request.",
        "Use a new key for a new request. To repeat a request, send the same body.",
    )
    NOT_IN_PLANT = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The request does not fit the plant model.",
        "Fix what `errors` lists; `/v1/points`, `/v1/locations` and `/v1/vehicles` list the names.",
    )
    # 404, as openTCS's web API answers orders with unknown names
    UNKNOWN_IN_PLANT = (
        HTTPStatus.NOT_FOUND,
        "The request names something unknown to the plant model.",
        "Fix the names that `errors` lists, or activate a plant model that has them.",
    )
    UNKNOWN_ORDER = (
        HTTPStatus.NOT_FOUND,
        "Unknown transport order.",
        "Check the name; `/v1/transportOrders` lists the orders.",
    )
    UNKNOWN_DEPENDENCY = (
        HTTPStatus.NOT_FOUND,
        "Unknown dependency.",
        "Create the dependencies first, or correct `dependencies`.",
    )
    ORDER_ENDED = (
        HTTPStatus.CONFLICT,
        "The transport order has ended.",
        "Nothing: the order is in a final state. Create a new order if its work is still needed.",
    )
    ORDER_ASSIGNED = (
        HTTPStatus.CONFLICT,
        "The transport order can no longer be changed in this way.",
        "Withdraw the order and create another one with the new values.",
    )
    ORDER_WITHDRAWN = (
        HTTPStatus.CONFLICT,
        "The transport order is withdrawn.",
        "Wait: the order ends when its vehicle has released it.",
    )
    UNKNOWN_SEQUENCE = (
        HTTPStatus.NOT_FOUND,
        "Unknown order sequence.",
        "Check the name; `/v1/orderSequences` lists the sequences.",
    )
    SEQUENCE_REFUSES = (
        HTTPStatus.CONFLICT,
        "The order sequence refuses the order.",
        "Read `detail`: the sequence is complete, or has other order types or another vehicle.",
    )
    # RFC 9110, 13.1.1: the answer to an If-Match that does not match
    VERSION_CHANGED = (
        HTTPStatus.PRECONDITION_FAILED,
        "The object has another version.",
        "Fetch the latest version, decide again, and retry with its `ETag` in `If-Match`.",
    )
    UNKNOWN_VEHICLE = (
        HTTPStatus.NOT_FOUND,
        "Unknown vehicle.",
        "Check the name; `/v1/vehicles` lists the vehicles.",
    )
    NOT_REACHED = (
        HTTPStatus.CONFLICT,
        "The vehicle cannot be reached.",
        "Retry when the vehicle is online. Check its edge agent, network and broker.",
    )
    VEHICLE_BUSY = (
        HTTPStatus.CONFLICT,
        "The vehicle has an order.",
        "Wait until the vehicle is idle, or withdraw its order.",
    )
    NOT_REROUTABLE = (
        HTTPStatus.CONFLICT,
        "The vehicle has no order that can be rerouted.",
        "Read `detail`; the vehicle shows its order and state.",
    )
    UNKNOWN_POINT = (
        HTTPStatus.NOT_FOUND,
        "Unknown point.",
        "Check the name; `/v1/points` lists the points.",
    )
    UNKNOWN_LOCATION = (
        HTTPStatus.NOT_FOUND,
        "Unknown location.",
        "Check the name; `/v1/locations` lists the locations.",
    )
    UNKNOWN_PATH = (
        HTTPStatus.NOT_FOUND,
        "Unknown path.",
        "Check the name; `/v1/paths` lists the paths.",
    )
    UNKNOWN_STOP = (
        HTTPStatus.NOT_FOUND,
        "Unknown stop.",
        "Check the name; `/v1/stops` lists the active stops. The stop may have been ended.",
    )
    TOO_MANY_STOPS = (
        HTTPStatus.CONFLICT,
        "Too many stops are active.",
        "End a stop that is no longer needed.",
    )
    VEHICLE_STOPPED = (
        HTTPStatus.CONFLICT,
        "A stop pauses the vehicle.",
        "End the stop first; `/v1/stops` lists the active stops.",
    )
    UNKNOWN_ZONE_SET = (
        HTTPStatus.NOT_FOUND,
        "Unknown zone set.",
        "Check the ID; `/v1/zoneSets` lists the zone sets.",
    )
    ZONE_SET_CHANGED = (
        HTTPStatus.CONFLICT,
        "A different zone set has this id.",
        "Choose a new `zoneSetId`: a stored zone set never changes.",
    )
    UNKNOWN_PERIPHERAL = (
        HTTPStatus.NOT_FOUND,
        "Unknown peripheral device.",
        "Check the location; `/v1/peripherals` lists the devices.",
    )
    UNKNOWN_JOB = (
        HTTPStatus.NOT_FOUND,
        "Unknown peripheral job.",
        "Check the name; `/v1/peripheralJobs` lists the jobs.",
    )
    JOB_ENDED = (
        HTTPStatus.CONFLICT,
        "The peripheral job has ended.",
        "Nothing: the job is in a final state. Create a new job if it is still needed.",
    )
    INVALID_PLANT = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The plant model is invalid.",
        "Fix what `errors` lists. `nena plant check FILE` finds the same problems without a service.",
    )
    PLANT_IN_USE = (
        HTTPStatus.CONFLICT,
        "Orders or vehicles use elements missing in the new plant model.",
        "Wait for the orders to end, withdraw them, or keep the elements that `errors` lists.",
    )
    UNKNOWN_PLANT_DRAFT = (
        HTTPStatus.NOT_FOUND,
        "Unknown draft or version of the plant model.",
        "Check the name; `/v1/plantDrafts` lists the drafts, `/v1/plantVersions` the versions.",
    )
    PLANT_DRAFT_CHANGED = (
        HTTPStatus.CONFLICT,
        "Somebody else has saved the draft.",
        "Fetch the draft and make your changes in it, or save yours under another name.",
    )
    TOO_MANY_PLANT_DRAFTS = (
        HTTPStatus.CONFLICT,
        "There are too many drafts of the plant model.",
        "Delete a draft that is no longer needed.",
    )
    PLANT_RUN_GOES_ON = (
        HTTPStatus.CONFLICT,
        "Another program runs on a draft of the plant model.",
        "Wait for its end, or cancel it.",
    )
    UNKNOWN_SCHEDULE = (
        HTTPStatus.NOT_FOUND,
        "Unknown schedule.",
        "Check the name; `/v1/schedules` lists the schedules.",
    )
    INVALID_SCHEDULE = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The schedule is invalid.",
        "Fix what `errors` lists: name, cron expression, time zone or validity.",
    )
    TOO_MANY_SCHEDULES = (
        HTTPStatus.CONFLICT,
        "There are too many schedules.",
        "Delete a schedule that is no longer needed.",
    )
    TOO_MANY_CLIENTS = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "The event stream has too many clients.",
        "Try again later, or raise the setting `events.clients`.",
    )
    NO_BLACK_BOX = (
        HTTPStatus.CONFLICT,
        "The order service has no black box.",
        "Set `black_box.enabled`, and restart the order service.",
    )
    RECORDING_NOT_WRITTEN = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "The recording could not be written.",
        "Check the disk of the order service, and `upload.folder`.",
    )
    NOT_SAVED = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "The database is unavailable; nothing was saved.",
        "Retry with the same idempotency key; `/readyz` shows when the database is available again.",
    )


TYPES: Final[Mapping[str, ProblemType]] = {request.uri: request for request in (*MalformedRequest, *Refusal)}
"""All types of problems by URI. Other problems have the type ``about:blank``: their status says all."""


def by_status(refusals: Iterable[Refusal]) -> dict[HTTPStatus, str]:
    """Return the descriptions of refusals by HTTP status."""
    meanings: dict[HTTPStatus, str] = {}
    for refusal in sorted(refusals, key=lambda refusal: refusal.status):
        earlier = f"{meanings[refusal.status]} " if refusal.status in meanings else ""
        meanings[refusal.status] = f"{earlier}{refusal.meaning}"
    return meanings
