"""Which robot works for which order, and has which mission."""

from __future__ import annotations

from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.orders.vda_orders import MissionRecord
from support.fleet import make_mission
from support.order_service import assigned_order
from support.scripted_fleet import key

ROBOT = key("V-1")


def make() -> tuple[OrderBook, VehicleBook, MissionBook]:
    orders = OrderBook()
    vehicles = VehicleBook(orders, str)
    return orders, vehicles, MissionBook(orders, vehicles)


def test_a_robot_works_for_its_order_before_between_and_after_missions() -> None:
    orders, _, book = make()
    order = assigned_order("A", "B")
    record = MissionRecord.of(ROBOT, make_mission("m", "A", "B"), 0)
    book.assign(order, ROBOT)
    assert (book.order_number(ROBOT), book.of_order(order)) == (1, None)

    book.put(record)
    assert (book.find("m"), book.of_order(order), book.of_robot(ROBOT)) == (record, record, record)
    assert orders.take_changes()[0].missions == {1: record.document}

    book.end(record)
    assert (book.find("m"), book.order_number(ROBOT)) == (None, 1)
    assert orders.take_changes()[0].missions == {1: None}

    assert book.release(order) == ROBOT
    assert book.order_number(ROBOT) is None
    assert book.release(order) is None


def test_an_order_that_ends_takes_its_mission_with_it() -> None:
    orders, _, book = make()
    order = assigned_order("A")
    book.assign(order, ROBOT)
    book.put(MissionRecord.of(ROBOT, make_mission("m", "A", "B"), 0))
    orders.take_changes()

    book.release(order)

    assert list(book) == []
    assert orders.take_changes()[0].missions == {1: None}


def test_making_room_is_no_mission_of_the_order() -> None:
    orders, vehicles, book = make()
    order = assigned_order("A")
    evasion = MissionRecord.of(ROBOT, make_mission("e", "A", "B"), None)
    book.assign(order, ROBOT)
    book.put(evasion)

    assert (book.of_order(order), book.of_robot(ROBOT)) == (None, evasion)
    assert vehicles.of(ROBOT).evasion == evasion
    book.release(order)
    assert book.find("e") == evasion
    book.end(evasion)
    assert vehicles.of(ROBOT).evasion is None
    assert orders.take_changes()[0].missions == {}
