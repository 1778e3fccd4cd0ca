"""Zone sets in the robot: taken, enabled, deleted, refused."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.zone_sets import (
    SETS_HELD,
    ZONES_IN_A_SET,
    DuplicateZoneSetError,
    NoRoomForZoneSetError,
    ZoneSetRefusedError,
    ZoneSets,
)
from nena_shared.vda5050.zone_set import Vertex, Zone, ZoneSet, ZoneType
from support.zones import zone, zone_set

SUPPORTED = frozenset({ZoneType.BLOCKED, ZoneType.RELEASE})
WALL = zone("wall", "BLOCKED", 4, 6)


def held(sets: ZoneSets) -> dict[str, str]:
    return {each.zone_set_id: each.zone_set_status.value for each in sets.states}


def with_sets(*zone_sets: ZoneSet) -> ZoneSets:
    sets = ZoneSets(SUPPORTED)
    for each in zone_sets:
        sets.add(each)
    return sets


@pytest.mark.clause("6.4.1")
def test_a_new_set_is_disabled_and_does_not_count() -> None:
    sets = with_sets(zone_set(WALL))

    assert held(sets) == {"s1": "DISABLED"}
    assert sets.enabled == ()


@pytest.mark.clause("6.4.2")
def test_an_enabled_set_takes_the_place_of_the_other_one_of_its_map() -> None:
    sets = with_sets(
        zone_set(WALL),
        zone_set(zone("w2", "BLOCKED", 1, 2), zone_set_id="s2"),
        zone_set(WALL, zone_set_id="s3", map_id="attic"),
    )
    for each in ("s1", "s3", "s2"):
        sets.enable(each)

    assert held(sets) == {"s1": "DISABLED", "s2": "ENABLED", "s3": "ENABLED"}
    assert {each.key for each in sets.enabled} == {("s2", "w2"), ("s3", "wall")}


@pytest.mark.clause("6.4.1")
def test_a_set_with_the_id_of_another_one_is_not_taken() -> None:
    sets = with_sets(zone_set(WALL))

    with pytest.raises(DuplicateZoneSetError, match="'s1' already"):
        sets.add(zone_set(zone("other", "BLOCKED", 0, 1)))
    assert [zone.zone_id for each, _ in sets.held for zone in each.zones] == ["wall"]


@pytest.mark.clause("6.2.3/deleteZoneSet")
def test_an_enabled_set_is_not_deleted() -> None:
    sets = with_sets(zone_set(WALL), zone_set(WALL, zone_set_id="s2"))
    sets.enable("s1")

    with pytest.raises(ZoneSetRefusedError, match="is enabled"):
        sets.delete("s1")
    sets.delete("s2")

    assert held(sets) == {"s1": "ENABLED"}


@pytest.mark.clause("6.2.3/enableZoneSet", "6.2.3/deleteZoneSet")
@pytest.mark.parametrize("name", ["enable", "delete"])
def test_a_set_that_is_not_there_is_not_changed(name: str) -> None:
    with pytest.raises(ZoneSetRefusedError, match="no zone set 'x'"):
        getattr(with_sets(), name)("x")


def _bow_tie() -> Zone:
    corners = ((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0))
    return Zone(zone_id="b", zone_type=ZoneType.BLOCKED, vertices=tuple(Vertex(x=x, y=y) for x, y in corners))


@pytest.mark.clause("6.4.1", "6.4/others")
@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        (zone("slow", "SPEED_LIMIT", 0, 1, maximum_speed=1.0), "does not support"),
        (_bow_tie(), "crosses itself"),
    ],
)
def test_a_zone_that_the_robot_cannot_honour_is_refused(bad: Zone, problem: str) -> None:
    sets = ZoneSets(SUPPORTED)

    with pytest.raises(ZoneSetRefusedError, match=problem):
        sets.add(zone_set(WALL, bad))
    assert sets.held == ()


@pytest.mark.clause("6.4.1")
def test_there_is_room_for_so_much_and_no_more() -> None:
    sets = with_sets(*(zone_set(WALL, zone_set_id=f"s{number}") for number in range(SETS_HELD)))

    with pytest.raises(NoRoomForZoneSetError):
        sets.add(zone_set(WALL, zone_set_id="one more"))
    with pytest.raises(NoRoomForZoneSetError):
        with_sets(zone_set(*(zone(f"z{number}", "BLOCKED", 0, 1) for number in range(ZONES_IN_A_SET + 1))))


@pytest.mark.clause("6.4.2")
def test_what_is_held_can_be_held_again() -> None:
    sets = with_sets(zone_set(WALL), zone_set(WALL, zone_set_id="s2"))
    sets.enable("s2")
    again = ZoneSets(SUPPORTED)

    again.restore(sets.held)

    assert again.states == sets.states
    assert again.enabled == sets.enabled
