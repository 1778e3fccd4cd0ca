"""The maps that robots have, by their states (VDA 5050 3.0 section 6.3; since 2.1)."""

from __future__ import annotations

from functools import lru_cache

from nena_order_service.fleet.reported import State
from nena_shared.fleet_api.vehicle import RobotMap
from nena_shared.vda5050.state import MapStatus

COMBINATIONS_KEPT = 1000
"""Robots of a fleet have the same maps: few are made for many states."""


def robot_maps(state: State) -> tuple[RobotMap, ...] | None:
    """Give the maps of a robot; None where it does not tell of any."""
    if state.maps is None:
        return None
    return _maps(tuple((each.map_id, each.map_version, each.map_status) for each in state.maps))


@lru_cache(COMBINATIONS_KEPT)
def _maps(told: tuple[tuple[str, str, MapStatus], ...]) -> tuple[RobotMap, ...]:
    return tuple(
        RobotMap(map_id=map_id, map_version=version, enabled=status is MapStatus.ENABLED)
        for map_id, version, status in told
    )


def why_not_on(map_id: str, state: State) -> str:
    """Say, as a predicate, why a robot cannot drive on a map; empty where it can, or tells of no maps."""
    maps = robot_maps(state)
    if not maps or not map_id:
        return ""
    versions = [each for each in maps if each.map_id == map_id]
    if any(each.enabled for each in versions):
        return ""
    if versions:
        return f"has no version of map {map_id!r} enabled (enableMap)"
    return f"does not have map {map_id!r} (downloadMap, enableMap)"
