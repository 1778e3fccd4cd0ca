from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatch.dispatcher import BUSY, Decisions, FindWay, decide
from nena_order_service.dispatch.way import Leg, Way
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import NoRouteError
from support.order_service import dispatchable_order


def by_cost(costs: dict[str, float]) -> FindWay:
    def find_way(_order: TransportOrder, vehicle: str) -> Way:
        if vehicle not in costs:
            raise NoRouteError("X", ("Y",), None, ())
        return Way((Leg(costs[vehicle]),))

    return find_way


def pairs(decisions: Decisions) -> dict[str, str]:
    return {each.order.name: each.vehicle for each in decisions.assignments}


def test_cheapest_vehicle_gets_the_order() -> None:
    decisions = decide([dispatchable_order()], {"near": "", "far": ""}, by_cost({"near": 1, "far": 2}))
    assert pairs(decisions) == {"T-1": "near"}
    assert "cheapest" in decisions.assignments[0].why


def test_most_urgent_order_chooses_first() -> None:
    orders = [dispatchable_order(number=2), dispatchable_order(number=1)]
    decisions = decide(orders, {"near": "", "far": ""}, by_cost({"near": 1, "far": 2}))
    assert pairs(decisions) == {"T-2": "near", "T-1": "far"}


def test_intended_vehicle_is_waited_for_and_named() -> None:
    order = dispatchable_order(intended_vehicle="V-2")
    decisions = decide([order], {"V-1": "", "V-2": "is offline"}, by_cost({"V-1": 1, "V-2": 1}))
    assert pairs(decisions) == {}
    assert decisions.reasons == {"T-1": "waits for vehicle 'V-2', which is offline"}


def test_reason_names_each_kind_of_obstacle_once_and_stays_the_same() -> None:
    obstacles = {"a": "is offline", "b": BUSY, "c": "is offline"}
    reason = f"waits for a vehicle: each of them is offline or {BUSY}"
    assert decide([dispatchable_order()], obstacles, by_cost({})).reasons == {"T-1": reason}
    more = {**obstacles, "d": BUSY}
    assert decide([dispatchable_order()], more, by_cost({})).reasons == {"T-1": reason}


def test_unreachable_destination_is_the_reason() -> None:
    decisions = decide([dispatchable_order()], {"V-1": ""}, by_cost({}))
    assert "No route from 'X' to 'Y'" in decisions.reasons["T-1"]


def test_fleet_without_vehicles_is_said() -> None:
    reason = decide([dispatchable_order()], {}, by_cost({})).reasons["T-1"]
    assert "the plant model has none" in reason


@given(
    intended=st.lists(st.sampled_from([None, "a", "b", "c", "gone"]), max_size=8),
    obstacles=st.dictionaries(st.sampled_from("abcd"), st.sampled_from(["", "is offline", BUSY])),
    costs=st.dictionaries(st.sampled_from("abcd"), st.floats(0, 10)),
)
def test_every_order_is_assigned_once_or_has_a_reason(
    intended: list[str | None], obstacles: dict[str, str], costs: dict[str, float]
) -> None:
    orders = [dispatchable_order(number=n, intended_vehicle=v) for n, v in enumerate(intended, start=1)]
    decisions = decide(orders, obstacles, by_cost(costs))
    given_to = pairs(decisions)
    assert len(given_to) == len(decisions.assignments)
    assert len(set(given_to.values())) == len(given_to)
    for order in orders:
        assert (order.name in given_to) != bool(decisions.reasons.get(order.name))
    for each in decisions.assignments:
        assert obstacles[each.vehicle] == ""
        assert each.vehicle in costs
        assert each.order.status.intended_vehicle in (None, each.vehicle)


@given(costs=st.dictionaries(st.sampled_from("abcd"), st.floats(0, 10), min_size=1))
def test_no_other_free_vehicle_is_cheaper(costs: dict[str, float]) -> None:
    decisions = decide([dispatchable_order()], dict.fromkeys(costs, ""), by_cost(costs))
    assert costs[decisions.assignments[0].vehicle] == min(costs.values())


def test_a_vehicle_that_must_not_do_an_order_does_not_get_it_and_others_do() -> None:
    orders = [dispatchable_order(number=1, type="Charge"), dispatchable_order(number=2)]

    def misfit(order: TransportOrder, vehicle: str) -> str:
        return "accepts no orders of this type" if order.status.type == "Charge" and vehicle != "c" else ""

    decisions = decide(orders, {"a": "", "b": BUSY}, by_cost({"a": 1}), misfit)
    assert pairs(decisions) == {"T-2": "a"}
    assert decisions.reasons == {"T-1": "waits for a vehicle: each of them accepts no orders of this type"}
    decisions = decide(orders, {"a": "", "c": ""}, by_cost({"a": 1, "c": 9}), misfit)
    assert pairs(decisions) == {"T-1": "c", "T-2": "a"}
