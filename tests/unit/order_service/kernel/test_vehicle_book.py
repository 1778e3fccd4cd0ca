"""What is stored of vehicles comes back."""

from __future__ import annotations

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.traffic.resources import ResourceSet
from nena_shared.fleet_api.vehicle import IntegrationLevel
from support.scripted_fleet import key

HELD = (ResourceSet("B", 1200, {"A --- B": None, "B": None, "aisle": "north"}),)


def test_each_change_is_noted_once_and_read_again() -> None:
    orders = OrderBook()
    book = VehicleBook(orders, lambda robot: f"called {robot.serial_number}")
    book.change(key("V1"), held=HELD, integration_level=IntegrationLevel.TO_BE_RESPECTED)
    changes, _ = orders.take_changes()
    book.change(key("V1"), held=HELD)
    again, _ = orders.take_changes()

    assert list(changes.vehicles) == ["NeNa/V1"]
    assert not again
    read = VehicleBook(OrderBook(), str)
    read.load({robot: document() for robot, document in changes.vehicles.items()})
    assert read.of(key("V1")) == book.of(key("V1"))
    assert read.of(key("V1")).held == HELD
    assert [record.robot for record in read] == [key("V1")]
    assert read.name_before(key("V1")) == "called V1"
    assert read.robot_before("called V1") == key("V1")
    assert read.robot_before("V1") is None


def test_a_document_that_cannot_be_read_is_passed_over() -> None:
    book = VehicleBook(OrderBook(), str)

    book.load({"NeNa/V1": "{}"})

    assert list(book) == []
    assert book.of(key("V1")).integration_level is IntegrationLevel.TO_BE_UTILIZED
