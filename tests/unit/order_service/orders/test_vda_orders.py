"""What is stored of a VDA order, and how much of it a robot has."""

from __future__ import annotations

from nena_order_service.orders.vda_orders import SentOrder
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.traffic.traffic_control import Journey
from support.fleet import make_vda_order
from support.scripted_fleet import key

WAY = tuple(ResourceSet(name, 1000, {name: None}) for name in "BCDE")
RECORD = SentOrder.of(key("V1"), make_vda_order("m", *"ABCDE"), 0, WAY)


def base(record: SentOrder) -> list[str]:
    return [node.node_id for node in record.as_released().nodes if node.released]


def test_it_comes_back_as_it_was() -> None:
    record = RECORD.released(Journey(WAY, 2)).updated(cancelled=True)

    assert SentOrder.model_validate_json(record.document()) == record
    assert (record.update_id, record.allocated, record.robot) == (1, 2, key("V1"))


def test_the_base_is_what_is_allocated() -> None:
    assert base(RECORD.released(Journey(WAY, 0))) == ["A"]
    assert base(RECORD.released(Journey(WAY, 2))) == ["A", "B", "C"]
    assert base(RECORD.released(Journey(WAY, 4))) == ["A", "B", "C", "D", "E"]
    assert RECORD.released(Journey(WAY, 4)).all_released


def test_one_that_ends_early_has_no_horizon() -> None:
    record = RECORD.released(Journey(WAY, 2)).ending_early(partial=True)

    assert [node.node_id for node in record.vda_order.nodes] == ["A", "B", "C"]
    assert len(record.vda_order.edges) == len(record.way) == 2
    assert (record.partial, record.all_released, record.update_id) == (True, True, 1)


def test_one_that_is_all_base_stays_as_it_is() -> None:
    record = RECORD.released(Journey(WAY, 4))

    assert record.ending_early(partial=True) is record
