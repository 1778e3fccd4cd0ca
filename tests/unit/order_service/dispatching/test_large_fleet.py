"""Of many free vehicles only the nearest are compared with an order, with the same result."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_order_service.dispatching.settings import Chooser, DispatchSettings
from nena_order_service.engine import dispatching
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.plant.property_keys import ACCEPTABLE_ORDER_TYPES
from support.operations import calls_of
from support.order_service import request
from support.pausing import turn_passes
from support.plants import grid_name, grid_plant
from support.scripted_fleet import ForgetfulStore, ScriptedFleet, make_engine

SIDE = 5
PLACES = [grid_name(column, row) for column in range(SIDE) for row in range(SIDE)]
GRID = grid_plant(SIDE, SIDE)
FEW, MANY = 100, 400
"""Free vehicles."""
ALIKE = 1.2
"""How much more work one order may be with four times as many of them."""


async def fleet_at(
    places: list[str], *, types: list[str] | None = None, dispatch: dict[str, Any]
) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with free vehicles at these points, which accept orders of these types (empty: all)."""
    named = {f"V{index:03}": place for index, place in enumerate(places)}
    accepted = types or [""] * len(places)
    plant = PlantModel(
        name="grid",
        points=(*GRID.points, GRID.points[0].model_copy(update={"name": "far away"})),
        paths=GRID.paths,
        vehicles=tuple(
            Vehicle(name=name, properties={ACCEPTABLE_ORDER_TYPES: each})
            for name, each in zip(named, accepted, strict=True)
        ),
    )
    fleet = ScriptedFleet(dict(named))
    engine_settings = EngineSettings(
        default_map_id="map",
        traffic=False,
        dispatch=DispatchSettings.model_validate({"energy": {"respected": False}, **dispatch}),
    )
    engine = await make_engine(plant, ForgetfulStore(), fleet, settings=engine_settings)
    return engine, fleet


async def test_an_order_costs_the_same_with_many_free_vehicles() -> None:
    calls = []
    for number in (FEW, MANY):
        engine, _ = await fleet_at([PLACES[7], *(number - 1) * PLACES[:1]], dispatch={})
        engine.look()  # once after the start, all vehicles are checked whether they have reported
        calls.append(calls_of(lambda engine=engine: engine.create(request(PLACES[7]), "new")))  # type: ignore[misc]
    assert calls[1] < calls[0] * ALIKE, calls


types_of = st.sampled_from(["", "a", "a,b"])
orders_of = st.fixed_dictionaries(
    {},
    optional={
        "type": st.sampled_from("abc"),
        "priority": st.integers(0, 1),
        "intendedVehicle": st.sampled_from(["V000", "V001"]),
        "dispensable": st.booleans(),
    },
)


async def _outcome(
    vehicles: list[tuple[str, str]],
    orders: list[tuple[list[str], dict[str, Any]]],
    dispatch: dict[str, Any],
    *,
    at_once: bool,
) -> object:
    """Return which vehicles get which orders and why, and why the other orders wait."""
    engine, fleet = await fleet_at(
        [place for place, _ in vehicles], types=[types for _, types in vehicles], dispatch=dispatch
    )
    if at_once:
        fleet.out_of_order.update(fleet.at)
        engine.look()
    for index, (stops, fields) in enumerate(orders):
        given_fields = {key: value for key, value in fields.items() if value != "V001" or len(vehicles) > 1}
        engine.create(request(*stops, **given_fields), f"T{index}")
    fleet.out_of_order.clear()
    engine.look()
    for _ in range(5):
        await turn_passes()
    found = [engine.state.orders.get(number + 1).status for number in range(len(orders))]
    return [(each.state, each.processing_vehicle, each.reason, each.history) for each in found]


@pytest.mark.parametrize("at_once", [False, True], ids=["one by one", "at once"])
@pytest.mark.parametrize("chooser", [Chooser.TOGETHER, Chooser.ORDERS])
@settings(max_examples=15)
@given(
    vehicles=st.lists(st.tuples(st.sampled_from([*PLACES, "far away"]), types_of), min_size=1, max_size=8),
    orders=st.lists(
        st.tuples(st.lists(st.sampled_from(PLACES), min_size=1, max_size=2), orders_of), max_size=6
    ),
)
def test_the_nearest_vehicles_suffice(
    *,
    vehicles: list[tuple[str, str]],
    orders: list[tuple[list[str], dict[str, Any]]],
    chooser: Chooser,
    at_once: bool,
) -> None:
    outcomes = []
    for compared in (0, 1000):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(dispatching, "ALL_COMPARED", compared)
            outcome = _outcome(vehicles, orders, {"choosers": chooser}, at_once=at_once)
            outcomes.append(asyncio.run(outcome))
    assert outcomes[0] == outcomes[1]
