"""The responses message (VDA 5050 3.0 sections 6.9 and 7.5): fleet control's answers to requests."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.base import Header, Identifier, Timestamp, WireObject


class GrantType(StrEnum):
    """Fleet control's answer to a request (section 6.9)."""

    GRANTED = "GRANTED"
    QUEUED = "QUEUED"
    REJECTED = "REJECTED"
    REVOKED = "REVOKED"


class Response(WireObject):
    """The answer to one request (section 6.9)."""

    request_id: Identifier
    grant_type: GrantType
    lease_expiry: Timestamp | None = None
    """Time at which GRANTED expires; None: never."""


class Responses(Header):
    """Answers to the requests in a robot's state (section 6.9)."""

    responses: tuple[Response, ...]
