from __future__ import annotations

from datetime import timedelta
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_order_service.dispatching.candidates import (
    Carried,
    DispatchedVehicle,
    Energy,
    order_types_named,
    reported_loads,
    type_priority,
    why_not_accepted,
)
from nena_order_service.dispatching.dispatcher import (
    BUSY,
    CANDIDATE_VALUES,
    COULD,
    ORDER_VALUES,
    VEHICLE_VALUES,
    Candidate,
    Decisions,
    Dispatcher,
    Now,
    explain_fits,
    rank_candidates,
    rank_orders,
    rank_vehicles,
)
from nena_order_service.dispatching.settings import (
    CandidateKey,
    Chooser,
    DispatchSettings,
    OrderKey,
    VehicleKey,
)
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.routing.router import RouteCost
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import ANY_ORDER_TYPE, AcceptableOrderType
from nena_shared.plant.model import EnergyThresholds
from nena_shared.vda5050.factsheet import Factsheet, LoadSpecification
from support.dispatching import Told, pairs, reasons, vehicles
from support.fleet_examples import factsheet, state
from support.order_service import NOW, assigned_order, dispatchable_order

LOW, RECHARGE = Reason.of("must recharge first"), Reason.of("has to recharge")
OFFLINE = Reason.of("is offline")
UNACCEPTED = Reason.of("accepts no orders of type 'Hazardous'")


def decide(
    waiting: list[TransportOrder],
    fleet: list[DispatchedVehicle],
    told: Told,
    kept: dict[int, str] | None = None,
    **settings: Any,
) -> Decisions:
    return Dispatcher(DispatchSettings(**settings)).decide(waiting, fleet, told, now=NOW, kept=kept or {})


def test_cheapest_vehicle_gets_the_order() -> None:
    decisions = decide([dispatchable_order()], vehicles(near="", far=""), Told({"near": 1, "far": 2}))
    assert pairs(decisions) == {"T-1": "near"}
    assert "cheapest" in str(decisions.assignments[0].why)


def unloading(name: str) -> DispatchedVehicle:
    """Make a vehicle that is about to be free."""
    return DispatchedVehicle(name, BUSY, soon=True)


NEAR_EACH = Told(
    {("T-1", "here"): 3, ("T-2", "here"): 4, ("T-1", "unloads"): 0, ("T-2", "unloads"): 9, "else": 20}
)
"""T-1 is near both vehicles, and nearest to the one that unloads."""


@pytest.mark.parametrize(("crowding", "chosen"), [(0.0, "T-1"), (0.1, "T-1"), (0.2, "T-2")])
def test_an_order_to_a_crowded_station_costs_more(crowding: float, chosen: str) -> None:
    """The vehicle has 100 to the first order and 125 to the other; two others are to come to the first."""
    known = Told({("T-1", "v"): 100, ("T-2", "v"): 125}, coming={"A": 2})
    orders = [dispatchable_order("A", number=1), dispatchable_order("B", number=2)]
    decisions = decide(orders, vehicles(v=""), known, crowding=crowding)

    assert pairs(decisions) == {chosen: "v"}


def test_an_order_waits_for_a_nearer_vehicle_that_is_about_to_be_free() -> None:
    orders = [dispatchable_order(number=1), dispatchable_order(number=2)]
    fleet = [*vehicles(here=""), unloading("unloads")]

    decisions = decide(orders, fleet, NEAR_EACH)

    assert pairs(decisions) == {"T-2": "here"}
    assert str(BUSY) in str(decisions.reasons["T-1"])
    assert pairs(decide(orders, vehicles(here="", unloads=BUSY), NEAR_EACH)) == {"T-1": "here"}


def test_a_free_vehicle_does_not_wait_for_one_that_is_about_to_be_free() -> None:
    fleet = [*vehicles(here=""), unloading("unloads")]
    assert pairs(decide([dispatchable_order(number=1)], fleet, NEAR_EACH)) == {"T-1": "here"}

    both = [*vehicles(here="", **{"else": ""}), unloading("unloads")]
    orders = [dispatchable_order(number=1), dispatchable_order(number=2)]
    assert pairs(decide(orders, both, NEAR_EACH)) == {"T-1": "else", "T-2": "here"}


