"""Zone sets on the robot, and its requests to enter zones (sections 6.4 and 6.9)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from nena_edge_agent.protocol.geometry import (
    BoundingBox,
    Polygon,
    bounding_box,
    boxes_intersect,
    is_simple,
    polygons_overlap,
)
from nena_shared.vda5050.request import RequestStatus, ZoneRequest, ZoneRequestType
from nena_shared.vda5050.responses import GrantType, Response
from nena_shared.vda5050.state import RobotZoneSetStatus, ZoneSetState
from nena_shared.vda5050.zone_set import Zone, ZoneSet, ZoneType

CLOSED = (ZoneType.BLOCKED, ZoneType.LINE_GUIDED)
"""Zones that a freely navigating robot must not enter, because it does not follow lines."""


def zones_in(area: Iterable[Polygon], map_id: str, zones: Iterable[EnabledZone]) -> list[EnabledZone]:
    """Return the zones of one map that intersect ``area``."""
    parts = [(part, bounding_box(part)) for part in area]
    return [
        enabled
        for enabled in zones
        if enabled.map_id == map_id
        and any(
            boxes_intersect(box, enabled.bounding_box) and polygons_overlap(part, enabled.contour)
            for part, box in parts
        )
    ]


def first_closed(zones: Iterable[EnabledZone]) -> EnabledZone | None:
    """Return the first of ``zones`` that the robot must not enter."""
    return next((zone for zone in zones if zone.zone.zone_type in CLOSED), None)


MAXIMUM_ZONE_SETS: Final = 10
MAXIMUM_ZONES: Final = 200
MAXIMUM_VERTICES: Final = 100


class ZoneSetRefusedError(Exception):
    """A zone set cannot be added, enabled or deleted; the message contains the reason."""


class DuplicateZoneSetError(ZoneSetRefusedError):
    """A zone set with this ID exists, whose content must not change (section 6.4.1)."""


class ZoneSetLimitError(ZoneSetRefusedError):
    """The maximum number of zone sets, zones or vertices is exceeded."""


@dataclass(frozen=True, slots=True)
class EnabledZone:
    """A zone of an enabled zone set (section 6.4.2); ``contour`` in m in the frame of the map."""

    map_id: str
    zone_set_id: str
    zone: Zone
    contour: Polygon
    bounding_box: BoundingBox

    @property
    def key(self) -> tuple[str, str]:
        """Return the zone's key among the zones of all sets."""
        return self.zone_set_id, self.zone.zone_id


