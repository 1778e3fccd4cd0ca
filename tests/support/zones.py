"""Zones and zone sets for tests."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from nena_shared.vda5050.responses import GrantType, Response, Responses
from nena_shared.vda5050.zone_set import Vertex, Zone, ZoneSet, ZoneSetTransfer, ZoneType
from support.robot_core import HEADER, MAP


def zone(
    zone_id: str, kind: str, left: float, right: float, *, low: float = -5.0, high: float = 5.0, **fields: Any
) -> Zone:
    """Make a zone from x = ``left`` to ``right`` m and y = ``low`` to ``high`` m, across the tests' way."""
    corners = ((left, low), (right, low), (right, high), (left, high))
    return Zone(
        zone_id=zone_id,
        zone_type=ZoneType(kind),
        vertices=tuple(Vertex(x=x, y=y) for x, y in corners),
        **fields,
    )


def zone_set(*zones: Zone, zone_set_id: str = "s1", map_id: str = MAP) -> ZoneSet:
    return ZoneSet(map_id=map_id, zone_set_id=zone_set_id, zones=zones)


def transfer(*zones: Zone, **fields: Any) -> ZoneSetTransfer:
    return ZoneSetTransfer(**HEADER, zone_set=zone_set(*zones, **fields))


def responses(request_id: str, grant: str, lease_expiry: datetime | None = None) -> Responses:
    answer = Response(request_id=request_id, grant_type=GrantType(grant), lease_expiry=lease_expiry)
    return Responses(**HEADER, responses=(answer,))
