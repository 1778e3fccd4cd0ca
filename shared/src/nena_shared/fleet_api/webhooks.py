"""Web hooks of the order service, as hosts see them."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Moment, Resource
from nena_shared.fleet_api.transport_order import TransportOrderState


class WebhookState(StrEnum):
    """State of a web hook."""

    DELIVERING = "DELIVERING"
    """The last message was delivered, or none has been sent yet."""
    RETRYING = "RETRYING"
    """The receiver does not accept the current message; later ones wait."""
    # by Standard Webhooks, 410 means that the receiver wants no more messages
    DISABLED = "DISABLED"
    """The receiver answered 410 (Gone). Messages are sent again after a restart or a change of the plant."""


class WebhookAttempt(Resource):
    """One attempt to deliver a message."""

    timestamp: Moment
    message: str
    """ID of the message, the header ``webhook-id``."""
    transport_order: str
    state: TransportOrderState
    result: str
    """HTTP status of the answer, or why there is none."""
    delivered: bool


class WebhookStatus(Resource):
    """A web hook."""

    name: str
    url: str
    """Without user and query, which may be secret."""
    state: WebhookState
    reason: str
    """Why the last attempt failed; empty if it succeeded."""
    next_attempt: Moment | None
    delivered: int
    """Number of messages delivered since the start."""
    dropped: int
    """Number of messages given up since the start."""
    attempts: tuple[WebhookAttempt, ...]
    """The last attempts, newest first."""


class WebhookList(Resource):
    """All web hooks."""

    webhooks: tuple[WebhookStatus, ...]
