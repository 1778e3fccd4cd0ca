from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.engine import stops as stops_module
from nena_order_service.engine.engine import Engine
from nena_order_service.errors import RefusedError, UnknownError
from nena_order_service.fleet.outputs import BrokerLinkChanged, RobotChanged
from nena_shared.fleet_api.stops import Area, DirectStop, StopRequest
from nena_shared.fleet_api.transport_order import TransportOrderRequest, TransportOrderState
from nena_shared.plant import Vehicle
from nena_shared.vda5050.action import ActionStatus
from support.fleet_examples import position
from support.order_service import request
from support.plants import grid_plant
from support.scripted_fleet import (
    MemoryStore,
    ScriptedFleet,
    engine_at,
    key,
    later,
    make_engine,
    reason_of,
    status_of,
)

PLANT = grid_plant(4, 1).model_copy(update={"vehicles": (Vehicle(name="V1"), Vehicle(name="V2"))})
"""Points 2 m apart: P-0-0 to P-3-0."""
ALL = StopRequest(by="Anna", reason="fire drill")


def pauses(fleet: ScriptedFleet, action_type: str = "startPause") -> list[str]:
    """Return the robots that were sent this action, in order."""
    return [name for name, sent in fleet.actions if sent == action_type]


def confirm(
    fleet: ScriptedFleet, name: str, *, paused: bool, status: ActionStatus = ActionStatus.FINISHED
) -> None:
    """Let a robot report that it is paused or not, and end the action that it was sent."""
    fleet.fields.setdefault(name, {})["paused"] = paused
    fleet.answer_instant(name, status)
    fleet._tell(RobotChanged(key(name)))


async def stopped_engine(**fields: dict[str, Any]) -> tuple[Engine, ScriptedFleet, MemoryStore]:
    store = MemoryStore()
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, store, fields=fields)
    return engine, fleet, store


async def test_stop_pauses_each_robot_and_says_who_and_why() -> None:
    engine, fleet, _ = await stopped_engine()
    stop = engine.begin_stop(ALL, "Anna")
    assert pauses(fleet) == ["V1"]
    (status,) = engine.stops.statuses()
    assert (status.by, status.reason, status.vehicles, status.paused) == ("Anna", "fire drill", 2, 0)
    assert [(each.vehicle, each.reason) for each in status.not_paused] == [
        ("V1", "has not confirmed the pause yet"),
        ("V2", "is offline"),
    ]

    confirm(fleet, "V1", paused=True)
    (status,) = engine.stops.statuses()
    assert (status.paused, [each.vehicle for each in status.not_paused]) == (1, ["V2"])
    vehicle = engine.registry.named("V1")
    assert vehicle
    shown = engine.reporter.vehicle_status(vehicle).stop
    assert shown
    assert (shown.name, shown.by, shown.reason, shown.area) == (
        stop.name,
        "Anna",
        "fire drill",
        False,
    )
    assert "all robots are paused by Anna: fire drill" in reason_of(engine)


async def test_robots_continue_when_the_last_stop_ends() -> None:
    engine, fleet, store = await stopped_engine()
    first, second = engine.begin_stop(ALL, "Anna"), engine.begin_stop(ALL, "Ben")
    confirm(fleet, "V1", paused=True)
    engine.end_stop(first.name, "Anna", "over")
    assert not pauses(fleet, "stopPause")
    engine.end_stop(second.name, "Ben", "over")
    assert pauses(fleet, "stopPause") == ["V1"]
    confirm(fleet, "V1", paused=False)
    assert not store.kept
    assert engine.stops.statuses() == ()
    with pytest.raises(UnknownError, match=first.name):
        engine.end_stop(first.name, "Anna", "again")


async def test_robot_that_was_paused_before_stays_paused() -> None:
    engine, fleet, store = await stopped_engine(V1={"paused": True})
    stop = engine.begin_stop(ALL, "Anna")
    assert not pauses(fleet)
    engine.end_stop(stop.name, "Anna", "over")
    later(engine, 60)
    assert not pauses(fleet, "stopPause")
    assert not store.kept


async def test_robot_that_a_person_pauses_during_the_stop_stays_paused() -> None:
    engine, fleet, store = await stopped_engine()
    stop = engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    vehicle = engine.registry.named("V1")
    assert vehicle
    engine.person_pauses(vehicle)
    engine.end_stop(stop.name, "Anna", "over")
    assert not pauses(fleet, "stopPause")
    assert not store.kept


