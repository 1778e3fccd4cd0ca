"""BLOCKED zones are a keep-out mask for Nav2, also after a restart of the agent and on each map."""

from __future__ import annotations

from typing import Any

import pytest
from nav_msgs.msg import OccupancyGrid

from nena_shared.vda5050.topics import Topic
from support.action_types import needs_nav2_types
from support.edge_agent import error_types
from support.nav2_agent import Bench
from support.robot_core import action
from support.ros import LATCHED, RosPeer
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


class Costmap:
    """A costmap with a keep-out filter: it subscribes to the mask that the description names."""

    def __init__(self, domain_id: int, namespace: str, filter_info_topic: str) -> None:
        from nav2_msgs.msg import CostmapFilterInfo  # noqa: PLC0415 - not everywhere

        self.peer = RosPeer(domain_id, f"{namespace}/global_costmap", "global_costmap")
        self.masks: list[OccupancyGrid] = []
        self.peer.node.create_subscription(CostmapFilterInfo, filter_info_topic, self._on_info, LATCHED)

    def _on_info(self, message: Any) -> None:
        topic = message.filter_mask_topic
        self.peer.node.create_subscription(OccupancyGrid, topic, self.masks.append, LATCHED)


def results(state: dict[str, Any]) -> dict[str, tuple[str, str]]:
    actions = state["instantActionStates"]
    return {each["actionId"]: (each["actionStatus"], each.get("actionResult", "")) for each in actions}


@pytest.mark.parametrize("space", ["", "/r1"])
@pytest.mark.clause("6.4/BLOCKED", "6.2.3/enableZoneSet")
async def test_a_set_is_enabled_only_while_a_costmap_reads_the_mask(bench: Bench, space: str) -> None:
    def avoided(state: dict[str, Any]) -> bool:
        return "BLOCKED_ZONES_NOT_AVOIDED" not in error_types(state)

    info = f"{space}/zone_filter_info"
    misplaced = Costmap(bench.domain_id, space, "zone_filter_info")  # as docs/nav2.md once had it
    with misplaced.peer:
        async with bench.agent(ros={"namespace": space or "/"}) as fleet:
            fleet.publish(Topic.ZONE_SET, transfer(zone("wall", "BLOCKED", 13, 17), zone_set_id="s1"))
            fleet.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
            state = await fleet.state(lambda state: results(state).get("e", ("",))[0] == "FAILED")
            reason = f"no node subscribes to {info}; set the costmap's filter_info_topic to this name"
            assert results(state)["e"][1].startswith(reason)
            assert results(state)["e"][1].endswith(f"now it is {space}/global_costmap/zone_filter_info")
            assert state["zoneSets"][0]["zoneSetStatus"] == "DISABLED"

            with Costmap(bench.domain_id, space, info).peer:
                fleet.instant(action("e2", "NONE", "enableZoneSet", zoneSetId="s1"))
                state = await fleet.state(lambda state: results(state).get("e2", ("",))[0] == "FINISHED")
                assert state["zoneSets"][0]["zoneSetStatus"] == "ENABLED"
            await fleet.state(lambda state: not avoided(state))

            returned = Costmap(bench.domain_id, space, info)
            with returned.peer:
                await until(lambda: bool(returned.masks), what="the mask at a costmap that came later")
                await fleet.state(avoided)
