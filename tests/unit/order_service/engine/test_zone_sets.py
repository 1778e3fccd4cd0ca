"""Zone sets are kept, one of each map is in use, and the content of an ID never changes."""

from __future__ import annotations

import pytest

from nena_order_service.engine.zone_sets import ZoneSets
from nena_order_service.errors import UnknownZoneSetError, ZoneSetChangedError
from nena_order_service.service import OrderService
from support.zones import zone, zone_set

ZONE = zone("z", "BLOCKED", 0, 1)


async def test_one_zone_set_per_map_is_enabled_also_after_a_restart(service: OrderService) -> None:
    for name, map_id in (("day", "hall"), ("night", "hall"), ("yard", "outside")):
        await service.hosts.zones.put(zone_set(ZONE, zone_set_id=name, map_id=map_id))
        await service.hosts.zones.enable(name)
    again = ZoneSets(service.engine, lambda _robot, _set: None)
    await again.load()
    for kept in (service.hosts.zones, again):
        assert {each.zone_set_id for each in kept.all() if each.enabled} == {"night", "yard"}


async def test_a_zone_set_never_changes_but_may_be_restored(service: OrderService) -> None:
    await service.hosts.zones.put(zone_set(ZONE, zone_set_id="day"))
    with pytest.raises(ZoneSetChangedError, match="day"):
        await service.hosts.zones.put(zone_set(zone("z", "BLOCKED", 0, 2), zone_set_id="day"))
    assert (await service.hosts.zones.delete("day")).deleted
    back = await service.hosts.zones.put(zone_set(ZONE, zone_set_id="day"))
    assert (back.deleted, back.enabled) == (False, False)
    with pytest.raises(UnknownZoneSetError, match="night"):
        service.hosts.zones.get("night")
