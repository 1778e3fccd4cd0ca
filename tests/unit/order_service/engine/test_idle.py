"""Vehicles that have nothing to do, under the engine."""

from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.idle import DISPLACES_AT_MOST
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.vehicles.parking import BARRED
from nena_shared.fleet_api.transport_order import OrderOutcome
from nena_shared.fleet_api.transport_order import TransportOrderState as S
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from nena_shared.plant_terms import PointType
from support.clocks import ManualClock
from support.fleet_examples import power
from support.order_service import request
from support.pausing import turn_passes
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, engine_at, later, reason_of

PARK = PointType.PARK_POSITION
PLANT = PlantModel(
    name="row",
    points=(
        *(point(name, 4000 * index) for index, name in enumerate("ABCD")),
        point("P", 0, 9000, type=PARK),
        point("Q", 4000, 9000, type=PARK),
    ),
    paths=tuple(
        path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "A P", "B Q")
    ),
    location_types=(LocationType(name="Dock", allowed_operations=("Charge",)),),
    locations=(Location(name="Dock", type="Dock", links=(Link(point="D"),)),),
    vehicles=tuple(Vehicle(name=name) for name in ("V1", "V2", "V3")),
)
BOTH: dict[str, Any] = {"recharging": {"enabled": True}, "parking": {"enabled": True, "delay": 0}}


async def make(
    places: dict[str, str], store: MemoryStore | None = None, *, charge: float = 95, **dispatch: Any
) -> tuple[Engine, ScriptedFleet]:
    settings = EngineSettings(
        default_map_id="map", dispatch=DispatchSettings.model_validate(dispatch or BOTH)
    )
    fields = {name: power(charge) for name in places}
    return await engine_at(PLANT, places, store, fields=fields, settings=settings, clock=ManualClock())


def made(engine: Engine, kind: str) -> list[TransportOrder]:
    return [each for each in engine.state.orders.unfinished() if each.status.type == kind]


async def test_idle_vehicles_stay_unless_enabled() -> None:
    engine, fleet = await make({"V1": "A"}, charge=10, energy={"respected": True})
    later(engine, 60)
    assert fleet.sent == []
    assert reason_of(engine) == "must recharge first: critical energy (at most 30 %)"


async def test_idle_vehicles_park_at_different_positions() -> None:
    engine, fleet = await make({"V1": "A", "V2": "B"})
    later(engine, 1)
    assert {each.name.partition("-")[0] for each in made(engine, "Park")} == {"Park"}
    assert all(each.status.dispensable for each in made(engine, "Park"))
    fleet.finish("V1")
    fleet.finish("V2")
    assert fleet.at == {"V1": "P", "V2": "Q"}
    later(engine, 60)
    assert (len(fleet.sent), made(engine, "Park")) == (2, [])


async def test_a_vehicle_parks_only_after_it_was_idle_for_the_delay() -> None:
    engine, fleet = await make({"V1": "A"}, parking={"enabled": True, "delay": 20})
    later(engine, 1)
    later(engine, 19)
    assert fleet.sent == []
    later(engine, 1)
    assert len(fleet.sent) == 1


async def test_a_vehicle_that_cannot_park_has_a_reason() -> None:
    engine, fleet = await make({"V1": "P", "V2": "Q", "V3": "A"})
    later(engine, 1)
    assert fleet.sent == []
    assert reason_of(engine, "V1").endswith("no waiting orders")
    assert reason_of(engine, "V3").endswith("it should park, but no reachable parking position is free")


async def test_parking_gives_way_to_a_waiting_order() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    park = made(engine, "Park")[0]
    engine.create(request("C"), "T")

    waiting = engine.state.orders.named("T")
    assert waiting
    assert waiting.status.reason == "waits for robot 'V1', which ends a dispensable order first"
    assert engine.state.orders.get(park.number).state is S.WITHDRAWN
    assert "gives way to order T" in engine.state.orders.get(park.number).status.reason
    assert fleet.cancelled == []

    fleet.finish("V1")
    ended = engine.state.orders.get(park.number)
    assert (ended.state, ended.status.outcome) == (S.FAILED, OrderOutcome.GAVE_WAY)
    assert [vda_order.order_id for _, vda_order in fleet.sent][-1] == "T-0"


async def test_a_vehicle_that_gives_up_an_order_is_reserved_for_the_new_one() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    engine.create(request("C"), "T")
    engine.create(request("B", priority=9), "U")
    fleet.finish("V1")
    assert [vda_order.order_id for _, vda_order in fleet.sent][-1] == "T-0"


async def test_a_vehicle_parks_again_after_its_reserved_order() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    engine.create(request("C"), "T")
    fleet.finish("V1")
    fleet.finish("V1")
    later(engine, 60)
    assert fleet.sent[-1][1].order_id.startswith("Park-")