async def test_pause_that_a_person_has_just_requested_outlasts_the_stop() -> None:
    engine, fleet, _ = await stopped_engine()
    vehicle = engine.registry.named("V1")
    assert vehicle
    engine.person_pauses(vehicle)  # the robot does not report it yet
    stop = engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    engine.end_stop(stop.name, "Anna", "over")
    assert not pauses(fleet, "stopPause")


async def test_robot_that_is_resumed_at_its_panel_is_paused_again() -> None:
    engine, fleet, _ = await stopped_engine(V1={"paused": True})
    stop = engine.begin_stop(ALL, "Anna")
    fleet.fields["V1"]["paused"] = False
    fleet._tell(RobotChanged(key("V1")))
    assert pauses(fleet) == ["V1"]
    confirm(fleet, "V1", paused=True)
    engine.end_stop(stop.name, "Anna", "over")
    assert pauses(fleet, "stopPause") == ["V1"]


async def test_robot_that_is_resumed_at_once_is_paused_again_at_once() -> None:
    engine, fleet, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    fleet.fields["V1"]["paused"] = False
    fleet._tell(RobotChanged(key("V1")))
    assert pauses(fleet) == ["V1", "V1"]


async def test_robot_that_refuses_to_pause_is_named_and_asked_again() -> None:
    engine, fleet, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=False, status=ActionStatus.FAILED)
    assert engine.stops.statuses()[0].not_paused[0].reason == "cannot be paused: done"
    assert pauses(fleet) == ["V1"]
    later(engine, stops_module.RETRY_AFTER + 0.1)
    assert pauses(fleet) == ["V1", "V1"]


async def test_robot_that_connects_during_the_stop_is_paused() -> None:
    engine, fleet, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    del fleet.at["V1"]
    later(engine, 60)
    assert engine.stops.statuses()[0].not_paused[0].vehicle == "V1"
    before = len(pauses(fleet))
    fleet.answer_instant("V1", ActionStatus.FAILED)
    later(engine, 60)
    fleet.appear("V1", "P-0-0")
    assert len(pauses(fleet)) == before + 1


async def restarted_engine(fleet: ScriptedFleet) -> Engine:
    """Return an engine that has just taken over; the one before knew both robots."""
    store = MemoryStore()
    await engine_at(PLANT, {"V1": "P-0-0", "V2": "P-3-0"}, store)
    return await make_engine(PLANT, store, fleet)


@pytest.mark.parametrize(
    ("fleet", "reason"),
    [
        (ScriptedFleet({}, unheard={"V1"}), "has not confirmed the pause yet"),
        (ScriptedFleet({"V1": "P-0-0"}, mute={"V1"}), "has not reported its state yet"),
        (ScriptedFleet({"V1": "P-0-0"}, stale={"V1"}), "has not reported its state yet"),
    ],
    ids=["unheard", "without a state", "stale"],
)
async def test_robot_that_has_not_reported_yet_is_paused_and_named(fleet: ScriptedFleet, reason: str) -> None:
    engine = await restarted_engine(fleet)
    engine.begin_stop(ALL, "Anna")
    assert pauses(fleet) == ["V1"]
    (status,) = engine.stops.statuses()
    assert (status.vehicles, status.paused) == (2, 0)
    assert {each.vehicle: each.reason for each in status.not_paused} == {"V1": reason, "V2": "is offline"}


async def test_robot_that_has_reported_after_the_pause_continues_at_the_end() -> None:
    fleet = ScriptedFleet({"V1": "P-0-0"}, mute={"V1"})
    engine = await restarted_engine(fleet)
    stop = engine.begin_stop(ALL, "Anna")
    fleet.mute.clear()
    fleet._tell(RobotChanged(key("V1")))
    confirm(fleet, "V1", paused=True)
    assert pauses(fleet) == ["V1"]
    assert engine.stops.statuses()[0].paused == 1
    engine.end_stop(stop.name, "Anna", "over")
    assert pauses(fleet, "stopPause") == ["V1"]


async def test_robot_of_which_nothing_is_heard_is_not_sent_the_pause_for_ever() -> None:
    fleet = ScriptedFleet({}, unheard={"V1"})
    engine = await restarted_engine(fleet)
    engine.begin_stop(ALL, "Anna")
    fleet.answer_instant("V1", ActionStatus.FAILED)
    later(engine, 600)
    assert pauses(fleet) == ["V1"]
    assert engine.stops.statuses()[0].not_paused[0].reason == "cannot be paused: done"
    fleet.appear("V1", "P-0-0")
    assert pauses(fleet) == ["V1", "V1"]