class ZoneSets:
    """The robot's zone sets (section 6.4.2); at most one of each map is enabled."""

    def __init__(self, supported: frozenset[ZoneType]) -> None:
        self._supported = supported
        self._sets: dict[str, ZoneSet] = {}
        self._enabled: dict[str, str] = {}
        self.revision = 0
        self.enabled: tuple[EnabledZone, ...] = ()
        self.states: tuple[ZoneSetState, ...] = ()

    @property
    def held(self) -> tuple[tuple[ZoneSet, bool], ...]:
        """Return all sets, and whether each is enabled."""
        return tuple((zone_set, self._is_enabled(zone_set)) for zone_set in self._sets.values())

    def restore(self, held: tuple[tuple[ZoneSet, bool], ...]) -> None:
        """Restore what :attr:`held` returned."""
        self._sets = {zone_set.zone_set_id: zone_set for zone_set, _ in held}
        self._enabled = {zone_set.map_id: zone_set.zone_set_id for zone_set, enabled in held if enabled}
        self._note_change()

    def add(self, zone_set: ZoneSet) -> None:
        """Add a set as DISABLED (section 6.4); raises ZoneSetRefusedError if it is not accepted."""
        if zone_set.zone_set_id in self._sets:
            raise DuplicateZoneSetError(f"the robot already has a zone set '{zone_set.zone_set_id}'")
        if len(self._sets) >= MAXIMUM_ZONE_SETS or len(zone_set.zones) > MAXIMUM_ZONES:
            raise ZoneSetLimitError(
                f"the robot can store {MAXIMUM_ZONE_SETS} zone sets of {MAXIMUM_ZONES} zones each"
            )
        for zone in zone_set.zones:
            if zone.zone_type not in self._supported:
                raise ZoneSetRefusedError(
                    f"zone '{zone.zone_id}' is of type {zone.zone_type}, which the robot does not support"
                )
            if len(zone.vertices) > MAXIMUM_VERTICES:
                raise ZoneSetLimitError(f"zone '{zone.zone_id}' has more than {MAXIMUM_VERTICES} vertices")
            # A drawn contour may cross itself; then inside and outside would be undefined.
            if not is_simple(_contour_of(zone)):
                raise ZoneSetRefusedError(
                    f"the contour of zone '{zone.zone_id}' crosses itself or has no area"
                )
        self._sets[zone_set.zone_set_id] = zone_set
        self._note_change()

    def enable(self, zone_set_id: str) -> None:
        """Enable a set, and disable the other one of its map (section 6.4.2).

        Raises:
            ZoneSetRefusedError: the robot does not have it.
        """
        zone_set = self._find_zone_set(zone_set_id)
        self._enabled[zone_set.map_id] = zone_set_id
        self._note_change()

    def zones_of(self, zone_set_id: str) -> tuple[EnabledZone, ...]:
        """Return the zones that a set has once it is enabled; none if the robot does not have it."""
        zone_set = self._sets.get(zone_set_id)
        return tuple(_enabled_zone(zone_set, zone) for zone in zone_set.zones) if zone_set else ()

    def delete(self, zone_set_id: str) -> None:
        """Delete a set (section 6.2.3).

        Raises:
            ZoneSetRefusedError: the robot does not have it, or it is enabled.
        """
        if self._is_enabled(self._find_zone_set(zone_set_id)):
            raise ZoneSetRefusedError(
                f"zone set '{zone_set_id}' is enabled; enable another one of its map first"
            )
        del self._sets[zone_set_id]
        self._note_change()

    def _find_zone_set(self, zone_set_id: str) -> ZoneSet:
        if zone_set_id not in self._sets:
            raise ZoneSetRefusedError(f"the robot has no zone set '{zone_set_id}'")
        return self._sets[zone_set_id]

    def _is_enabled(self, zone_set: ZoneSet) -> bool:
        return self._enabled.get(zone_set.map_id) == zone_set.zone_set_id

    def _note_change(self) -> None:
        self.revision += 1
        self.enabled = tuple(
            _enabled_zone(zone_set, zone)
            for zone_set, enabled in self.held
            if enabled
            for zone in zone_set.zones
        )
        self.states = tuple(
            ZoneSetState(
                zone_set_id=zone_set.zone_set_id,
                map_id=zone_set.map_id,
                zone_set_status=RobotZoneSetStatus.ENABLED if enabled else RobotZoneSetStatus.DISABLED,
            )
            for zone_set, enabled in self.held
        )


def _enabled_zone(zone_set: ZoneSet, zone: Zone) -> EnabledZone:
    contour = _contour_of(zone)
    return EnabledZone(zone_set.map_id, zone_set.zone_set_id, zone, contour, bounding_box(contour))


def _contour_of(zone: Zone) -> Polygon:
    return tuple((vertex.x, vertex.y) for vertex in zone.vertices)


LOST: Final = frozenset({RequestStatus.REVOKED, RequestStatus.EXPIRED})
REQUEST_RETRY_DELAY: Final = 10.0
"""Delay after a rejection before the robot requests the zone again, seconds."""

ZoneKey = tuple[str, str]


@dataclass(frozen=True, slots=True)
class AccessRequest:
    """A request to enter a zone (section 6.9); ``lease_expiry`` (UTC) is the end of a grant, None: no end."""

    zone_set_id: str
    zone_id: str
    request_id: str
    status: RequestStatus
    lease_expiry: datetime | None

    @property
    def key(self) -> ZoneKey:
        """Return the key of the zone."""
        return self.zone_set_id, self.zone_id

    def with_status(self, status: RequestStatus, lease_expiry: datetime | None = None) -> AccessRequest:
        """Return a copy with another status."""
        return AccessRequest(self.zone_set_id, self.zone_id, self.request_id, status, lease_expiry)


