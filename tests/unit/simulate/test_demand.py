"""Orders come from tables, from the order service's statuses, or are drawn at random."""

from __future__ import annotations

import json
from itertools import islice, takewhile
from pathlib import Path
from random import Random

import pytest

from bench.halls import two_halls
from nena_simulate.demand import Demand, DemandError, Relation, Transport, every_relation, read_orders
from nena_simulate.operations import Operations

PLANT = two_halls().plant
OPERATIONS = Operations(PLANT, {})
MAKE = Transport(PLANT, OPERATIONS)
ONE, OTHER, THIRD = two_halls().stations[:3]


def written(folder: Path, text: str, name: str = "orders.csv") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def test_rates_per_relation(tmp_path: Path) -> None:
    demand = read_orders(
        written(tmp_path, f"from,to,per_hour\n{ONE},{OTHER},60\n{OTHER},{ONE},30\n"), PLANT, OPERATIONS
    )

    assert demand.relations == (Relation(ONE, OTHER, 60), Relation(OTHER, ONE, 30))
    hours = 100.0
    orders = list(takewhile(lambda each: each.at < hours * 3600, demand.timed(MAKE, Random(1))))
    there = [each for each in orders if each.request.destinations[0].location_name == ONE]
    assert len(there) == pytest.approx(60 * hours, rel=0.1)
    assert len(orders) == pytest.approx(90 * hours, rel=0.1)
    assert [each.at for each in orders] == sorted(each.at for each in orders)
    assert [each.operation for each in orders[0].request.destinations] == ["Load cargo", "Unload cargo"]


def test_recorded_orders_count_from_the_first_of_their_times_of_day(tmp_path: Path) -> None:
    table = f"at,from,to\n2026-03-01T06:01:00Z,{ONE},{OTHER}\n2026-03-01T06:00:00Z,{OTHER},{THIRD}\n"

    orders = read_orders(written(tmp_path, table), PLANT, OPERATIONS).orders

    assert [each.at for each in orders] == [0.0, 60.0]
    assert orders[0].request.destinations[1].location_name == THIRD


def test_seconds_are_counted_from_the_start(tmp_path: Path) -> None:
    orders = read_orders(written(tmp_path, f"at,from,to\n90,{ONE},{OTHER}\n"), PLANT, OPERATIONS).orders

    assert [each.at for each in orders] == [90.0]


def test_orders_of_an_order_service_are_repeated(tmp_path: Path) -> None:
    told = {
        "transportOrders": [
            {
                "name": "TOrder-1",
                "created": "2026-03-01T06:00:00.000Z",
                "priority": 7,
                "driveOrders": [{"destination": {"locationName": ONE, "operation": "Load cargo"}}],
            }
        ]
    }

    (order,) = read_orders(written(tmp_path, json.dumps(told), "orders.json"), PLANT, OPERATIONS).orders

    assert (order.at, order.request.priority, order.request.name) == (0.0, 7, None)


def test_requests_with_a_time(tmp_path: Path) -> None:
    asked = [{"at": 5, "destinations": [{"locationName": ONE, "operation": "Load cargo"}]}]

    (order,) = read_orders(written(tmp_path, json.dumps(asked), "orders.json"), PLANT, OPERATIONS).orders

    assert order.at == 5.0


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("orders.csv", "from,to\nA,B\n", "the columns must be"),
        ("orders.csv", f"from,to,per_hour\n{ONE},Nowhere,1\n", "no location 'Nowhere'"),
        ("orders.csv", f"from,to,per_hour\n{ONE},{OTHER},many\n", "many"),
        ("orders.json", '{"orders": []}', "transportOrders"),
        ("orders.json", "[", "orders.json"),
    ],
)
def test_error_in_a_file_is_reported(tmp_path: Path, name: str, text: str, what: str) -> None:
    with pytest.raises(DemandError, match=what):
        read_orders(written(tmp_path, text, name), PLANT, OPERATIONS)


def test_a_backlog_is_drawn_between_any_two_stations() -> None:
    relations = every_relation(PLANT, OPERATIONS)
    drawn = islice(Demand(backlog=5).waiting(MAKE, relations, Random(1)), 2000)
    names = {tuple(each.location_name for each in one.destinations) for one in drawn}

    assert {name for pair in names for name in pair} == set(two_halls().stations)
    assert all(one != other for one, other in names)
    assert len(relations) == len(two_halls().stations) * (len(two_halls().stations) - 1)