def test_an_order_ahead_of_others_does_not_wait_for_an_unloading_vehicle() -> None:
    fleet = [*vehicles(here=""), unloading("unloads")]

    urgent = [dispatchable_order(number=1, priority=5), dispatchable_order(number=2)]
    assert pairs(decide(urgent, fleet, NEAR_EACH)) == {"T-1": "here"}
    due = [dispatchable_order(number=1, deadline=NOW + timedelta(hours=1)), dispatchable_order(number=2)]
    assert pairs(decide(due, fleet, NEAR_EACH)) == {"T-1": "here"}


def test_most_urgent_order_chooses_first() -> None:
    orders = [dispatchable_order(number=2), dispatchable_order(number=1)]
    decisions = decide(orders, vehicles(near="", far=""), Told({"near": 1, "far": 2}))
    assert pairs(decisions) == {"T-2": "near", "T-1": "far"}


def test_orders_are_sorted_by_the_keys_of_the_settings() -> None:
    orders = [dispatchable_order(number=1, name="b"), dispatchable_order(number=2, name="a")]
    decisions = decide(orders, vehicles(one=""), Told({"one": 1}), orders=[OrderKey.BY_NAME])
    assert pairs(decisions) == {"a": "one"}


def test_intended_vehicle_is_waited_for_and_named() -> None:
    order = dispatchable_order(intended_vehicle="V-2")
    decisions = decide([order], [*vehicles(V1=""), DispatchedVehicle("V-2", OFFLINE)], Told({"V1": 1}))
    assert pairs(decisions) == {}
    assert reasons(decisions) == {"T-1": "waits for robot 'V-2', which is offline"}


def test_a_load_excludes_only_orders_that_start_with_another_pick() -> None:
    orders = [dispatchable_order("A:Load", number=1), dispatchable_order("A:Unload", number=2)]
    loaded = DispatchedVehicle("V1", carried=Carried(("",)))
    decisions = decide(orders, [loaded], Told({"V1": 1}))
    assert pairs(decisions) == {"T-2": "V1"}
    assert reasons(decisions) == {
        "T-1": "waits for a robot: each of them carries a load and has no room for another one"
    }


def test_reason_names_each_kind_of_obstacle_once_and_stays_the_same() -> None:
    reason = f"waits for a robot: each of them is offline or {BUSY}"
    fleet = vehicles(a="is offline", b=BUSY, c="is offline")
    assert reasons(decide([dispatchable_order()], fleet, Told())) == {"T-1": reason}
    assert reasons(decide([dispatchable_order()], [*fleet, *vehicles(d=BUSY)], Told())) == {"T-1": reason}


def test_a_reason_does_not_grow_with_the_fleet() -> None:
    fleet = vehicles(**{f"v{number}": f"has fault {number}" for number in range(20)})
    reason = decide([dispatchable_order()], fleet, Told()).reasons["T-1"]
    assert str(reason).count("has fault") == 5
    assert str(reason).endswith("or something else")


def test_unreachable_destination_is_the_reason() -> None:
    decisions = decide([dispatchable_order()], vehicles(V1=""), Told())
    assert str(decisions.reasons["T-1"]) == "waits: robot 'V1' has no route: No route for T-1 and V1."


def test_an_order_without_a_route_does_not_hide_why_others_wait() -> None:
    orders = [dispatchable_order(number=number) for number in (1, 2, 3)]
    decisions = decide(orders, vehicles(V1=""), Told({("T-2", "V1"): 1}), choosers=Chooser.ORDERS)
    assert pairs(decisions) == {"T-2": "V1"}
    assert "'V1' has no route" in str(decisions.reasons["T-1"])
    assert str(decisions.reasons["T-3"]) == f"waits for a robot: each of them {BUSY}"


def test_fleet_without_vehicles_is_said() -> None:
    assert "none in the plant model takes orders" in str(
        decide([dispatchable_order()], [], Told()).reasons["T-1"]
    )


