"""What of the vehicles makes a difference to the dispatcher."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.outputs import BrokerLinkChanged, RobotChanged
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import graph
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, status_of
from support.waiting import until

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABC")),
    paths=tuple(path(ends, 4000) for ends in ("A B", "B A", "B C", "C B")),
    vehicles=tuple(Vehicle(name=name) for name in ("V1", "V2")),
)


def power(percent: float) -> dict[str, Any]:
    return {"power_supply": {"state_of_charge": percent, "charging": False}}


async def make(**dispatch: Any) -> tuple[Engine, ScriptedFleet]:
    settings = EngineSettings(
        default_map_id="map", traffic=False, dispatch=DispatchSettings.model_validate(dispatch)
    )
    fleet = ScriptedFleet({"V1": "A", "V2": "C"}, fields={"V1": power(5), "V2": power(50)})
    engine = await make_engine(PLANT, MemoryStore(), fleet, settings=settings)
    for name, at in list(fleet.at.items()):
        fleet.appear(name, at)
    return engine, fleet


async def test_energy_restricts_vehicles_only_if_respected() -> None:
    engine, fleet = await make()
    engine.create(request("A"), "T")
    assert fleet.sent[0][0] == "V2"

    engine, fleet = await make(energy={"respected": False})
    engine.create(request("A"), "T")
    assert fleet.sent[0][0] == "V1"


@pytest.mark.clause("7.8/loads")
async def test_a_vehicle_that_kept_a_load_drops_it_before_it_picks_up_another_one() -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.fields["V1"] = {"loads": ({"load_id": "of a failed order"},)}
    fleet.appear("V1", "A")
    engine.create(request("B:Load", "C:Unload", intendedVehicle="V1"), "T")
    order = engine.state.orders.named("T")
    assert order
    carries = "carries a load and has no room for another one"
    assert order.status.reason == f"waits for robot 'V1', which {carries}"
    assert [str(each.reason) for each in engine.dispatching.explain(order) if each.vehicle == "V1"] == [
        carries
    ]

    engine.create(request("B:Unload", intendedVehicle="V1"), "drop")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["drop-0"]
    del fleet.fields["V1"]
    fleet.finish("V1")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["drop-0", "T-0"]


async def test_no_vehicle_is_reserved_for_an_order_intended_for_another() -> None:
    engine, _ = await make(energy={"respected": False})
    engine.create(request("B", intendedVehicle="V2"), "first")
    engine.create(request("A", intendedVehicle="V2"), "T")
    order, dispatching = engine.state.orders.named("T"), engine.dispatching
    assert order
    dispatching._reserved[order.number] = "V1"
    engine.run_checks()
    assert dispatching._reserved == {}


async def test_a_vehicle_gets_no_order_before_its_map_is_enabled() -> None:
    engine, fleet = await make(energy={"respected": False})
    told = {"map_id": "map", "map_version": "2"}
    fleet.fields["V1"] = {"maps": ({**told, "map_status": "DISABLED"},)}
    fleet.appear("V1", "A")
    engine.create(request("B", intendedVehicle="V1"), "T")
    vehicle = engine.registry.named("V1")
    assert vehicle
    assert fleet.sent == []
    assert engine.reporter.vehicle_status(vehicle).reason == "has no version of map 'map' enabled (enableMap)"
    fleet.fields["V1"] = {"maps": ({**told, "map_status": "ENABLED"},)}
    fleet.appear("V1", "A")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]

    engine, fleet = await make(energy={"respected": False}, maps_respected=False)
    fleet.fields["V1"] = {"maps": ({**told, "map_status": "DISABLED"},)}
    engine.create(request("B", intendedVehicle="V1"), "T")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]


@pytest.mark.parametrize("at", ["A", "C"])
async def test_the_map_of_the_start_point_must_be_enabled(at: str) -> None:
    floors = {"A": "floor 1", "B": "floor 2", "C": "floor 2"}
    points = tuple(
        each.model_copy(update={"properties": {"vda5050:mapId": floors[each.name]}}) for each in PLANT.points
    )
    fleet = ScriptedFleet({"V1": at})
    fleet.fields["V1"] = {
        "maps": tuple(
            {
                "map_id": each,
                "map_version": "1",
                "map_status": "ENABLED" if each == floors[at] else "DISABLED",
            }
            for each in ("floor 1", "floor 2")
        ),
        "mobile_robot_position": {"x": 0.0, "y": 0.0, "theta": 0.0, "map_id": floors[at], "localized": True},
    }
    settings = EngineSettings(default_map_id="site", traffic=False)
    plant = PlantModel(name="floors", points=points, paths=PLANT.paths, vehicles=PLANT.vehicles)
    engine = await make_engine(plant, MemoryStore(), fleet, settings=settings)
    fleet.appear("V1", at)
    engine.create(request("B", intendedVehicle="V1"), "T")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]


async def test_loads_of_a_vehicle_bound_to_a_sequence_are_ignored() -> None:
    engine, fleet = await make(energy={"respected": False})
    with engine.change():
        engine.sequences.create(OrderSequenceRequest(intended_vehicle="V1"), "S")
    for name, destination in (("S-1", "B:Load"), ("S-2", "C:Load")):
        engine.create(request(destination, wrappingSequence="S"), name)
    fleet.accept("V1")
    fleet.fields["V1"] = {"loads": ({"load_id": "first"},)}
    fleet.finish("V1")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["S-1-0", "S-2-0"]


async def test_a_dropped_load_triggers_dispatching_unless_disabled() -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.fields["V1"] = {"loads": ({"load_id": ""},)}
    fleet.appear("V1", "A")
    engine.create(request("B:Load", intendedVehicle="V1"), "T")
    assert fleet.sent == []
    fleet.fields["V1"] = {"loads": ()}
    fleet.appear("V1", "A")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]

    engine, fleet = await make(energy={"respected": False}, loads_respected=False)
    fleet.fields["V1"] = {"loads": ({"load_id": ""},)}
    engine.create(request("B:Load", intendedVehicle="V1"), "T")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]


async def test_configured_keys_decide_which_vehicle_is_chosen() -> None:
    engine, fleet = await make(energy={"critical": 0}, vehicle_candidates=["BY_ENERGY_LEVEL"])
    fleet.fields["V1"] = power(40)
    fleet.appear("V1", "A")
    engine.create(request("A"), "T")
    assert fleet.sent[0][0] == "V2"
    order = engine.state.orders.named("T")
    assert order
    assert "first by BY_ENERGY_LEVEL of 2 free robots" in str(order.status.history)


async def test_a_state_that_changes_nothing_starts_no_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, fleet = await make()
    fleet.out_of_order.update(("V1", "V2"))
    engine.create(request("B", intendedVehicle="V2"), "T")
    decisions: list[int] = []
    decide = engine.life_cycle._assign_waiting

    def counted(orders: Sequence[TransportOrder]) -> None:
        decisions.append(len(orders))
        decide(orders)

    monkeypatch.setattr(engine.life_cycle, "_assign_waiting", counted)
    fleet.appear("V2", "C")
    fleet.appear("V2", "C")
    assert decisions == []
    fleet.out_of_order.clear()
    fleet.appear("V2", "C")
    assert decisions == [1]
    assert fleet.sent[0][0] == "V2"


async def test_a_new_link_to_the_broker_offers_an_order_to_the_whole_fleet_at_once() -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.out_of_order.update(("V1", "V2"))
    engine.create(request("B"), "T")
    fleet.out_of_order.clear()
    engine.on_events(BrokerLinkChanged(), RobotChanged(next(iter(engine.registry)).key))
    reasons = [text for each in status_of(engine, "T").history for text in each.supplements]
    assert any("of 2 free robots" in each for each in reasons), reasons


async def test_after_a_long_decision_the_next_one_waits_and_assigns_the_urgent_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.out_of_order.update(("V1", "V2"))
    decide = engine.life_cycle.dispatch_orders

    def long_decision() -> None:
        decide()
        engine.clock.worked += 0.01  # type: ignore[attr-defined]

    monkeypatch.setattr(engine.life_cycle, "dispatch_orders", long_decision)
    engine.create(request("B"), "first")
    monkeypatch.setattr(engine.life_cycle, "dispatch_orders", decide)
    fleet.out_of_order.discard("V2")
    fleet.appear("V2", "C")
    engine.create(request("C", priority=5), "urgent")
    assert fleet.sent == []
    await until(lambda: bool(fleet.sent))
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["urgent-0"]


async def test_a_repeated_decision_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.out_of_order.update(("V1", "V2"))
    engine.create(request("B"), "T")
    order = engine.state.orders.named("T")
    assert order
    assert order.state is TransportOrderState.DISPATCHABLE
    fleet.out_of_order.clear()
    assert [each.cost for each in engine.dispatching.explain(order)] == [4000, 4000]

    def no_search(*_: object) -> None:
        pytest.fail("the costs were known")

    monkeypatch.setattr(graph.RoutingGraph, "costs_to", no_search)
    assert [each.fits for each in engine.dispatching.explain(order)] == [True, True]


async def test_a_vehicle_that_moved_without_an_event_starts_where_it_is() -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.at["V1"] = "B"
    engine.create(request("A", intendedVehicle="V1"), "T")
    assert fleet.sent[0][1].nodes[0].node_id == "B"


async def test_an_order_that_avoids_a_missing_resource_waits_with_a_reason() -> None:
    engine, fleet = await make()
    engine.create(request("B", intendedVehicle="V1"), "T")
    order = engine.state.orders.named("T")
    assert order
    lost = order.current.model_copy(update={"avoided": ("Gone",)})
    engine.state.orders.put(order.changed(drive_orders=order.with_current(lost)))

    fleet.fields["V1"] = power(50)
    fleet.appear("V1", "A")

    assert fleet.sent == []
    assert "Gone" in status_of(engine).reason


async def two_wait_while_one_unloads(*, unloads: bool) -> tuple[Engine, ScriptedFleet]:
    """Make V1 drop at C, or drive there, and V2 become free at B while orders to C and A wait."""
    engine, fleet = await make(energy={"respected": False}, crowding=0.0)
    fleet.appear("V1", "C")
    fleet.appear("V2", "B")
    engine.create(request("C:Unload", intendedVehicle="V1"), "T1")
    engine.create(request("B", intendedVehicle="V2"), "T2")
    if unloads:
        fleet.operate("V1")
    engine.create(request("C"), "to C")
    engine.create(request("A"), "to A")
    fleet.finish("V2", at="B")
    return engine, fleet


async def test_an_order_waits_for_a_vehicle_that_unloads_at_its_start() -> None:
    engine, fleet = await two_wait_while_one_unloads(unloads=True)
    assert (status_of(engine, "to A").processing_vehicle, status_of(engine, "to C").state) == (
        "V2",
        TransportOrderState.DISPATCHABLE,
    )

    fleet.finish("V1", at="C")

    assert status_of(engine, "to C").processing_vehicle == "V1"


async def test_a_vehicle_still_driving_does_not_count_as_soon_free() -> None:
    engine, _ = await two_wait_while_one_unloads(unloads=False)

    assert status_of(engine, "to C").processing_vehicle == "V2"


async def test_no_free_vehicle_is_left_idle_for_an_unloading_one() -> None:
    engine, fleet = await make(energy={"respected": False})
    fleet.appear("V1", "C")
    fleet.appear("V2", "B")
    engine.create(request("C:Unload", intendedVehicle="V1"), "T1")
    fleet.operate("V1")

    engine.create(request("C"), "to C")

    assert status_of(engine, "to C").processing_vehicle == "V2"
