"""Whom a restart waits for, and how long."""

from __future__ import annotations

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.driving import RestartGate
from nena_shared.plant import PlantModel, Vehicle
from support.clocks import ManualClock
from support.scripted_fleet import ScriptedFleet, make_context

PLANT = PlantModel(name="two", vehicles=(Vehicle(name="V1"), Vehicle(name="V2")))


def make(fleet: ScriptedFleet, clock: ManualClock, *remembered: str) -> RestartGate:
    context = make_context(PLANT, clock=clock, settings=EngineSettings(restart_patience=20.0))
    context.connect(fleet)
    gate = RestartGate(context)
    gate.begin(tuple(vehicle for vehicle in context.registry if vehicle.name in remembered))
    return gate


def opened(gate: RestartGate) -> bool:
    return gate.is_open


def test_who_was_there_before_is_waited_for() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1", "V2")

    assert not opened(gate)
    assert gate.reason == "it waits after the start for the state of V1"

    fleet.mute.clear()
    assert opened(gate)
    assert gate.reason == ""


def test_patience_has_an_end() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1")

    clock.advance(19.9)
    assert not opened(gate)
    clock.advance(0.1)
    assert opened(gate)


def test_patience_is_with_robots_and_not_with_a_broker_that_is_away() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1")
    fleet.connected = 0.0
    clock.advance(100.0)
    assert not opened(gate), "nobody could have spoken"

    fleet.connected = 19.9
    assert not opened(gate)
    fleet.connected = 20.0
    assert opened(gate)


def test_it_never_closes_again_and_those_away_are_not_waited_for() -> None:
    fleet, clock = ScriptedFleet({}), ManualClock()
    gate = make(fleet, clock, "V1")
    assert opened(gate)

    fleet.mute.add("V1")
    fleet.at["V1"] = "A"
    assert opened(gate)


def test_the_broker_has_to_tell_first_who_is_there() -> None:
    fleet, clock = ScriptedFleet({}), ManualClock()
    fleet.unknown = True
    gate = make(fleet, clock)

    assert not opened(gate)
    assert "each robot" in gate.reason