def test_an_unsuitable_vehicle_is_skipped_with_a_reason() -> None:
    told = Told({"picky": 1, "other": 2}, {("Hazardous", "picky"): UNACCEPTED})
    orders = [dispatchable_order(number=1, type="Hazardous")]
    picky = DispatchedVehicle("picky", order_types=(AcceptableOrderType(name="Transport"),))
    assert pairs(decide(orders, [picky, *vehicles(other="")], told)) == {"T-1": "other"}
    reason = decide(orders, [picky, *vehicles(other=BUSY)], told).reasons["T-1"]
    assert str(reason) == f"waits for a robot: each of them accepts no orders of type 'Hazardous' or {BUSY}"


def test_orders_of_another_kind_do_not_wait_for_the_reason_of_one_kind() -> None:
    told = Told({"picky": 1}, {("Hazardous", "picky"): UNACCEPTED})
    orders = [dispatchable_order(number=1, type="Hazardous"), dispatchable_order(number=2)]
    decisions = decide(orders, vehicles(picky=""), told)
    assert pairs(decisions) == {"T-2": "picky"}
    assert list(decisions.reasons) == ["T-1"]


def test_a_vehicle_without_energy_takes_orders_to_recharge_only() -> None:
    low = DispatchedVehicle("low", restriction=LOW)
    orders = [dispatchable_order(number=1), dispatchable_order("Dock:Charge", number=2)]
    decisions = decide(orders, [low], Told({"low": 1}))
    assert pairs(decisions) == {"T-2": "low"}
    assert reasons(decisions) == {"T-1": f"waits for a robot: each of them {LOW}"}


def test_a_dispensable_order_gives_way_to_others_but_not_to_dispensable_ones() -> None:
    parking = DispatchedVehicle("V1", idle=False, gives_up="Park-1")
    told = Told({"V1": 1})
    assignment = decide([dispatchable_order()], [parking], told).assignments[0]
    assert assignment.gives_up == "Park-1"
    reason = decide([dispatchable_order(dispensable=True)], [parking], told).reasons["T-1"]
    assert str(reason).endswith("has a dispensable order")


def test_a_vehicle_reserved_for_an_order_executes_it_first() -> None:
    fleet = [DispatchedVehicle("V1", kept_for=2), *vehicles(V2=BUSY)]
    orders = [dispatchable_order(number=1, priority=9), dispatchable_order(number=2)]
    decisions = decide(orders, fleet, Told({"V1": 1}), {2: "V1"})
    assert pairs(decisions) == {"T-2": "V1"}
    assert "T-1" in decisions.reasons


def test_an_order_with_a_reserved_vehicle_waits_for_no_other() -> None:
    fleet = vehicles(V1="ends a dispensable order first", V2="")
    decisions = decide([dispatchable_order()], fleet, Told({"V1": 1, "V2": 1}), {1: "V1"})
    assert reasons(decisions) == {"T-1": "waits for robot 'V1', which ends a dispensable order first"}


def test_scarce_vehicles_choose_first() -> None:
    orders = [dispatchable_order(number=number) for number in (1, 2, 3)]
    told = Told({("T-1", "V1"): 9, ("T-2", "V1"): 1, ("T-3", "V1"): 5})
    settings: dict[str, Any] = {
        "choosers": Chooser.SCARCER,
        "order_candidates": [CandidateKey.BY_COMPLETE_ROUTING_COSTS],
    }
    decisions = decide(orders, vehicles(V1=""), told, **settings)
    assert pairs(decisions) == {"T-2": "V1"}
    assert decisions.reasons.keys() == {"T-1", "T-3"}
    assert pairs(decide(orders[:1], vehicles(V1="", V2=""), told, **settings)) == {"T-1": "V1"}


NAMES = st.sampled_from("abcd")

FLEETS = st.lists(
    st.builds(
        DispatchedVehicle,
        NAMES,
        st.sampled_from([None, OFFLINE, BUSY]),
        restriction=st.sampled_from([None, LOW]),
        gives_up=st.sampled_from(["", "Park-1"]),
        energy=st.floats(0, 100),
    ),
    unique_by=lambda each: each.name,
)

