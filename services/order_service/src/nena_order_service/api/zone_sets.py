"""Zone sets: operations of hosts; :class:`ZoneSets` executes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from nena_order_service.api.operations import Handler
from nena_order_service.engine.zone_sets import ZoneSets
from nena_shared.fleet_api.operations import plant as table
from nena_shared.fleet_api.plant import ZoneSetList

EXAMPLE: Final = {
    "zoneSetId": "night",
    "mapId": "hall",
    "zones": [
        {
            "zoneId": "aisle-3",
            "zoneType": "SPEED_LIMIT",
            "vertices": [{"x": 2, "y": 0}, {"x": 8, "y": 0}, {"x": 8, "y": 4}],
            "maximumSpeed": 0.5,
        }
    ],
}


def zone_set_handlers(zones: ZoneSets) -> Iterator[Handler]:
    """Yield what executes each operation."""
    yield Handler(table.LIST_ZONE_SETS, lambda: ZoneSetList(zone_sets=zones.all()))
    yield Handler(table.SHOW_ZONE_SET, zones.get)
    yield Handler(table.PUT_ZONE_SET, lambda request: zones.put(zone_set=request), EXAMPLE)
    yield Handler(table.ENABLE_ZONE_SET, zones.enable)
    yield Handler(table.DELETE_ZONE_SET, zones.delete)
