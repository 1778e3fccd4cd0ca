from __future__ import annotations

from nena_shared.fleet_api.failure_policy import Hold
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_status_aggregator.fleet_model.order_book import TrackedOrder
from nena_status_aggregator.fleet_model.order_view import place, view_order
from support.fleet_examples import START, order_status


def test_a_coordinate_is_named_by_its_metres() -> None:
    assert place(Destination(coordinate=Coordinate(x=1.0, y=-2.345))) == "(1.00, -2.35)"


def test_an_order_as_hosts_know_it() -> None:
    view = view_order(TrackedOrder(order_status(version=3)), "C")
    assert (view["id"], view["name"], view["version"]) == ("TO-1", "TO-1", 3)
    assert (view["state"], view["final"], view["confirmed"]) == ("BEING_PROCESSED", False, True)
    assert view["created"] == "2026-01-01T00:00:00.000Z"
    assert (view["finished"], view["deadline"]) == (None, None)
    assert [each["place"] for each in view["destinations"]] == ["Goods in", "Packing"]


def test_who_holds_an_order() -> None:
    hold = Hold(by="Ann", reason="tea", since=START)
    view = view_order(TrackedOrder(order_status(held=hold)), None)
    assert view["held"] == {"by": "Ann", "reason": "tea", "since": "2026-01-01T00:00:00.000Z"}
    assert view_order(TrackedOrder(order_status()), None)["held"] is None