WANTED = st.lists(st.tuples(st.sampled_from([None, "a", "b", "c", "gone"]), st.booleans()), max_size=8)
"""Intended vehicles, and whether the orders are dispensable."""


@given(
    wanted=WANTED, fleet=FLEETS, costs=st.dictionaries(NAMES, st.floats(0, 10)), by=st.sampled_from(Chooser)
)
def test_every_order_is_assigned_once_or_has_a_reason(
    wanted: list[tuple[str | None, bool]],
    fleet: list[DispatchedVehicle],
    costs: dict[str, float],
    by: Chooser,
) -> None:
    orders = [
        dispatchable_order(number=n, intended_vehicle=vehicle, dispensable=dispensable)
        for n, (vehicle, dispensable) in enumerate(wanted, start=1)
    ]
    decisions = decide(orders, fleet, Told(costs), choosers=by)
    given_to, known = pairs(decisions), {each.name: each for each in fleet}
    assert len(given_to) == len(decisions.assignments)
    assert len(set(given_to.values())) == len(given_to)
    for order in orders:
        assert (order.name in given_to) != bool(decisions.reasons.get(order.name))
    for each in decisions.assignments:
        vehicle = known[each.vehicle]
        assert (vehicle.obstacle, vehicle.restriction) == (None, None)
        assert each.vehicle in costs
        assert each.order.status.intended_vehicle in (None, each.vehicle)
        assert each.gives_up == vehicle.gives_up
        assert not (each.gives_up and each.order.status.dispensable)


@given(costs=st.dictionaries(NAMES, st.floats(0, 10), min_size=1))
def test_no_other_free_vehicle_is_cheaper(costs: dict[str, float]) -> None:
    decisions = decide([dispatchable_order()], vehicles(**dict.fromkeys(costs, "")), Told(costs))
    assert costs[decisions.assignments[0].vehicle] == min(costs.values())


MOMENT = Now(NOW, timedelta(minutes=1))


def due(seconds: float) -> dict[str, Any]:
    return {"deadline": NOW + timedelta(seconds=seconds)}


OLD = dispatchable_order(number=1, name="z")
URGENT = dispatchable_order(number=2, name="y", priority=5)
LATE = dispatchable_order(number=3, name="x", **due(30))
LATER = dispatchable_order(number=4, name="w", **due(3000))
ORDERS = [OLD, URGENT, LATE, LATER]


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ([OrderKey.BY_AGE], "zyxw"),
        ([OrderKey.BY_NAME], "wxyz"),
        ([OrderKey.BY_PRIORITY], "yzxw"),
        ([OrderKey.BY_DEADLINE], "xwzy"),
        ([OrderKey.DEADLINE_AT_RISK_FIRST], "xzyw"),
        ([OrderKey.DEADLINE_AT_RISK_FIRST, OrderKey.BY_PRIORITY, OrderKey.BY_DEADLINE], "xywz"),
    ],
)
def test_orders_by_key(keys: list[OrderKey], expected: str) -> None:
    assert "".join(each.name for each in sorted(ORDERS, key=rank_orders(keys, MOMENT))) == expected


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ([VehicleKey.BY_NAME], "abc"),
        ([VehicleKey.BY_ENERGY_LEVEL], "cba"),
        ([VehicleKey.IDLE_FIRST], "abc"),
        ([VehicleKey.IDLE_FIRST, VehicleKey.BY_ENERGY_LEVEL], "bac"),
    ],
)
def test_vehicles_by_key(keys: list[VehicleKey], expected: str) -> None:
    fleet = [
        DispatchedVehicle("c", energy=90, idle=False),
        DispatchedVehicle("b", energy=80),
        DispatchedVehicle("a", energy=70),
    ]
    assert "".join(each.name for each in sorted(fleet, key=rank_vehicles(keys))) == expected


