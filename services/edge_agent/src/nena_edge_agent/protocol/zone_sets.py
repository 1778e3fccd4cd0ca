"""The zone sets that a robot holds (sections 6.4.1 and 6.4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from nena_edge_agent.protocol.polygon import Box, Polygon, box, is_simple
from nena_shared.vda5050.state import ZoneSetState, ZoneSetStatus
from nena_shared.vda5050.zone_set import Zone, ZoneSet, ZoneType

SETS_HELD: Final = 10
ZONES_IN_A_SET: Final = 200
VERTICES_OF_A_ZONE: Final = 100


class ZoneSetRefusedError(Exception):
    """A zone set cannot be taken, enabled or deleted; the text says why."""


class DuplicateZoneSetError(ZoneSetRefusedError):
    """A set of the same id is there: what stands under an id never changes."""


class NoRoomForZoneSetError(ZoneSetRefusedError):
    """The robot holds as many zone sets as it can, or the set has more zones than it takes."""


@dataclass(frozen=True, slots=True)
class EnabledZone:
    """A zone that counts at present; ``contour`` in m in the frame of the map."""

    map_id: str
    zone_set_id: str
    zone: Zone
    contour: Polygon
    box: Box

    @property
    def key(self) -> tuple[str, str]:
        """Name it among the zones of all sets."""
        return self.zone_set_id, self.zone.zone_id


class ZoneSets:
    """Zone sets by their id; at most one of each map is enabled."""

    def __init__(self, supported: frozenset[ZoneType]) -> None:
        self._supported = supported
        self._sets: dict[str, ZoneSet] = {}
        self._enabled: dict[str, str] = {}
        self.revision = 0
        self.enabled: tuple[EnabledZone, ...] = ()
        self.states: tuple[ZoneSetState, ...] = ()

    @property
    def held(self) -> tuple[tuple[ZoneSet, bool], ...]:
        """All sets, each with whether it is enabled."""
        return tuple((each, self._is_enabled(each)) for each in self._sets.values())

    def restore(self, held: tuple[tuple[ZoneSet, bool], ...]) -> None:
        """Hold again what :attr:`held` gave."""
        self._sets = {each.zone_set_id: each for each, _ in held}
        self._enabled = {each.map_id: each.zone_set_id for each, enabled in held if enabled}
        self._changed()

    def add(self, zone_set: ZoneSet) -> None:
        """Take a set, DISABLED.

        Raises:
            ZoneSetRefusedError: it is not taken.

        """
        if zone_set.zone_set_id in self._sets:
            message = f"the robot holds a zone set '{zone_set.zone_set_id}' already"
            raise DuplicateZoneSetError(message)
        if len(self._sets) >= SETS_HELD or len(zone_set.zones) > ZONES_IN_A_SET:
            message = f"the robot holds {SETS_HELD} zone sets of {ZONES_IN_A_SET} zones each, at most"
            raise NoRoomForZoneSetError(message)
        for zone in zone_set.zones:
            self._check(zone)
        self._sets[zone_set.zone_set_id] = zone_set
        self._changed()

    def enable(self, zone_set_id: str) -> None:
        """Have a set count in place of the one that did for its map.

        Raises:
            ZoneSetRefusedError: the robot does not hold it.

        """
        zone_set = self._find(zone_set_id)
        self._enabled[zone_set.map_id] = zone_set_id
        self._changed()

    def delete(self, zone_set_id: str) -> None:
        """Forget a set.

        Raises:
            ZoneSetRefusedError: the robot does not hold it, or it is enabled.

        """
        if self._is_enabled(self._find(zone_set_id)):
            message = f"zone set '{zone_set_id}' is enabled; enable another one of its map first"
            raise ZoneSetRefusedError(message)
        del self._sets[zone_set_id]
        self._changed()

    def _find(self, zone_set_id: str) -> ZoneSet:
        if zone_set_id not in self._sets:
            message = f"the robot holds no zone set '{zone_set_id}'"
            raise ZoneSetRefusedError(message)
        return self._sets[zone_set_id]

    def _check(self, zone: Zone) -> None:
        if zone.zone_type not in self._supported:
            message = f"zone '{zone.zone_id}' is of type {zone.zone_type}, which the robot does not support"
            raise ZoneSetRefusedError(message)
        if len(zone.vertices) > VERTICES_OF_A_ZONE:
            message = f"zone '{zone.zone_id}' has more than {VERTICES_OF_A_ZONE} vertices"
            raise NoRoomForZoneSetError(message)
        if not is_simple(_contour(zone)):
            message = f"the contour of zone '{zone.zone_id}' crosses itself, or holds no ground"
            raise ZoneSetRefusedError(message)

    def _is_enabled(self, zone_set: ZoneSet) -> bool:
        return self._enabled.get(zone_set.map_id) == zone_set.zone_set_id

    def _changed(self) -> None:
        self.revision += 1
        self.enabled = tuple(
            _counting(each, zone) for each, enabled in self.held if enabled for zone in each.zones
        )
        self.states = tuple(
            ZoneSetState(
                zone_set_id=each.zone_set_id,
                map_id=each.map_id,
                zone_set_status=ZoneSetStatus.ENABLED if enabled else ZoneSetStatus.DISABLED,
            )
            for each, enabled in self.held
        )


def _counting(zone_set: ZoneSet, zone: Zone) -> EnabledZone:
    contour = _contour(zone)
    return EnabledZone(zone_set.map_id, zone_set.zone_set_id, zone, contour, box(contour))


def _contour(zone: Zone) -> Polygon:
    return tuple((vertex.x, vertex.y) for vertex in zone.vertices)
