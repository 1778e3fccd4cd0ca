"""Zone sets are kept, one of each map is in use, and the content of an ID never changes."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.zone_sets import ZoneSets
from nena_order_service.errors import RefusedError, UnknownError
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.service import OrderService
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.state import RobotZoneSetStatus, ZoneSetState
from support.fleet_records import state
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
    with pytest.raises(RefusedError, match="day"):
        await service.hosts.zones.put(zone_set(zone("z", "BLOCKED", 0, 2), zone_set_id="day"))
    assert (await service.hosts.zones.delete("day")).deleted
    back = await service.hosts.zones.put(zone_set(ZONE, zone_set_id="day"))
    assert (back.deleted, back.enabled) == (False, False)
    with pytest.raises(UnknownError, match="night"):
        service.hosts.zones.get("night")


async def test_a_robot_that_cannot_enable_a_zone_set_is_shown_with_its_reason(
    service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """State and answer of the robot are made up."""
    await service.hosts.zones.put(zone_set(ZONE, zone_set_id="day"))
    await service.hosts.zones.enable("day")
    stored = ZoneSetState(map_id="hall", zone_set_id="day", zone_set_status=RobotZoneSetStatus.DISABLED)
    vehicle = next(iter(service.engine.registry))
    last = replace(
        service.engine.view(vehicle),
        link=LinkStatus.ONLINE,
        state=state(version="3.0.0", zone_sets=(stored,)),
    )
    answer: asyncio.Future[InstantActionEnded] = asyncio.Future()
    monkeypatch.setattr(Engine, "view", lambda *_: last)
    monkeypatch.setattr(Engine, "send_instant_action", lambda *_: answer)
    service.hosts.zones.send_due_steps()
    enable = Action(action_type="enableZoneSet", action_id="1", blocking_type=BlockingType.NONE)
    reason = Reason.of("the action failed")
    failure = InstantActionEnded(vehicle.key, enable, ActionStatus.FAILED, reason, result="no such map")
    asyncio.get_running_loop().call_soon(answer.set_result, failure)
    await answer
    (shown, *_) = service.hosts.zones.get("day").vehicles
    assert shown.note == "enableZoneSet failed: the action failed: no such map"
