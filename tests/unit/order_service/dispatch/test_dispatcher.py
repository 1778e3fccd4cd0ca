from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.dispatcher import BUSY, Carried, Decisions, DispatchedVehicle, Dispatcher
from nena_order_service.dispatching.settings import CandidateKey, Chooser, DispatchSettings, OrderKey
from nena_order_service.orders.transport_order import TransportOrder
from support.dispatching import Told, pairs, vehicles
from support.order_service import NOW, dispatchable_order

LOW = "has to recharge first"


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
    assert "cheapest" in decisions.assignments[0].why


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
    decisions = decide([order], [*vehicles(V1=""), DispatchedVehicle("V-2", "is offline")], Told({"V1": 1}))
    assert pairs(decisions) == {}
    assert decisions.reasons == {"T-1": "waits for vehicle 'V-2', which is offline"}


def test_a_load_keeps_a_vehicle_from_orders_that_begin_with_another_one_and_from_no_others() -> None:
    orders = [dispatchable_order("A:Load", number=1), dispatchable_order("A:Unload", number=2)]
    loaded = DispatchedVehicle("V1", carried=Carried(("",)))
    decisions = decide(orders, [loaded], Told({"V1": 1}))
    assert pairs(decisions) == {"T-2": "V1"}
    assert decisions.reasons == {
        "T-1": "waits for a vehicle: each of them carries a load, and has no room for another one"
    }


def test_reason_names_each_kind_of_obstacle_once_and_stays_the_same() -> None:
    reason = f"waits for a vehicle: each of them is offline or {BUSY}"
    fleet = vehicles(a="is offline", b=BUSY, c="is offline")
    assert decide([dispatchable_order()], fleet, Told()).reasons == {"T-1": reason}
    assert decide([dispatchable_order()], [*fleet, *vehicles(d=BUSY)], Told()).reasons == {"T-1": reason}


def test_a_reason_does_not_grow_with_the_fleet() -> None:
    fleet = vehicles(**{f"v{number}": f"has fault {number}" for number in range(20)})
    reason = decide([dispatchable_order()], fleet, Told()).reasons["T-1"]
    assert reason.count("has fault") == 5
    assert reason.endswith("or something else")


def test_unreachable_destination_is_the_reason() -> None:
    decisions = decide([dispatchable_order()], vehicles(V1=""), Told())
    assert decisions.reasons["T-1"] == "waits, for vehicle 'V1' has no way: No route for T-1 and V1."


def test_fleet_without_vehicles_is_said() -> None:
    assert "the plant model has none" in decide([dispatchable_order()], [], Told()).reasons["T-1"]


def test_a_vehicle_that_must_not_do_an_order_is_passed_over_and_the_reason_is_told() -> None:
    told = Told({"picky": 1, "other": 2}, {("Hazardous", "picky"): "accepts no orders of type 'Hazardous'"})
    orders = [dispatchable_order(number=1, type="Hazardous")]
    assert pairs(decide(orders, vehicles(picky="", other=""), told)) == {"T-1": "other"}
    reason = decide(orders, vehicles(picky="", other=BUSY), told).reasons["T-1"]
    assert reason == f"waits for a vehicle: each of them accepts no orders of type 'Hazardous' or {BUSY}"


def test_orders_of_another_kind_do_not_wait_for_the_reason_of_one_kind() -> None:
    told = Told({"picky": 1}, {("Hazardous", "picky"): "accepts no orders of type 'Hazardous'"})
    orders = [dispatchable_order(number=1, type="Hazardous"), dispatchable_order(number=2)]
    decisions = decide(orders, vehicles(picky=""), told)
    assert pairs(decisions) == {"T-2": "picky"}
    assert list(decisions.reasons) == ["T-1"]


def test_a_vehicle_without_energy_takes_orders_to_recharge_only() -> None:
    low = DispatchedVehicle("low", restriction=LOW)
    orders = [dispatchable_order(number=1), dispatchable_order("Dock:Charge", number=2)]
    decisions = decide(orders, [low], Told({"low": 1}))
    assert pairs(decisions) == {"T-2": "low"}
    assert decisions.reasons == {"T-1": f"waits for a vehicle: each of them {LOW}"}


def test_a_dispensable_order_is_given_up_for_another_one_but_not_for_its_like() -> None:
    parking = DispatchedVehicle("V1", idle=False, gives_up="Park-1")
    told = Told({"V1": 1})
    assignment = decide([dispatchable_order()], [parking], told).assignments[0]
    assert assignment.gives_up == "Park-1"
    reason = decide([dispatchable_order(dispensable=True)], [parking], told).reasons["T-1"]
    assert reason.endswith("has a dispensable order itself")


def test_a_vehicle_that_is_kept_for_an_order_does_that_one_first_of_all() -> None:
    fleet = [DispatchedVehicle("V1", kept_for=2), *vehicles(V2=BUSY)]
    orders = [dispatchable_order(number=1, priority=9), dispatchable_order(number=2)]
    decisions = decide(orders, fleet, Told({"V1": 1}), {2: "V1"})
    assert pairs(decisions) == {"T-2": "V1"}
    assert "T-1" in decisions.reasons


def test_an_order_for_which_a_vehicle_is_kept_waits_for_no_other_one() -> None:
    fleet = vehicles(V1="gives up a dispensable order first", V2="")
    decisions = decide([dispatchable_order()], fleet, Told({"V1": 1, "V2": 1}), {1: "V1"})
    assert decisions.reasons == {"T-1": "waits for vehicle 'V1', which gives up a dispensable order first"}


def test_who_is_scarce_may_choose() -> None:
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
        st.sampled_from(["", "is offline", BUSY]),
        restriction=st.sampled_from(["", LOW]),
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
        assert (vehicle.obstacle, vehicle.restriction) == ("", "")
        assert each.vehicle in costs
        assert each.order.status.intended_vehicle in (None, each.vehicle)
        assert each.gives_up == vehicle.gives_up
        assert not (each.gives_up and each.order.status.dispensable)


@given(costs=st.dictionaries(NAMES, st.floats(0, 10), min_size=1))
def test_no_other_free_vehicle_is_cheaper(costs: dict[str, float]) -> None:
    decisions = decide([dispatchable_order()], vehicles(**dict.fromkeys(costs, "")), Told(costs))
    assert costs[decisions.assignments[0].vehicle] == min(costs.values())