async def test_vehicle_that_has_never_connected_is_named_only_until_it_would_have_answered() -> None:
    fleet = ScriptedFleet({}, unheard={"V1", "V2"}, connected=10.0)
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    engine.begin_stop(ALL, "Anna")
    assert [each.vehicle for each in engine.stops.statuses()[0].not_paused] == ["V1", "V2"]
    fleet.connected = 30.0
    assert engine.stops.statuses()[0].vehicles == 0


async def test_pause_that_could_not_be_sent_is_sent_when_our_link_is_back() -> None:
    engine, fleet, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=False, status=ActionStatus.FAILED)
    fleet._tell(BrokerLinkChanged())
    engine.run_checks()
    assert pauses(fleet) == ["V1", "V1"]


async def test_no_robot_gets_an_order_or_more_base_during_the_stop() -> None:
    store = MemoryStore()
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, store, release_ahead=1)
    engine.create(request("P-3-0"), "T")
    assert len(fleet.sent) == 1
    stop = engine.begin_stop(ALL, "Anna")
    fleet.pass_node("V1", 1)
    later(engine, 10)
    assert not fleet.extended
    assert status_of(engine).reason.endswith("but all robots are paused by Anna: fire drill")
    engine.end_stop(stop.name, "Anna", "over")
    assert fleet.extended


async def test_order_created_during_the_stop_waits_for_its_end() -> None:
    engine, fleet, _ = await stopped_engine()
    stop = engine.begin_stop(ALL, "Anna")
    engine.create(request("P-3-0"), "T")
    later(engine, 10)
    assert not fleet.sent
    engine.end_stop(stop.name, "Anna", "over")
    assert [name for name, _ in fleet.sent] == ["V1"]
    assert status_of(engine).state is TransportOrderState.BEING_PROCESSED


async def test_stop_survives_a_restart() -> None:
    engine, fleet, store = await stopped_engine()
    stop = engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    engine.close("restart")

    fleet = ScriptedFleet({"V1": "P-0-0"}, fields={"V1": {"paused": True}})
    engine = await make_engine(PLANT, store, fleet)
    assert [each.name for each in engine.stops.statuses()] == [stop.name]
    fleet.appear("V1", "P-0-0")
    engine.create(request("P-3-0"), "T")
    assert not fleet.sent
    engine.end_stop(stop.name, "Ben", "over")
    assert pauses(fleet, "stopPause") == ["V1"]


async def test_robot_that_is_away_at_the_end_continues_when_it_is_back() -> None:
    engine, fleet, store = await stopped_engine()
    stop = engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    del fleet.at["V1"]
    engine.end_stop(stop.name, "Anna", "over")
    engine.close("restart")

    fleet = ScriptedFleet({}, fields={"V1": {"paused": True}})
    engine = await make_engine(PLANT, store, fleet)
    assert not fleet.actions
    fleet.appear("V1", "P-0-0")
    assert pauses(fleet, "stopPause") == ["V1"]


async def test_direct_stop_keeps_its_name_although_the_request_arrives_late() -> None:
    engine, fleet, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    confirm(fleet, "V1", paused=True)
    direct = DirectStop(name="shown", by="Anna", reason=ALL.reason, since=engine.clock.now(), user="anna")
    engine.continue_stop(direct)
    (status,) = engine.stops.statuses()
    assert (status.name, status.paused) == ("shown", 1)
    engine.end_stop("shown", "Anna", "over")
    assert (pauses(fleet), pauses(fleet, "stopPause")) == (["V1"], ["V1"])


async def test_nothing_is_sent_before_the_stop_is_stored() -> None:
    engine, fleet, store = await stopped_engine()
    store.held = True
    engine.begin_stop(ALL, "Anna")
    assert not pauses(fleet)
    assert engine.stops.statuses() == ()
    store.release()
    assert pauses(fleet) == ["V1"]


async def test_number_of_stops_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stops_module, "STOPS_LIMIT", 1)
    engine, _, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    with pytest.raises(RefusedError, match="1 stops are active"):
        engine.begin_stop(ALL, "Ben")


async def test_unreadable_stop_does_not_prevent_a_start() -> None:
    store = MemoryStore()
    store.kept["stop", "stop-1"] = "{}"
    engine = await make_engine(PLANT, store, ScriptedFleet({}))
    assert engine.stops.statuses() == ()


