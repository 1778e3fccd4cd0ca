"""A reader that applies each delta to its state has the content of a snapshot."""

from __future__ import annotations

from typing import cast

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.publication import Delta, Publication
from nena_status_aggregator.fleet.views import OrderView, PeripheralView, RobotView
from support.deltas import apply_delta

NAMES = ("r1", "r2", "r3")
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("robot"), st.sampled_from(NAMES), st.none() | st.integers(0, 2)),
        st.tuples(st.just("order"), st.sampled_from(NAMES), st.none() | st.integers(0, 2)),
        st.tuples(st.just("peripheral"), st.sampled_from(NAMES), st.none() | st.integers(0, 2)),
        st.tuples(st.just("link"), st.just(""), st.integers(0, 1)),
        st.tuples(st.just("flush"), st.just(""), st.none()),
    ),
    max_size=30,
)


def robot(name: str, number: int | None) -> RobotView | None:
    return None if number is None else cast("RobotView", {"id": name, "number": number, "same": 1})


def order(name: str, number: int | None) -> OrderView | None:
    return None if number is None else cast("OrderView", {"id": name, "number": number, "same": 1})


def peripheral(name: str, number: int | None) -> PeripheralView | None:
    return None if number is None else cast("PeripheralView", {"id": name, "number": number, "same": 1})


@given(STEPS)
def test_deltas_lead_from_one_snapshot_to_the_next(steps: list[tuple[str, str, int | None]]) -> None:
    publication = Publication()
    robots: dict[str, int | None] = {}
    orders: dict[str, int | None] = {}
    peripherals: dict[str, int | None] = {}
    reader = publication.snapshot()
    for kind, name, number in [*steps, ("flush", "", None)]:
        if kind == "robot":
            robots[name] = number
            publication.robots.mark_touched(RobotKey("ACME", name))
        elif kind == "order":
            orders[name] = number
            publication.orders.mark_touched(name)
        elif kind == "peripheral":
            peripherals[name] = number
            publication.peripherals.mark_touched(name)
        elif kind == "link":
            publication.fleet["link"] = {"connected": bool(number), "since": None}
        else:
            delta = publication.flush(
                lambda key: robot(key.serial_number, robots.get(key.serial_number)),
                lambda key: order(key, orders.get(key)),
                lambda key: peripheral(key, peripherals.get(key)),
            )
            snapshot = publication.snapshot()
            if delta is None:
                assert snapshot["id"] == reader["id"]
            else:
                assert delta["id"] == reader["id"] + 1
                reader = apply_delta(delta, reader)
            assert {each["id"]: each for each in reader["robots"]} == {
                each["id"]: each for each in snapshot["robots"]
            }
            assert {each["id"]: each for each in reader["orders"]} == {
                each["id"]: each for each in snapshot["orders"]
            }
            assert {each["id"]: each for each in reader["peripherals"]} == {
                each["id"]: each for each in snapshot["peripherals"]
            }
            assert reader["link"] == snapshot["link"]


def test_delta_contains_only_changes() -> None:
    publication = Publication()
    numbers = {"r1": 1}
    key = RobotKey("ACME", "r1")

    def flush() -> Delta | None:
        publication.robots.mark_touched(key)
        return publication.flush(
            lambda each: robot(each.serial_number, numbers.get(each.serial_number)),
            lambda _: None,
            lambda _: None,
        )

    flush()
    numbers["r1"] = 2
    assert flush() == {"id": 2, "robots": [{"id": "r1", "number": 2}]}
