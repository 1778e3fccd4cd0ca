from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from unittest.mock import Mock

import pytest
from structlog.testing import capture_logs

from nena_order_service.engine.state import FleetState
from nena_order_service.engine.status import Essentials
from nena_order_service.engine.unit_of_work import UNPUBLISHED_AT_MOST, UnitOfWork
from nena_order_service.errors import StoreNotReadyError, UnknownError
from nena_order_service.fleet.outputs import FleetOutput, RobotChanged
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.vehicle import VehicleStatus
from support.order_service import dispatchable_order
from support.scripted_fleet import MemoryStore, key, make_state


@dataclass
class Work:
    """A state, its units of work, and what comes of them."""

    state: FleetState
    unit: UnitOfWork
    events: list[FleetOutput]


def make(store: MemoryStore, published: Callable[[str], VehicleStatus | None] = lambda _: None) -> Work:
    state = make_state()
    events: list[FleetOutput] = []
    unit = UnitOfWork(state, store, published, events.append, timeout=10.0)
    unit.vehicle_listeners.append(Mock())
    return Work(state, unit, events)


@pytest.fixture
def work(store: MemoryStore) -> Work:
    return make(store)


def test_effects_run_after_the_commit_in_order(work: Work, store: MemoryStore) -> None:
    done: list[str] = []
    store.held = True
    for name in ("first", "second"):
        with work.unit.begin():
            work.state.after_commit(lambda name=name: done.append(name))  # type: ignore[misc] # bound at once
    assert done == []
    store.release()
    assert done == ["first", "second"]


@pytest.mark.provokes_failures
def test_a_failing_effect_does_not_prevent_others(work: Work) -> None:
    done: list[str] = []

    def fail() -> None:
        raise RuntimeError

    with capture_logs() as logged, work.unit.begin():
        work.state.after_commit(fail)
        work.state.after_commit(lambda: done.append("other"))
    assert done == ["other"]
    assert [line["log_level"] for line in logged] == ["error"]


def test_the_event_that_an_effect_returns_is_handled(work: Work) -> None:
    with work.unit.begin():
        work.state.after_commit(lambda: RobotChanged(key("V1")))
    assert work.events == [RobotChanged(key("V1"))]


@pytest.mark.provokes_failures
def test_nothing_of_a_unit_that_fails_half_way_is_committed(work: Work, store: MemoryStore) -> None:
    done: list[str] = []

    def fail_half_way() -> None:
        with work.unit.begin():
            work.state.orders.put(dispatchable_order())
            work.state.after_commit(lambda: done.append("sent"))
            raise KeyError

    with pytest.raises(KeyError):
        fail_half_way()
    assert (store.commits, done) == (0, [])
    assert work.unit.failed.is_set()
    with pytest.raises(StoreNotReadyError, match="restarts from its store"), work.unit.begin():
        pass


def test_after_a_refused_request_work_continues(work: Work) -> None:
    with pytest.raises(UnknownError), work.unit.begin():
        raise UnknownError(Refusal.UNKNOWN_ORDER, "T")
    with work.unit.begin():
        pass


@pytest.mark.provokes_failures
def test_a_request_that_is_refused_after_a_change_is_a_failure(work: Work, store: MemoryStore) -> None:
    def refuse_late() -> None:
        with work.unit.begin():
            work.state.orders.put(dispatchable_order())
            raise UnknownError(Refusal.UNKNOWN_ORDER, "T")

    with pytest.raises(UnknownError):
        refuse_late()
    assert store.commits == 0
    assert work.unit.failed.is_set()


def test_the_last_of_several_pending_units_publishes_a_vehicle(store: MemoryStore) -> None:
    asked: list[str] = []
    work = make(store, asked.append)
    store.held = True
    for names in (("V1", "V2"), ("V1",)):
        with work.unit.begin():
            for name in names:
                work.state.vehicle_changed(name)
    store.release_one()
    assert asked == ["V2"]
    store.release()
    assert asked == ["V2", "V1"]

    with work.unit.begin():
        work.state.vehicle_changed("V1")
    assert asked == ["V2", "V1", "V1"]


def test_pending_publications_need_no_check(work: Work, store: MemoryStore) -> None:
    store.held = True
    now = Essentials(*(None,) * len(Essentials._fields))  # type: ignore[arg-type] # any will do
    assert not work.unit.is_published("V1", now)
    with work.unit.begin():
        work.state.vehicle_changed("V1")
    assert work.unit.is_published("V1", now)
    store.release()
    assert not work.unit.is_published("V1", now)


def test_a_constantly_changing_vehicle_is_published_occasionally(store: MemoryStore) -> None:
    asked: list[str] = []
    work = make(store, asked.append)
    store.held = True
    for number in range(3 * UNPUBLISHED_AT_MOST):
        with work.unit.begin():
            work.state.vehicle_changed("V1")
        if number:
            store.release_one()
    assert asked == ["V1", "V1"]
    store.release()
    assert asked == ["V1", "V1", "V1"]


def test_a_unit_started_by_an_effect_publishes_instead_of_the_previous_one(store: MemoryStore) -> None:
    asked: list[str] = []
    work = make(store, asked.append)

    def change_again() -> None:
        with work.unit.begin():
            work.state.vehicle_changed("V1")

    store.held = True
    with work.unit.begin():
        work.state.vehicle_changed("V1")
        work.state.after_commit(change_again)
    store.release_one()
    assert asked == []
    store.release()
    assert asked == ["V1"]


async def test_committed_completes_after_all_earlier_changes(work: Work, store: MemoryStore) -> None:
    store.held = True
    future = work.unit.committed()
    assert not future.done()
    store.release()
    assert future.done()
