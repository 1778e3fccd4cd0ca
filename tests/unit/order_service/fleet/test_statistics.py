from __future__ import annotations

from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.outputs import (
    PublishInstantActions,
    PublishOrder,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.statistics import ACTIONS_REMEMBERED, FleetStatistics
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.topics import RobotKey, Topic
from support.fleet import make_action

ROBOT = RobotKey("ACME", "r1")


def order(name: str, update_id: int = 0) -> PublishOrder:
    return PublishOrder(ROBOT, VdaOrder(order_id=name, nodes=(), edges=()), update_id)


def actions(*ids: str) -> PublishInstantActions:
    return PublishInstantActions(ROBOT, tuple(make_action("x", each) for each in ids))


def test_durations_of_a_vda_orders_steps_are_measured() -> None:
    statistics = FleetStatistics()
    statistics.begun("o", 10.0)
    assert statistics.undelivered == 1
    statistics.published(Topic.ORDER, order("o"), 12.0)
    statistics.published(Topic.ORDER, order("o"), 13.0)
    statistics.happened(VdaOrderAccepted(ROBOT, "o"), 15.0)
    assert statistics.undelivered == 0
    statistics.published(Topic.ORDER, order("o", 1), 16.0)
    statistics.happened(VdaOrderFinished(ROBOT, "o"), 35.0)

    assert statistics.sending.total == 2.0
    assert statistics.acknowledgement.total == 3.0
    assert statistics.execution.total == 20.0
    assert statistics.sent[Topic.ORDER] == 3
    assert statistics.resent[Topic.ORDER] == 1
    assert statistics.ended == {"finished": 1, "cancelled": 0, "failed": 0}


def test_each_end_is_counted_and_its_data_dropped() -> None:
    statistics = FleetStatistics()
    for name in ("a", "b"):
        statistics.begun(name, 0.0)
    statistics.happened(VdaOrderCancelled(ROBOT, "a"), 1.0)
    statistics.happened(
        VdaOrderFailed(ROBOT, "b", Reason.of("it was refused"), kind=FailureKind.REFUSED), 1.0
    )

    assert statistics.ended == {"finished": 0, "cancelled": 1, "failed": 1}
    assert statistics.failures[FailureKind.REFUSED] == 1
    assert statistics.undelivered == 0


def test_an_order_from_before_the_restart_is_not_counted_as_acknowledged() -> None:
    statistics = FleetStatistics()
    statistics.begun("o", 0.0)
    statistics.happened(VdaOrderAccepted(ROBOT, "o"), 1.0)
    statistics.published(Topic.ORDER, order("o", 3), 2.0)

    assert sum(statistics.acknowledgement.counts) == sum(statistics.sending.counts) == 0


def test_resent_instant_actions_are_recognised_within_a_limit() -> None:
    statistics = FleetStatistics()
    statistics.published(Topic.INSTANT_ACTIONS, actions("a"), 0.0)
    statistics.published(Topic.INSTANT_ACTIONS, actions("a", "b"), 1.0)
    assert statistics.resent[Topic.INSTANT_ACTIONS] == 1
    for number in range(ACTIONS_REMEMBERED):
        statistics.published(Topic.INSTANT_ACTIONS, actions(f"n{number}"), 2.0)
    statistics.published(Topic.INSTANT_ACTIONS, actions("a"), 3.0)
    assert statistics.resent[Topic.INSTANT_ACTIONS] == 1