def test_candidates_by_cost_and_preference() -> None:
    likes = (AcceptableOrderType(name="-", priority=3),)
    near = Candidate(OLD, DispatchedVehicle("near", order_types=likes), RouteCost(5, 2))
    short = Candidate(URGENT, DispatchedVehicle("short", idle=False), RouteCost(4, 3))
    for key, first in (
        (CandidateKey.BY_COMPLETE_ROUTING_COSTS, short),
        (CandidateKey.BY_INITIAL_ROUTING_COSTS, near),
        (CandidateKey.BY_ORDER_TYPE_PRIORITY, short),
        (CandidateKey.BY_PRIORITY, short),
        (CandidateKey.BY_AGE, near),
        (CandidateKey.BY_ORDER_NAME, short),
        (CandidateKey.BY_VEHICLE_NAME, near),
        (CandidateKey.IDLE_FIRST, near),
    ):
        assert min((near, short), key=rank_candidates([key], MOMENT)) is first, key


def test_every_key_has_a_value() -> None:
    assert ORDER_VALUES.keys() == set(OrderKey)
    assert VEHICLE_VALUES.keys() == set(VehicleKey)
    assert CANDIDATE_VALUES.keys() == set(CandidateKey)


def test_an_unknown_key_is_refused_with_the_list_of_known_ones() -> None:
    with pytest.raises(ValidationError) as refused:
        DispatchSettings.model_validate({"orders": ["BY_COLOUR"]})
    assert all(key in str(refused.value) for key in OrderKey)


orders = st.builds(
    lambda number, priority, due_in: dispatchable_order(
        number=number, priority=priority, **({} if due_in is None else due(due_in))
    ),
    st.integers(1, 50),
    st.integers(-3, 3),
    st.none() | st.integers(-100, 100),
)


@given(some=st.lists(orders, max_size=8, unique_by=lambda each: each.number), data=st.data())
def test_the_same_orders_are_always_sorted_the_same_way(
    some: list[TransportOrder], data: st.DataObject
) -> None:
    keys = data.draw(st.lists(st.sampled_from(OrderKey), min_size=1, max_size=4))
    rank = rank_orders(keys, MOMENT)
    shuffled = data.draw(st.permutations(some))
    assert sorted(shuffled, key=rank) == sorted(some, key=rank)


@given(some=st.lists(orders, max_size=8, unique_by=lambda each: each.number))
def test_the_usual_keys_are_the_urgency_of_orders(some: list[TransportOrder]) -> None:
    rank = rank_orders(DispatchSettings().orders, MOMENT)
    assert sorted(some, key=rank) == sorted(some, key=lambda order: order.urgency)


FLEET = [
    *vehicles(far="", near="", lost="", out="is offline"),
    DispatchedVehicle("low", restriction=RECHARGE),
]
TOLD = Told({"far": 9, "near": 2, "low": 1})


def test_each_vehicle_has_a_reason_and_suitable_ones_come_first() -> None:
    found = explain_fits(dispatchable_order(), FLEET, TOLD)
    assert [(each.vehicle, each.fits) for each in found[:2]] == [("near", True), ("far", True)]
    assert [each.cost for each in found] == [2, 9, None, None, None]
    assert {each.vehicle: str(each.reason) for each in found} == {
        "near": str(COULD),
        "far": str(COULD),
        "lost": "has no route: No route for T-1 and lost.",
        "low": "has to recharge",
        "out": "is offline",
    }


def test_an_unintended_vehicle_names_the_intended_one() -> None:
    order = dispatchable_order(intended_vehicle="near")
    said = {each.vehicle: str(each.reason) for each in explain_fits(order, FLEET, TOLD)}
    assert said["near"] == str(COULD)
    assert said["far"] == "is not 'near', the intended robot"
    kept = {
        each.vehicle: str(each.reason)
        for each in explain_fits(dispatchable_order(), FLEET, TOLD, kept={1: "far"})
    }
    assert kept["near"] == "is not 'far', which is reserved for it"


def test_the_executing_vehicle_is_reported() -> None:
    found = explain_fits(assigned_order(vehicle="V-1"), vehicles(**{"V-1": BUSY}), TOLD)
    assert [(each.fits, str(each.reason)) for each in found] == [(True, "does it")]


