"""Zone sets of VDA 5050 3.0 as hosts put them here, and how far they have come at the robots."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import AfterValidator

from nena_shared.fleet_api.base import Resource
from nena_shared.vda5050.zone_set import ZoneSet

LONGEST_ID = 200
"""Characters of a zoneSetId here; the standard has no bound, a store and a path have."""


def _addressed(zone_set: ZoneSet) -> ZoneSet:
    name = zone_set.zone_set_id
    if not 1 <= len(name) <= LONGEST_ID or not name.isprintable() or "/" in name:
        message = f"zoneSetId has to have 1 to {LONGEST_ID} printable characters, and no '/'"
        raise ValueError(message)
    return zone_set


StoredZoneSet = Annotated[ZoneSet, AfterValidator(_addressed)]
"""A zone set that can be kept and asked for by its id."""


class ZoneSetPhase(StrEnum):
    """How a zone set stands at one robot."""

    ENABLED = "ENABLED"
    DISABLED = "DISABLED"
    """It is there and not in use."""
    MISSING = "MISSING"
    """It is not there."""
    UNKNOWN = "UNKNOWN"
    """The robot has told no state."""


class ZoneSetAtVehicle(Resource):
    """A zone set at one robot."""

    vehicle: str
    phase: ZoneSetPhase
    note: str = ""
    """What was tried last, and what came of it, in words."""


class ZoneSetStatus(Resource):
    """A zone set that a host has put here."""

    zone_set_id: str
    map_id: str
    zones: int
    enabled: bool
    """Whether robots are to use it."""
    deleted: bool
    """Whether robots are to delete it."""
    vehicles: tuple[ZoneSetAtVehicle, ...]
    """The robots that know zone sets; those of VDA 5050 2.x do not."""


class ZoneSetList(Resource):
    """All zone sets."""

    zone_sets: tuple[ZoneSetStatus, ...]
