from __future__ import annotations

import pytest
from structlog.testing import capture_logs

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.steps import UNTOLD_AT_MOST, Steps
from nena_order_service.kernel.vehicle_status import Essentials
from support.order_service import dispatchable_order
from support.scripted_fleet import MemoryStore


@pytest.fixture
def store() -> MemoryStore:
    return MemoryStore()


@pytest.fixture
def steps(store: MemoryStore) -> Steps:
    return Steps(OrderBook(), store, lambda _: None)


def test_effects_wait_for_the_commit_and_keep_their_order(steps: Steps, store: MemoryStore) -> None:
    done: list[str] = []
    store.held = True
    for name in ("first", "second"):
        with steps.step():
            steps.after_commit(lambda name=name: done.append(name))  # type: ignore[misc] # bound at once
    assert done == []
    store.release()
    assert done == ["first", "second"]


def test_effect_that_fails_keeps_no_other_from_being_done(steps: Steps) -> None:
    done: list[str] = []

    def fail() -> None:
        raise RuntimeError

    with capture_logs() as logged, steps.step():
        steps.after_commit(fail)
        steps.after_commit(lambda: done.append("other"))
    assert done == ["other"]
    assert [line["log_level"] for line in logged] == ["error"]


def test_changes_of_a_step_that_fails_half_way_are_kept() -> None:
    book, store = OrderBook(), MemoryStore()
    steps = Steps(book, store, lambda _: None)

    def fail_half_way() -> None:
        with steps.step():
            book.put(dispatchable_order())
            raise KeyError

    with pytest.raises(KeyError):
        fail_half_way()
    assert [order.name for order in store.found.orders] == ["T-1"]


def test_of_steps_that_wait_together_the_last_tells_how_a_vehicle_stands(store: MemoryStore) -> None:
    asked: list[str] = []
    steps = Steps(OrderBook(), store, asked.append)
    store.held = True
    for names in (("V1", "V2"), ("V1",)):
        with steps.step():
            for name in names:
                steps.vehicle_changed(name)
    store.release_one()
    assert asked == ["V2"]
    store.release()
    assert asked == ["V2", "V1"]

    with steps.step():
        steps.vehicle_changed("V1")
    assert asked == ["V2", "V1", "V1"]


def test_what_waits_to_be_told_needs_no_look(store: MemoryStore) -> None:
    steps = Steps(OrderBook(), store, lambda _: None)
    store.held = True
    now = Essentials(*(None,) * len(Essentials._fields))  # type: ignore[arg-type] # any will do
    assert not steps.vehicle_as_told("V1", now)
    with steps.step():
        steps.vehicle_changed("V1")
    assert steps.vehicle_as_told("V1", now)
    store.release()
    assert not steps.vehicle_as_told("V1", now)


def test_a_vehicle_that_changes_without_end_is_told_now_and_then(store: MemoryStore) -> None:
    asked: list[str] = []
    steps = Steps(OrderBook(), store, asked.append)
    store.held = True
    for number in range(3 * UNTOLD_AT_MOST):
        with steps.step():
            steps.vehicle_changed("V1")
        if number:
            store.release_one()
    assert asked == ["V1", "V1"]
    store.release()
    assert asked == ["V1", "V1", "V1"]


def test_a_step_that_an_effect_makes_tells_instead_of_the_one_before(store: MemoryStore) -> None:
    asked: list[str] = []
    steps = Steps(OrderBook(), store, asked.append)

    def change_again() -> None:
        with steps.step():
            steps.vehicle_changed("V1")

    store.held = True
    with steps.step():
        steps.vehicle_changed("V1")
        steps.after_commit(change_again)
    store.release_one()
    assert asked == []
    store.release()
    assert asked == ["V1"]


async def test_committed_is_done_after_all_that_came_before(steps: Steps, store: MemoryStore) -> None:
    store.held = True
    future = steps.committed()
    assert not future.done()
    store.release()
    assert future.done()