def test_a_load_in_the_way_is_explained() -> None:
    loaded = [DispatchedVehicle("near", carried=Carried(("",)))]
    (pick,), (drop,) = (
        explain_fits(dispatchable_order(stop), loaded, TOLD) for stop in ("A:Load", "A:Unload")
    )
    assert (pick.fits, str(pick.reason)) == (False, "carries a load and has no room for another one")
    assert (drop.fits, drop.reason) == (True, COULD)


ONE = Reason(ReasonCode.LOADED)


def specified(**specification: Any) -> Factsheet:
    told = LoadSpecification.model_validate(specification, strict=False)
    return factsheet().model_copy(update={"load_specification": told})


def at(*places: str | None) -> tuple[dict[str, Any], ...]:
    return tuple({"load_id": str(index), "load_position": place} for index, place in enumerate(places))


def why(places: tuple[str | None, ...], sheet: Factsheet | None, pick: Pick) -> Reason | None:
    found = reported_loads(state(loads=at(*places)), sheet)
    assert found
    return found.why_no_room(pick)


@pytest.mark.clause("7.8/loads")
@pytest.mark.parametrize("loads", [None, ()], ids=["cannot tell", "empty"])
def test_vehicles_without_or_with_unknown_loads_have_room(loads: tuple[()] | None) -> None:
    assert reported_loads(state(loads=loads), None) is None


@pytest.mark.parametrize("sheet", [None, specified(), specified(load_positions=())])
def test_a_vehicle_without_load_positions_has_one(sheet: Factsheet | None) -> None:
    assert why((None,), sheet, Pick()) == ONE
    assert why(("front",), sheet, Pick("pallet")) == ONE
    assert str(why(("front",), sheet, Pick(place="front"))) == f"{ONE} at 'front'"
    assert why(("front",), sheet, Pick(place="rear")) is None


def test_each_load_position_holds_one_load() -> None:
    sheet = specified(load_positions=("front", "rear"))
    assert why((None,), sheet, Pick()) is None
    assert str(why(("front", "rear"), sheet, Pick())) == "carries 2 loads and has no room for another one"
    assert str(why(("front", None), sheet, Pick())).startswith("carries 2 loads")
    assert why(("front",), sheet, Pick(place="rear")) is None
    assert str(why((None,), sheet, Pick(place="rear"))) == f"{ONE} at 'rear'"


def test_load_positions_accept_only_certain_load_types() -> None:
    sets = (
        {"set_name": "a", "load_type": "pallet", "load_positions": ("fork",)},
        {"set_name": "b", "load_type": "box", "load_positions": ("fork",)},
        {"set_name": "c", "load_type": "box", "load_positions": ("shelf",)},
        {"set_name": "d", "load_type": "bag"},
    )
    sheet = specified(load_positions=("fork", "shelf"), load_sets=sets)
    assert why(("fork",), sheet, Pick("pallet")) == ONE
    assert why(("shelf",), sheet, Pick("pallet")) is None
    assert [why(("fork",), sheet, Pick(each)) for each in ("box", "bag", "crate")] == [None] * 3
    assert why(("elsewhere",), sheet, Pick("pallet")) == ONE


def test_loads_can_be_compared() -> None:
    sheet = specified(load_positions=("front",))
    assert reported_loads(state(loads=at("front")), sheet) == Carried(("front",), frozenset({"front"}), {})


def test_a_vehicle_without_order_types_accepts_any_type() -> None:
    assert order_types_named(None) == ANY_ORDER_TYPE
    assert why_not_accepted(order_types_named(None), "-") is None


@pytest.mark.parametrize(
    ("names", "order_type", "priority"),
    [
        (("Transport", "Charge"), "Transport", 0),
        (("Transport", "Charge"), "Charge", 1),
        (("Transport", "Charge"), "-", None),
        (("*", "Charge"), "Charge", 1),
        (("Charge", "*"), "Transport", 1),
        ((), "Transport", None),
    ],
)
def test_the_exact_type_takes_precedence_over_any(
    names: tuple[str, ...], order_type: str, priority: int | None
) -> None:
    assert type_priority(order_types_named(names), order_type) == priority


