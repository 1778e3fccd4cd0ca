"""What an order and its updates need is done once; counted in operations, for clocks vary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from nena_order_service.dispatching.candidates import Candidates
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.feasibility import Fitter, order_problem
from nena_order_service.fleet.robot import Abilities, RobotView
from nena_order_service.fleet.vda_order import grown, released_to, update_of
from nena_order_service.routing.router import Router
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import MaximumStringLengths
from nena_shared.vda5050.topics import RobotKey
from support.fleet import make_vda_order
from support.fleet_examples import factsheet
from support.operations import calls_of
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import ForgetfulStore, ScriptedFleet, key, make_engine

NAMES = "ABCD"
PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate(NAMES)),
    paths=tuple(path(f"{a} {b}", 4000) for a, b in pairwise(NAMES)),
    vehicles=(Vehicle(name="V1"),),
)
SHORT, LONG = 10, 200
"""Nodes of a VDA order."""
ALIKE = 1.2
"""How much more work one update of a long order may be than one of a short order."""


@dataclass
class RestingFleet(ScriptedFleet):
    """Robots whose views are the same objects until something changes, as in fleet control."""

    views: dict[tuple[object, ...], RobotView] = field(default_factory=dict)

    def view(self, robot: RobotKey) -> RobotView:
        moment = robot, self.at.get(robot.serial_number), robot in self.missions
        return self.views.setdefault(moment, super().view(robot))


async def resting() -> tuple[Engine, RestingFleet]:
    """Start an engine with a vehicle at rest that has been read."""
    fleet = RestingFleet({"V1": "A"})
    settings = EngineSettings(default_map_id="map")
    engine = await make_engine(PLANT, ForgetfulStore(), fleet, settings=settings)
    fleet.appear("V1", "A")
    return engine, fleet


def counted(monkeypatch: pytest.MonkeyPatch, owner: type, name: str) -> list[tuple[Any, ...]]:
    """Return a list to which each call of a method from now on adds its arguments."""
    calls: list[tuple[Any, ...]] = []
    method: Callable[..., Any] = getattr(owner, name)

    def counting(*arguments: Any, **named: Any) -> Any:
        calls.append(arguments[1:])
        return method(*arguments, **named)

    monkeypatch.setattr(owner, name, counting)
    return calls


async def test_a_chosen_vehicle_that_has_not_changed_is_not_read_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, fleet = await resting()
    looks = counted(monkeypatch, Candidates, "look_at")
    engine.create(request("D"), "T1")
    assert len(fleet.sent) == 1
    assert not looks


async def test_a_chosen_vehicle_that_has_changed_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, fleet = await resting()
    looks = counted(monkeypatch, Candidates, "look_at")
    fleet.at["V1"] = "B"  # without an event
    engine.create(request("D"), "T1")
    assert looks
    assert fleet.sent[0][1].nodes[0].node_id == "B"


async def test_states_of_a_vehicle_that_drives_for_its_order_are_not_read_by_the_dispatcher(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, fleet = await resting()
    engine.create(request("D"), "T1")
    fleet.appear("V1", "A")
    reads = counted(monkeypatch, Candidates, "look_at")
    fleet.appear("V1", "B")
    assert not reads
    fleet.finish("V1")
    assert reads


async def test_states_of_a_vehicle_that_is_about_to_be_free_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, fleet = await resting()
    order = engine.create(request("D"), "T1")
    engine.withdraw(order.number, "no longer wanted")
    assert key("V1") in fleet.missions
    reads = counted(monkeypatch, Candidates, "look_at")
    fleet.appear("V1", "B")
    assert reads


async def test_whether_places_are_routable_is_found_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, _ = await resting()
    finder = engine.context.finder
    searches = counted(monkeypatch, Router, "route_through")
    places = request("D", "B").destinations
    first = finder.why_unroutable(places, frozenset())
    assert (len(searches), first) == (1, finder.why_unroutable(places, frozenset()))
    assert len(searches) == 1

    finder.set_locks({"A B": False})
    finder.why_unroutable(places, frozenset())
    finder.why_unroutable(places, frozenset({"C"}))
    assert len(searches) == 3


def test_an_order_is_encoded_for_its_check_only_if_its_size_is_limited(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    encoded = counted(monkeypatch, Codec, "written")
    vda_order, sheet = make_vda_order("m1", *"AB"), factsheet()
    assert order_problem(vda_order, Abilities(sheet)) is None
    assert not encoded

    lengths = MaximumStringLengths(maximum_message_length=10)
    limits = sheet.protocol_limits.model_copy(update={"maximum_string_lengths": lengths})
    limited = Abilities(sheet.model_copy(update={"protocol_limits": limits}))
    assert "messages of 10 bytes" in (order_problem(vda_order, limited) or "")
    assert len(encoded) == 1


@pytest.mark.parametrize(
    "step", ["released_to", "grown", "fitted", "update_of"], ids=lambda each: each.replace("_", " ")
)
def test_an_update_of_a_long_order_costs_as_much_as_one_of_a_short_order(step: str) -> None:
    few, many = _calls_of_update(step, SHORT), _calls_of_update(step, LONG)
    assert many < few * ALIKE, (few, many)


def _calls_of_update(step: str, length: int) -> int:
    plan = make_vda_order("m1", *(f"P{index}" for index in range(length)))
    fitter, abilities = Fitter(), Abilities(factsheet())
    held = fitter.fitted(released_to(plan, 2), abilities)
    wanted = released_to(plan, 4)
    counted_lengths = held.base_length, wanted.base_length
    assert counted_lengths == (2, 3)
    steps: dict[str, Callable[[], object]] = {
        "released_to": lambda: released_to(plan, 6),
        "grown": lambda: grown(held, wanted),
        "fitted": lambda: fitter.fitted(wanted, abilities),
        "update_of": lambda: update_of(held, wanted),
    }
    return calls_of(steps[step])
