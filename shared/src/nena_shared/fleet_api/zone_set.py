"""Zone sets of VDA 5050 3.0 as hosts put them here, and how far they have come at the robots."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Resource


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