def test_the_reason_names_what_is_accepted() -> None:
    assert (
        str(why_not_accepted(order_types_named(("B", "A")), "-"))
        == "accepts no orders of type '-', only 'B', 'A'"
    )
    assert str(why_not_accepted((), "-")) == "accepts no orders of any type"


def test_obstacles_take_precedence() -> None:
    vehicle = DispatchedVehicle("V1", OFFLINE, restriction=RECHARGE, kept_for=2)
    assert str(vehicle.why_not(dispatchable_order(), recharges=True)) == "is offline"


def test_a_restricted_vehicle_may_recharge() -> None:
    vehicle = DispatchedVehicle("V1", restriction=RECHARGE)
    assert str(vehicle.why_not(dispatchable_order(), recharges=False)) == "has to recharge"
    assert vehicle.why_not(dispatchable_order(), recharges=True) is None


def test_a_vehicle_is_reserved_for_one_order() -> None:
    vehicle = DispatchedVehicle("V1", kept_for=2)
    assert (
        str(vehicle.why_not(dispatchable_order(number=1), recharges=False)) == "is reserved for another order"
    )
    assert vehicle.why_not(dispatchable_order(number=2), recharges=False) is None


def test_a_vehicle_with_a_load_takes_what_does_not_begin_with_another_one() -> None:
    vehicle = DispatchedVehicle("V1", carried=Carried(("",)))
    order = dispatchable_order()
    assert str(vehicle.why_not(order, recharges=False, pick=Pick())).startswith("carries a load")
    assert vehicle.why_not(order, recharges=False) is None
    assert DispatchedVehicle("V1").why_not(order, recharges=False, pick=Pick()) is None


def test_types_have_priorities() -> None:
    vehicle = DispatchedVehicle("V1", order_types=(AcceptableOrderType(name="Transport", priority=4),))
    assert vehicle.type_priority(dispatchable_order(type="Transport")) == 4
    assert vehicle.type_priority(dispatchable_order(type="Park")) == inf


LEVELS = EnergyThresholds(critical=20, good=80, sufficiently_recharged=50, fully_recharged=95)


def energy(level: float, *, charging: bool = False) -> Energy:
    return Energy(level, charging, LEVELS)


@pytest.mark.parametrize(
    ("level", "critical", "degraded"), [(20, True, True), (20.1, False, True), (80.1, False, False)]
)
def test_thresholds_belong_to_the_worse_side(*, level: float, critical: bool, degraded: bool) -> None:
    assert (energy(level).critical, energy(level).degraded) == (critical, degraded)


def test_low_energy_restricts_with_a_stable_reason() -> None:
    reason = energy(3).restriction(fully=True)
    assert str(reason) == "must recharge first: critical energy (at most 20 %)"
    assert energy(19).restriction(fully=False) == reason


def test_recharging_continues_until_full_or_sufficient() -> None:
    assert "until its energy is 95 %" in str(energy(60, charging=True).restriction(fully=True))
    assert energy(60, charging=True).restriction(fully=False) is None
    assert "until its energy is 50 %" in str(energy(49, charging=True).restriction(fully=False))
    assert energy(95, charging=True).restriction(fully=True) is None


def test_only_vehicles_above_critical_energy_leave_recharging() -> None:
    even = Energy(30, charging=True, thresholds=EnergyThresholds())
    assert even.restriction(fully=False)
    assert not even.has_recharged(fully=False)


thresholds = st.tuples(*[st.integers(0, 100)] * 4).map(
    lambda four: EnergyThresholds(
        critical=min(four[:2]),
        good=max(four[:2]),
        sufficiently_recharged=min(four[2:]),
        fully_recharged=max(four[2:]),
    )
)


@given(level=st.floats(0, 100), charging=st.booleans(), levels=thresholds)
def test_more_energy_never_restricts_more(*, level: float, charging: bool, levels: EnergyThresholds) -> None:
    one, more = Energy(level, charging, levels), Energy(min(100.0, level + 5), charging, levels)
    for fully in (False, True):
        assert one.restriction(fully=fully) or not more.restriction(fully=fully)
    assert not one.restriction(fully=True) or one.critical or charging
    assert one.restriction(fully=True) or not one.restriction(fully=False)
