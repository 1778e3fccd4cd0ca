"""The state: what is shown to hosts only once it is committed, and what is stored."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.engine import state as state_module
from nena_order_service.engine.state import FleetState
from nena_order_service.engine.unit_of_work import UnitOfWork
from nena_order_service.orders.drive import Drive, DriveState
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.database import Changes, DriveRow
from nena_order_service.traffic.resources import ResourceSet
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.transport_order import (
    OrderSequenceRequest,
    OrderSequenceStatus,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.plant import Vehicle
from support.fleet import make_vda_order
from support.order_service import NOW, assigned_order, dispatchable_order
from support.scripted_fleet import MemoryStore, key, make_state


def take(state: FleetState) -> tuple[Changes, list[TransportOrder]]:
    """Return what is to be stored, and the orders to be published."""
    taken = state.pending.take()
    return taken.stored, taken.orders


def test_order_is_visible_only_after_the_commit() -> None:
    state = make_state()
    book = state.orders
    order = dispatchable_order(idempotency_key="k")
    book.put(order)
    assert (book.named("T-1"), book.keyed("k")) == (order, order)
    assert book.visible_named("T-1") is None
    changes, told = take(state)
    assert list(changes.orders) == [1]
    book.committed(told)
    assert book.visible_named("T-1") == order


def test_same_version_again_is_no_change() -> None:
    state = make_state()
    book = state.orders
    order = dispatchable_order()
    book.load(order)
    book.put(order)
    assert take(state)[1] == []


def test_consecutive_versions_in_one_state_are_published_once() -> None:
    state = make_state()
    book = state.orders
    order = dispatchable_order()
    deferred = order.deferred(Reason.of("nobody is free"), NOW)
    assigned = deferred.assigned("V", [("A",)], Reason.of("near"), NOW)
    for version in (order, deferred, assigned):
        book.put(version)
    assert take(state)[1] == [deferred, assigned]


def test_only_old_ended_orders_are_dropped_from_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_module, "RECENT_LIMIT", 2)
    state = make_state()
    book = state.orders
    book.put(dispatchable_order(number=1))
    for number in range(2, 6):
        book.put(assigned_order(number=number, idempotency_key=f"k{number}").finished(NOW))
        book.committed(take(state)[1])
    assert [number for number in range(1, 6) if book.named(f"T-{number}")] == [1, 4, 5]
    assert book.keyed("k2") is None


@given(st.permutations(range(1, 7)), st.lists(st.integers(-2, 2), min_size=6, max_size=6))
def test_queue_has_waiting_orders_by_urgency(numbers: list[int], priorities: list[int]) -> None:
    state = make_state()
    book = state.orders
    orders = {
        number: dispatchable_order(number=number, priority=priorities[number - 1]) for number in numbers
    }
    for number in numbers:
        book.put(orders[number])
    for number in numbers[:2]:
        book.put(orders[number].failed(Reason.of("x"), NOW))
    for number in numbers[2:]:
        orders[number] = orders[number].deferred(Reason.of("nobody is free"), NOW)
        book.put(orders[number])
    waiting = [orders[number] for number in numbers[2:]]
    assert list(book.dispatchable()) == sorted(waiting, key=lambda order: order.urgency)
    assert book.any_waiting


ROBOT = key("V-1")


def sent_drive(order: TransportOrder) -> Drive:
    drive = Drive.to_current_destination(order, ROBOT)
    return drive.granted(make_vda_order(drive.order_id, "A", "B"), ()).changed(state=DriveState.SENT)


def test_a_robot_works_for_its_order_before_between_and_after_drives() -> None:
    state = make_state()
    drives = state.drives
    order = assigned_order("A", "B")
    drives.assign(order, ROBOT)
    assert (drives.order_number(ROBOT), drives.of_order(order)) == (1, None)

    drive = sent_drive(order)
    drives.put(drive)
    assert (drives.with_id(ROBOT, drive.order_id), drives.of_order(order)) == (drive, drive)
    assert take(state)[0].drives == {str(ROBOT): DriveRow(1, drive.document)}

    drives.end(drive)
    assert (drives.with_id(ROBOT, drive.order_id), drives.order_number(ROBOT)) == (None, 1)
    assert take(state)[0].drives == {str(ROBOT): None}

    assert drives.release(order) == ROBOT
    assert drives.order_number(ROBOT) is None
    assert drives.release(order) is None


def test_nothing_of_a_drive_is_stored_before_it_is_sent() -> None:
    state = make_state()
    drives = state.drives
    order = assigned_order("A", "B")
    drives.assign(order, ROBOT)
    requested = Drive.to_current_destination(order, ROBOT)
    drives.put(requested)
    assert (drives.requested, drives.granted, drives.sent) == ({ROBOT: requested}, {}, {})
    granted = requested.granted(make_vda_order(requested.order_id, "A", "B"), ())
    drives.put(granted)
    assert (drives.requested, drives.granted, drives.sent) == ({}, {ROBOT: granted}, {})
    assert not take(state)[0].drives


def test_an_ended_order_drops_its_drive() -> None:
    state = make_state()
    drives = state.drives
    order = assigned_order("A")
    drives.assign(order, ROBOT)
    drives.put(sent_drive(order))
    take(state)

    drives.release(order)

    assert not drives.sent
    assert take(state)[0].drives == {str(ROBOT): None}


def test_a_relocation_is_not_a_drive_of_the_order_that_waits_for_it() -> None:
    state = make_state()
    drives = state.drives
    order = assigned_order("A")
    drives.assign(order, ROBOT)
    requested = Drive.to_current_destination(order, ROBOT)
    drives.put(requested)
    relocation = Drive.making_room(ROBOT, make_vda_order("e", "A", "B"), ())
    drives.put(relocation)
    assert (drives.unsent_of_order(ROBOT), drives.granted) == (requested, {ROBOT: relocation})

    relocation = relocation.changed(state=DriveState.SENT)
    drives.put(relocation)
    assert (drives.of_order(order), drives.sent) == (None, {ROBOT: relocation})
    assert take(state)[0].drives == {str(ROBOT): DriveRow(None, relocation.document)}
    drives.release(order)
    assert drives.with_id(ROBOT, "e") == relocation
    drives.end(relocation)
    assert take(state)[0].drives == {str(ROBOT): None}


class Ear:
    def __init__(self) -> None:
        self.heard: list[tuple[str, int]] = []

    def order_changed(self, status: TransportOrderStatus) -> None:
        raise AssertionError(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        self.heard.append((status.name, status.version))


def made(number: int, key: str | None = None) -> OrderSequence:
    asked = OrderSequenceRequest(idempotency_key=key)
    return OrderSequence.created(asked, number=number, name=f"S-{number}", now=NOW)


def test_nothing_is_visible_or_published_before_the_commit() -> None:
    store, state, ear = MemoryStore(), make_state(), Ear()
    work = UnitOfWork(state, store, lambda _: None, lambda _: None, timeout=10.0)
    work.listeners.append(ear)
    book = state.sequences
    store.held = True
    first = made(book.next_number(), "k")
    with work.begin():
        book.put(first)
        book.put(first)
    assert (book.named("S-1"), book.keyed("k"), book.visible("S-1")) == (first, first, None)
    store.release()
    assert (book.visible("S-1"), ear.heard) == (first, [("S-1", 1)])
    assert tuple(book.unfinished()) == (first,)

    with work.begin():
        bound = first.bound("V-1", NOW)
        book.put(bound)
    assert book.of_vehicle("V-1") is bound
    with work.begin():
        book.put(bound.completed("by a host", NOW))
    assert ear.heard == [("S-1", 1), ("S-1", 2), ("S-1", 3)]
    assert (book.named("S-1"), book.keyed("k"), book.visible("S-1")) == (None, None, None)
    assert book.of_vehicle("V-1") is None
    assert (book.next_number(), store.found.sequences) == (2, ())


def test_stored_sequences_are_loaded() -> None:
    book = make_state().sequences
    one = made(4).appended("T-1", NOW).bound("V-2", NOW)
    book.load([one], 7)
    assert (book.of_vehicle("V-2"), book.visible("S-4"), book.next_number()) == (one, one, 8)
    assert book.named(None) is None
    assert book.keyed(None) is None


HELD = (ResourceSet("B", 1200, {"A --- B": None, "B": None, "aisle": "north"}),)


def test_each_change_is_recorded_once_and_restored() -> None:
    state = make_state(Vehicle(name="called V1", properties={"vda5050:serialNumber": "V1"}))
    book = state.vehicles
    book.change(key("V1"), held=HELD, integration_level=IntegrationLevel.TO_BE_RESPECTED)
    changes, _ = take(state)
    book.change(key("V1"), held=HELD)
    again, _ = take(state)

    assert list(changes.vehicles) == ["NeNa/V1"]
    assert not again
    read = make_state().vehicles
    read.load({robot: document() for robot, document in changes.vehicles.items()})
    assert read.of(key("V1")) == book.of(key("V1"))
    assert read.of(key("V1")).held == HELD
    assert [record.robot for record in read] == [key("V1")]
    assert read.name_before(key("V1")) == "called V1"
    assert read.robot_before("called V1") == key("V1")
    assert read.robot_before("V1") is None


def test_an_unreadable_document_is_skipped() -> None:
    book = make_state().vehicles

    book.load({"NeNa/V1": "{}"})

    assert list(book) == []
    assert book.of(key("V1")).integration_level is IntegrationLevel.TO_BE_UTILIZED