async def test_no_vehicle_is_reserved_for_a_held_order() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    engine.create(request("C"), "T")
    engine.create(request("B"), "U")
    order = engine.state.orders.named("T")
    assert order
    engine.hold(order.number, "Ann", "tea")
    fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "U-0"


async def test_an_order_does_not_wait_for_a_vehicle_that_gets_lost() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    engine.create(request("C"), "T")
    del fleet.at["V1"]
    fleet.appear("V2", "B")
    assert [(name, vda_order.order_id) for name, vda_order in fleet.sent][-1] == ("V2", "T-0")


async def test_a_vehicle_with_low_energy_only_recharges() -> None:
    engine, fleet = await make({"V1": "A"}, charge=20)
    engine.create(request("C"), "T")
    later(engine, 1)
    recharge = made(engine, "Charge")[0]
    assert recharge.name.startswith("Recharge-")
    assert not recharge.status.dispensable
    fleet.finish("V1")
    assert fleet.at["V1"] == "D"

    fleet.fields["V1"] = power(60, charging=True)
    later(engine, 60)
    waiting = engine.state.orders.named("T")
    assert waiting
    assert waiting.status.reason.endswith("recharging until its energy is 90 %")
    fleet.fields["V1"] = power(90, charging=True)
    fleet.appear("V1", "D")
    assert fleet.sent[-1][1].order_id == "T-0"


async def test_a_vehicle_recharging_within_its_order_is_sent_cancel_order() -> None:
    engine, fleet = await make({"V1": "D"}, charge=80)
    later(engine, 1)
    recharge = made(engine, "Charge")[0]
    assert recharge.status.dispensable
    fleet.operate("V1")
    engine.create(request("C"), "T")
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert engine.state.orders.get(recharge.number).state is S.FAILED
    assert fleet.sent[-1][1].order_id == "T-0"


async def test_a_hosts_order_never_gives_way_whatever_its_name_and_type() -> None:
    engine, fleet = await make({"V1": "D"}, charge=95)
    asked = request("D:Charge", type="Charge", intended_vehicle="V1")
    order = engine.create(asked, "Recharge-1")
    fleet.operate("V1")
    engine.create(request("C"), "T")
    assert fleet.cancelled == []
    assert engine.state.orders.get(order.number).state is S.BEING_PROCESSED


async def test_an_idly_occupied_charger_is_requested_when_energy_is_critical() -> None:
    engine, fleet = await make({"V1": "A", "V2": "D"})
    fleet.fields["V2"] = power(99, charging=True)
    fleet.fields["V1"] = power(60)
    later(engine, 1)
    assert made(engine, "Charge") == []
    fleet.fields["V1"] = power(10)
    fleet.finish("V1")
    later(engine, 60)
    assert [each.status.intended_vehicle for each in made(engine, "Charge")] == ["V1"]


async def test_automatic_orders_are_not_created_continuously() -> None:
    engine, fleet = await make({"V1": "A"})
    later(engine, 1)
    fleet.fail("V1")
    later(engine, 1)
    assert made(engine, "Park") == []
    later(engine, 10)
    assert len(made(engine, "Park")) == 1


async def test_others_make_room_for_parking_a_limited_number_of_times() -> None:
    places = {"V1": "B", "V2": "A", "V3": "Q"}
    engine, fleet = await make(places, parking=BOTH["parking"], energy={"respected": True})
    fleet.fields["V2"] = power(10)  # it may not even park, and is in the way of who does
    fleet.appear("V2", "A")
    for _ in range(DISPLACES_AT_MOST):
        later(engine, 60)
        (parking,) = made(engine, "Park")
        assert parking.vehicle == "V1"
        await turn_passes()  # a decision with many searches continues in the next turn
        engine.withdraw(parking.number, "to see whether it tries again")
        fleet.finish("V1")  # it has let V2 out
        fleet.appear("V1", "B")
    later(engine, 60)
    assert made(engine, "Park") == []
    assert reason_of(engine).endswith(f"it should park, but each free parking position near it {BARRED}")

    asked: list[str] = []

    def displaces(_vehicle: str, point: str) -> bool:
        asked.append(point)
        return True

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine.traffic, "would_displace", displaces)
        later(engine, 1)
        assert asked == [], "what was found out holds for a while"
        assert str(BARRED) in reason_of(engine)
        later(engine, 10)
        assert asked == ["P"]

    engine.create(request("C"), "of a host")
    later(engine, 1)
    fleet.finish("V1")
    later(engine, 60)
    assert [each.vehicle for each in made(engine, "Park")] == ["V1"]


async def test_each_vehicle_has_a_reason_for_an_order() -> None:
    engine, _ = await make({"V1": "A"}, charge=20, parking={"enabled": False})
    order = engine.create(request("C"), "T")
    found = {each.vehicle: str(each.reason) for each in engine.dispatching.explain(order)}
    assert "critical" in found["V1"]
    assert found["V2"] == "is offline"
