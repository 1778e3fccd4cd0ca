"""What fleet control does with zone sets: bring, enable and delete them (sections 6.4.1 and 6.4.2)."""

from __future__ import annotations

from collections.abc import Callable

from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.zone_sets import (
    DuplicateZoneSetError,
    NoRoomForZoneSetError,
    ZoneSetRefusedError,
)
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.zone_set import ZoneSet

ZONE_SET_ID = "zoneSetId"
_TYPES: dict[type[ZoneSetRefusedError], ErrorType] = {
    DuplicateZoneSetError: ErrorType.DUPLICATE_ZONE_SET,
    NoRoomForZoneSetError: ErrorType.INSUFFICIENT_MEMORY,
}


class ZoneKeeping:
    """Changes the robot's zone sets; what is refused changes nothing."""

    def __init__(self, parts: RobotParts) -> None:
        self._parts = parts

    def take(self, zone_set: ZoneSet) -> str | None:
        """Take a set that came as a message, or that an action has brought; gives why it is refused."""
        try:
            self._parts.zone_sets.add(zone_set)
        except ZoneSetRefusedError as problem:
            self._parts.errors.show(_entry(zone_set.zone_set_id, problem), Until.ZONE_SET_TAKEN)
            return str(problem)
        self._parts.errors.end(Until.ZONE_SET_TAKEN)
        return None

    def enable(self, action: Action) -> tuple[ActionStatus, str | None]:
        """Enable the set that ``action`` names; gives how the action ends."""
        return _end(self._parts.zone_sets.enable, action)

    def delete(self, action: Action) -> tuple[ActionStatus, str | None]:
        """Delete the set that ``action`` names; gives how the action ends."""
        return _end(self._parts.zone_sets.delete, action)


def _end(change: Callable[[str], None], action: Action) -> tuple[ActionStatus, str | None]:
    try:
        change(str(action.parameter(ZONE_SET_ID)))
    except ZoneSetRefusedError as problem:
        return ActionStatus.FAILED, str(problem)
    return ActionStatus.FINISHED, None


def _entry(zone_set_id: str, problem: ZoneSetRefusedError) -> ErrorEntry:
    return error(
        _TYPES.get(type(problem), ErrorType.VALIDATION_FAILURE),
        str(problem),
        hint="the factsheet lists the zones that the robot supports; another content needs another id",
        topic="zoneSet",
        zone_set_id=zone_set_id,
    )
