"""Why the status aggregator rejects a request: each reason with its HTTP status, and a page about each."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import Final

from nena_shared.fleet_api.refusals import TYPES, ProblemType

OPENAPI: Final = "/api/v1/openapi.json"


class Rejection(ProblemType):
    """A reason to reject a request."""

    UNKNOWN_ROBOT = (
        HTTPStatus.NOT_FOUND,
        "Unknown robot.",
        "`GET /api/v1/fleet` lists all known robots.",
    )
    UNKNOWN_MATTER = (
        HTTPStatus.NOT_FOUND,
        "Nothing with this ID needs a person; it may have ended.",
        "`GET /api/v1/attention` lists what does.",
    )
    NAMELESS = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The acknowledgement lacks the name of the person.",
        "Sign in, or send the name as `by`.",
    )
    NO_FACTSHEET = (
        HTTPStatus.NOT_FOUND,
        "The robot has not sent a factsheet.",
        "Request it with the instant action `factsheetRequest`.",
    )
    NO_MAP = (
        HTTPStatus.NOT_FOUND,
        "The robot has not sent a map.",
        "NeNa's edge agent publishes the map of its Nav2; other robots have none.",
    )
    NO_PLANT_MODEL = (
        HTTPStatus.NOT_FOUND,
        "No plant model was received.",
        "Start the order service with one, on the same broker and topic prefix.",
    )
    UNKNOWN_RECORDING = (
        HTTPStatus.NOT_FOUND,
        "Unknown recording.",
        "`GET /api/v1/recordings` lists all; the oldest are removed.",
    )
    RECORDINGS_DISABLED = (
        HTTPStatus.NOT_FOUND,
        "Recordings are disabled.",
        "Set `recordings.enabled` to true.",
    )
    HISTORY_DISABLED = (
        HTTPStatus.NOT_FOUND,
        "The history is disabled.",
        "Set `history.url`, e.g. to `sqlite:///nena-history.db`.",
    )
    COMMANDS_DISABLED = (
        HTTPStatus.NOT_FOUND,
        "Commands are disabled.",
        "Set `order_service.url`, e.g. to `http://127.0.0.1:55200`.",
    )
    UNKNOWN_COMMAND = (
        HTTPStatus.NOT_FOUND,
        "No command at this path is forwarded to the order service.",
        f"Check the path; `{OPENAPI}` lists what is.",
    )
    UNTRUSTED_PAGE = (
        HTTPStatus.FORBIDDEN,
        "The command comes from a page or host name that is not trusted.",
        "Open the panel by its own address; `order_service.trusted_hosts` lists the trusted host names.",
    )
    COMMAND_NOT_JSON = (
        HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
        "The command is not JSON.",
        "Send it with `Content-Type: application/json`.",
    )
    COMMAND_TOO_LONG = (
        HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
        "The command is too long.",
        "Send it to the order service itself.",
    )
    ORDER_SERVICE_UNREACHABLE = (
        HTTPStatus.BAD_GATEWAY,
        "The order service does not answer; it may have executed the command.",
        "Check that it runs and that `order_service.url` is correct. Check the order list before retrying.",
    )
    STOP_NOT_SENT = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "Neither the order service nor the MQTT broker can be reached: no robot was told to stop.",
        "Walk to the robots and press their emergency stop buttons.",
    )
    INVALID_RANGE = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The time range is not valid.",
        "`since` must be before `until` and before now, and the range at most 31 days (replay: 25 hours).",
    )
    TOO_MANY_ENTRIES = (
        HTTPStatus.UNPROCESSABLE_ENTITY,
        "The time range has too many entries for a report or replay.",
        "Request a shorter range.",
    )
    TOO_MANY_REPORTS = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "Too many reports or replays are being computed.",
        "Try again later.",
    )
    HISTORY_UNAVAILABLE = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "The database of the history is unavailable.",
        "Look at the log of the status aggregator, and try again later.",
    )
    NOT_READY = (
        HTTPStatus.SERVICE_UNAVAILABLE,
        "The MQTT broker is not connected, or has refused a subscription.",
        "Check that it runs, `mqtt.host` and `mqtt.port`, and its access list.",
    )
    TOKEN_TOO_LONG = (
        HTTPStatus.BAD_REQUEST,
        "The token is too long for a cookie.",
        "Use a shorter token, or send it with each request.",
    )
    TOO_MANY_SIGN_INS = (
        HTTPStatus.TOO_MANY_REQUESTS,
        "Too many requests to sign in.",
        "Try again in a moment.",
    )


DESCRIBED: Final[Mapping[str, ProblemType]] = {
    **TYPES,
    **{rejection.uri: rejection for rejection in Rejection},
}
"""All types by URI, also those of the order service, whose answers to commands are passed on."""
