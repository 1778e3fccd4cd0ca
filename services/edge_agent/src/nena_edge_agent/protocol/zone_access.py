"""Requests to enter RELEASE zones, and what fleet control answers (sections 6.4.3 and 6.9)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from nena_edge_agent.protocol.zone_sets import EnabledZone
from nena_shared.vda5050.request import RequestStatus, ZoneRequest, ZoneRequestType
from nena_shared.vda5050.responses import GrantType, Response

LOST: Final = frozenset({RequestStatus.REVOKED, RequestStatus.EXPIRED})
PAUSE_AFTER_REFUSAL: Final = 10.0
"""Seconds after a refusal until the robot asks again, if it still wants in."""

ZoneKey = tuple[str, str]


@dataclass(frozen=True, slots=True)
class AccessRequest:
    """One request; ``lease_expiry`` (UTC) is when a grant ends, None: not by itself."""

    zone_set_id: str
    zone_id: str
    request_id: str
    status: RequestStatus = RequestStatus.REQUESTED
    lease_expiry: datetime | None = None

    @property
    def key(self) -> ZoneKey:
        """The zone."""
        return self.zone_set_id, self.zone_id

    def with_status(self, status: RequestStatus, lease_expiry: datetime | None = None) -> AccessRequest:
        """Give it with another status."""
        return AccessRequest(self.zone_set_id, self.zone_id, self.request_id, status, lease_expiry)


class ZoneAccess:
    """The active requests, at most one for each zone; their ids are not used twice."""

    def __init__(self, requests: Iterable[AccessRequest] = (), last_number: int = 0) -> None:
        self._requests = {each.key: each for each in requests}
        self._refused: dict[ZoneKey, float] = {}
        self.last_number = last_number
        self.revision = 0

    @property
    def requests(self) -> tuple[AccessRequest, ...]:
        """All active requests."""
        return tuple(self._requests.values())

    @property
    def states(self) -> tuple[ZoneRequest, ...]:
        """As the state message shows them."""
        return tuple(
            ZoneRequest(
                request_id=each.request_id,
                request_type=ZoneRequestType.ACCESS,
                zone_id=each.zone_id,
                zone_set_id=each.zone_set_id,
                request_status=each.status,
            )
            for each in self._requests.values()
        )

    @property
    def waits(self) -> bool:
        """Whether time alone may change something."""
        return bool(self._refused) or any(each.lease_expiry for each in self._requests.values())

    def status(self, key: ZoneKey) -> RequestStatus | None:
        """Give where the request for a zone stands, None if there is none."""
        request = self._requests.get(key)
        return request.status if request else None

    def answer(self, response: Response, inside: frozenset[ZoneKey], now: float) -> None:
        """Take in what fleet control says at ``now`` (s); the robot is in the zones ``inside``.

        An answer to a request that is not active any more is passed over.
        """
        request = next((e for e in self._requests.values() if e.request_id == response.request_id), None)
        if request is None:
            return
        match response.grant_type:
            case GrantType.GRANTED:
                self._put(request.with_status(RequestStatus.GRANTED, response.lease_expiry))
            case GrantType.REJECTED:
                begun = request.status is not RequestStatus.REQUESTED
                self._lose(request, RequestStatus.REVOKED, inside if begun else frozenset())
                if request.key not in self._requests:
                    self._refused[request.key] = now
            case GrantType.REVOKED:
                self._lose(request, RequestStatus.REVOKED, inside)
            case GrantType.QUEUED:
                pass  # the request goes on to stand as REQUESTED: 3.0.0 knows no other word for it

    def want(self, zones: Iterable[EnabledZone], now: float) -> None:
        """Ask for each of ``zones`` that nothing is asked for yet, unless that was refused a moment ago."""
        self._refused = {k: since for k, since in self._refused.items() if now - since < PAUSE_AFTER_REFUSAL}
        for zone in zones:
            if zone.key not in self._requests and zone.key not in self._refused:
                self.last_number += 1
                self._put(AccessRequest(*zone.key, request_id=f"zone-{self.last_number}"))

    def keep_only(self, keys: frozenset[ZoneKey], inside: frozenset[ZoneKey] = frozenset()) -> None:
        """Take back all requests but those for ``keys``; a lost one only stands while the robot is inside."""
        for key, request in list(self._requests.items()):
            if key not in keys or (request.status in LOST and key not in inside):
                self._remove(key)

    def expire(self, utc: datetime, inside: frozenset[ZoneKey]) -> None:
        """End the grants whose time is over at ``utc``."""
        for request in list(self._requests.values()):
            over = request.lease_expiry is not None and request.lease_expiry <= utc
            if over and request.status is RequestStatus.GRANTED:
                self._lose(request, RequestStatus.EXPIRED, inside)

    def _lose(self, request: AccessRequest, status: RequestStatus, inside: frozenset[ZoneKey]) -> None:
        """Show the loss while the robot is in the zone; one that is not in it has nothing to show."""
        if request.key in inside:
            self._put(request.with_status(status))
        else:
            self._remove(request.key)

    def _put(self, request: AccessRequest) -> None:
        if self._requests.get(request.key) != request:
            self._requests[request.key] = request
            self.revision += 1

    def _remove(self, key: ZoneKey) -> None:
        if self._requests.pop(key, None):
            self.revision += 1