class ZoneRequests:
    """The active requests, at most one per zone (section 6.9); request IDs are never used twice."""

    def __init__(self, requests: Iterable[AccessRequest] = (), last_number: int = 0) -> None:
        self._requests = {request.key: request for request in requests}
        self._rejected_at: dict[ZoneKey, float] = {}
        self.last_number = last_number
        self.revision = 0

    @property
    def requests(self) -> tuple[AccessRequest, ...]:
        """Return all active requests."""
        return tuple(self._requests.values())

    @property
    def states(self) -> tuple[ZoneRequest, ...]:
        """Return the requests as reported in the state."""
        return tuple(
            ZoneRequest(
                request_id=request.request_id,
                request_type=ZoneRequestType.ACCESS,
                zone_id=request.zone_id,
                zone_set_id=request.zone_set_id,
                request_status=request.status,
            )
            for request in self._requests.values()
        )

    @property
    def waits(self) -> bool:
        """Return whether a lease or a delay is running."""
        return bool(self._rejected_at) or any(request.lease_expiry for request in self._requests.values())

    def status(self, key: ZoneKey) -> RequestStatus | None:
        """Return the status of the request for a zone, None without a request."""
        request = self._requests.get(key)
        return request.status if request else None

    def apply(self, response: Response, inside: frozenset[ZoneKey], now: float) -> None:
        """Apply a response at the monotonic time ``now``, s; the robot is in the zones ``inside`` (6.9).

        A response to a request that is no longer active is ignored.
        """
        request = next(
            (active for active in self._requests.values() if active.request_id == response.request_id), None
        )
        if request is None:
            return
        match response.grant_type:
            case GrantType.GRANTED:
                self._put_request(request.with_status(RequestStatus.GRANTED, response.lease_expiry))
            case GrantType.REJECTED:
                # A granted request can also be rejected: then the grant is revoked.
                granted = request.status is not RequestStatus.REQUESTED
                self._end_grant(request, RequestStatus.REVOKED, inside if granted else frozenset())
                if request.key not in self._requests:
                    self._rejected_at[request.key] = now
            case GrantType.REVOKED:
                self._end_grant(request, RequestStatus.REVOKED, inside)
            case GrantType.QUEUED:
                pass  # the request stays REQUESTED: 3.0.0 has no other status for it

    def request(self, zones: Iterable[EnabledZone], now: float) -> None:
        """Request each of ``zones`` without a request, unless it was rejected recently (section 6.4.3)."""
        rejected = self._rejected_at.items()
        self._rejected_at = {key: at for key, at in rejected if now - at < REQUEST_RETRY_DELAY}
        for zone in zones:
            if zone.key not in self._requests and zone.key not in self._rejected_at:
                self.last_number += 1
                number = f"zone-{self.last_number}"
                self._put_request(AccessRequest(*zone.key, number, RequestStatus.REQUESTED, None))

    def keep_only(self, keys: frozenset[ZoneKey], inside: frozenset[ZoneKey] = frozenset()) -> None:
        """Drop all requests except those for ``keys``; keep a lost one only while the robot is inside."""
        for key, request in list(self._requests.items()):
            if key not in keys or (request.status in LOST and key not in inside):
                self._remove_request(key)

    def expire(self, utc: datetime, inside: frozenset[ZoneKey]) -> None:
        """End the grants that have expired at ``utc`` (section 6.9)."""
        for request in list(self._requests.values()):
            over = request.lease_expiry is not None and request.lease_expiry <= utc
            if over and request.status is RequestStatus.GRANTED:
                self._end_grant(request, RequestStatus.EXPIRED, inside)

    def _end_grant(self, request: AccessRequest, status: RequestStatus, inside: frozenset[ZoneKey]) -> None:
        """Report the loss of a grant while the robot is in the zone; otherwise drop the request."""
        if request.key in inside:
            self._put_request(request.with_status(status))
        else:
            self._remove_request(request.key)

    def _put_request(self, request: AccessRequest) -> None:
        if self._requests.get(request.key) != request:
            self._requests[request.key] = request
            self.revision += 1

    def _remove_request(self, key: ZoneKey) -> None:
        if self._requests.pop(key, None):
            self.revision += 1