async def test_area_pauses_the_robots_in_it_and_those_that_may_drive_in() -> None:
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0", "V2": "P-3-0"})
    area = Area(x_min=5.8, x_max=6.2, y_min=-1, y_max=1)
    stop = engine.begin_stop(StopRequest(reason="spill", area=area), "Anna")
    assert pauses(fleet) == ["V2"]
    assert engine.stops.statuses()[0].vehicles == 1
    assert "this area is paused by Anna: spill" in reason_of(engine, "V2")
    assert "paused" not in reason_of(engine, "V1")
    assert set(engine.context.locked_paths.by_stops) == {"P-2-0 --- P-3-0", "P-3-0 --- P-2-0"}
    engine.end_stop(stop.name, "Anna", "over")
    assert engine.context.locked_paths.by_stops == {}


async def test_straight_drive_through_a_stopped_area_waits_for_its_end() -> None:
    here = {"mobile_robot_position": {**position(0.0, 0.0), "map_id": "map"}}
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, fields={"V1": here})
    area = Area(x_min=2.5, x_max=3.5, y_min=-1, y_max=1)
    stop = engine.begin_stop(StopRequest(reason="spill", area=area), "Anna")
    assert not pauses(fleet)
    behind = {"coordinate": {"x": 5.0, "y": 0.0}, "operation": "MOVE"}
    engine.create(TransportOrderRequest.model_validate({"destinations": [behind]}), "T")
    later(engine, 10)
    assert not fleet.sent
    why = "it would drive through an area that is paused by Anna: spill"
    assert why in status_of(engine).reason
    engine.end_stop(stop.name, "Anna", "over")
    assert len(fleet.sent) == 1


async def test_robot_that_already_drives_straight_through_an_area_is_paused() -> None:
    here = {"mobile_robot_position": {**position(0.0, 0.0), "map_id": "map"}}
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, fields={"V1": here})
    behind = {"coordinate": {"x": 5.0, "y": 0.0}, "operation": "MOVE"}
    engine.create(TransportOrderRequest.model_validate({"destinations": [behind]}), "T")
    assert len(fleet.sent) == 1
    beside, across = (Area(x_min=2.5, x_max=3.5, y_min=y, y_max=1) for y in (0.5, -1))
    engine.begin_stop(StopRequest(reason="spill", area=beside), "Anna")
    assert not pauses(fleet)
    engine.begin_stop(StopRequest(reason="spill", area=across), "Anna")
    assert pauses(fleet) == ["V1"]


async def test_robot_outside_an_area_stops_before_it() -> None:
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, release_ahead=1)
    engine.create(request("P-3-0"), "T")
    area = Area(x_min=5.8, x_max=6.2, y_min=-1, y_max=1)
    stop = engine.begin_stop(StopRequest(reason="spill", area=area), "Anna")
    for _ in range(10):
        if key("V1") in fleet.missions:
            fleet.finish("V1")
    assert not pauses(fleet)
    assert fleet.at["V1"] != "P-3-0"
    engine.end_stop(stop.name, "Anna", "over")
    for _ in range(10):
        if key("V1") in fleet.missions:
            fleet.finish("V1")
    assert fleet.at["V1"] == "P-3-0"


async def test_robot_under_way_in_an_area_continues_its_order_at_the_end() -> None:
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0"}, release_ahead=1)
    engine.create(request("P-3-0"), "T")
    area = Area(x_min=1.8, x_max=2.2, y_min=-1, y_max=1)
    stop = engine.begin_stop(StopRequest(reason="spill", area=area), "Anna")
    confirm(fleet, "V1", paused=True)
    later(engine, 10)
    engine.end_stop(stop.name, "Anna", "over")
    confirm(fleet, "V1", paused=False)
    for _ in range(10):
        if key("V1") in fleet.missions:
            fleet.finish("V1")
    assert fleet.at["V1"] == "P-3-0"


async def test_order_goes_to_a_robot_outside_the_area_before_the_others_are_paused() -> None:
    engine, fleet = await engine_at(PLANT, {"V1": "P-0-0", "V2": "P-3-0"})
    area = Area(x_min=5.8, x_max=6.2, y_min=-1, y_max=1)
    engine.begin_stop(StopRequest(reason="spill", area=area), "Anna")
    engine.create(request("P-2-0"), "T")
    assert [name for name, _ in fleet.sent] == ["V1"]
    assert reason_of(engine, "V2") == "is stopped: this area is paused by Anna: spill"


async def test_order_during_the_stop_waits_without_a_vehicle() -> None:
    engine, _, _ = await stopped_engine()
    engine.begin_stop(ALL, "Anna")
    engine.create(request("P-3-0"), "T")
    assert status_of(engine).processing_vehicle is None
    assert "each of them is stopped: all robots are paused by Anna: fire drill" in status_of(engine).reason
