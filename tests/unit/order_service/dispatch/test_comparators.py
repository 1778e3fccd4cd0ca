from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_order_service.dispatching.dispatcher import (
    CANDIDATE_VALUES,
    ORDER_VALUES,
    VEHICLE_VALUES,
    Candidate,
    DispatchedVehicle,
    Now,
    rank_candidates,
    rank_orders,
    rank_vehicles,
)
from nena_order_service.dispatching.settings import CandidateKey, DispatchSettings, OrderKey, VehicleKey
from nena_order_service.dispatching.way import WayCost
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.order_types import AcceptableOrderType
from support.order_service import NOW, dispatchable_order

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


def test_candidates_by_cost_and_by_what_vehicles_like() -> None:
    likes = (AcceptableOrderType(name="-", priority=3),)
    near = Candidate(OLD, DispatchedVehicle("near", order_types=likes), WayCost(5, 2))
    short = Candidate(URGENT, DispatchedVehicle("short", idle=False), WayCost(4, 3))
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


def test_an_unknown_key_is_refused_with_the_list_of_those_that_there_are() -> None:
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
