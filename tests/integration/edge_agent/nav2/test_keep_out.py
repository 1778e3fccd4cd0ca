"""BLOCKED zones are a keep-out mask for Nav2, also after a restart of the agent and on each map."""

from __future__ import annotations

from typing import Any

import pytest
from nav_msgs.msg import OccupancyGrid

from nena_shared.vda5050.topics import Topic
from support.action_types import needs_nav2_types
from support.nav2_agent import Bench
from support.robot_core import action
from support.ros import LATCHED
from support.waiting import until
from support.zones import transfer, zone

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]


@pytest.fixture
def version() -> str:
    return "3.0.0"


async def enable(bench: Bench, zone_set_id: str, *zones: Any) -> None:
    bench.fleet.publish(Topic.ZONE_SET, transfer(*zones, zone_set_id=zone_set_id))
    bench.fleet.instant(action(f"e-{zone_set_id}", "NONE", "enableZoneSet", zoneSetId=zone_set_id))
    await bench.fleet.state(
        lambda state: any(
            (each["zoneSetId"], each["zoneSetStatus"]) == (zone_set_id, "ENABLED")
            for each in state["zoneSets"]
        )
    )


@pytest.mark.clause("6.4/BLOCKED")
async def test_keepout_zones_are_sent_to_nav2(bench: Bench) -> None:
    from nav2_msgs.msg import CostmapFilterInfo  # noqa: PLC0415 - not everywhere

    infos = bench.ros.subscribe(CostmapFilterInfo, "zone_filter_info", LATCHED)
    masks = bench.ros.subscribe(OccupancyGrid, "zone_filter_mask", LATCHED)
    with bench.simulator():
        async with bench.agent():
            assert not masks.messages
            await enable(bench, "s1", zone("wall", "BLOCKED", 13, 17), zone("gate", "RELEASE", 20, 22))
            info = infos.wait_for(what="the filter's info")
            assert (info.type, info.filter_mask_topic, info.multiplier) == (0, "/zone_filter_mask", 1.0)
            mask = masks.wait_for(what="the mask")
            assert mask.header.frame_id == "map"
            assert mask.info.origin.position.x == pytest.approx(13.0)
            assert mask.info.width * mask.info.resolution == pytest.approx(4.0, abs=0.1)
            assert set(mask.data) == {100}

        masks.clear()
        bench.fleet.peer.clear()
        async with bench.agent():
            await until(lambda: bool(masks.messages), what="the mask of an agent that was restarted")
            assert masks.messages[-1].info.origin.position.x == pytest.approx(13.0)

            await enable(bench, "s2", zone("gate", "RELEASE", 20, 22))
            await until(lambda: set(masks.messages[-1].data) == {0}, what="an empty mask")
