"""Failures of VDA orders, and what is known after them; a robot that waits with a failed action."""

from __future__ import annotations

import pytest

from nena_order_service.fleet import failures
from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.instant_actions import retry_or_skip
from nena_order_service.fleet.outputs import ActionRetriable, VdaOrderFailed, VdaOrderFinished
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType
from nena_shared.vda5050.state import OperatingMode
from support.fleet import Bench, make_vda_order
from support.honest_robot import HonestRobot


def kind(bench: Bench) -> FailureKind:
    (only,) = bench.told(VdaOrderFailed)
    return only.kind


def under_way(robot: HonestRobot | None = None, *points: str) -> Bench:
    bench = Bench(robot=robot).online()
    bench.start(make_vda_order("m", *(points or ("A", "B", "C")), operation="pick"))
    bench.deliver()
    bench.report()
    return bench


def test_an_unreachable_node_is_a_drive_failure() -> None:
    bench = under_way(HonestRobot(unreachable={"C"}))
    bench.run()
    assert kind(bench) is FailureKind.DRIVE


def test_an_order_abandoned_manually_is_a_drive_failure() -> None:
    bench = under_way()
    bench.robot.set_mode(OperatingMode.MANUAL)
    bench.report()
    assert kind(bench) is FailureKind.DRIVE


def test_an_impossible_final_action_is_an_action_failure() -> None:
    bench = under_way(HonestRobot(actions_fail=True))
    bench.run()
    assert kind(bench) is FailureKind.ACTION


def test_a_robot_without_the_order_has_lost_it() -> None:
    bench = under_way()
    bench.robot.restart(journal=False)
    bench.now += 1
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    assert kind(bench) is FailureKind.LOST


def test_a_robot_that_never_accepts_the_order() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.wait(120, reporting=True)
    assert kind(bench) is FailureKind.NOT_TAKEN


def test_a_robot_that_refuses_it() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "X", "B", x=50.0))
    assert kind(bench) is FailureKind.REFUSED


def test_an_unconfirmed_cancel_ends_as_unclear() -> None:
    bench = under_way()
    bench.cancel()
    bench.wait(400, reporting=True)
    assert kind(bench) is FailureKind.UNCLEAR


@pytest.mark.clause("6.2.3/retryAsked")
def test_a_retriable_action_is_reported_at_each_failure() -> None:
    bench = under_way(HonestRobot(reports_instants_apart=True, version="3.0.0"), "A")
    robot = bench.robot
    robot.step()
    robot.statuses["m/pick"] = ActionStatus.RETRIABLE
    bench.report()
    bench.report()
    (told,) = bench.told(ActionRetriable)
    assert (told.order_id, told.action_id, str(told.reason)) == (
        "m",
        "m/pick",
        "the action 'pick' has failed",
    )

    retry = retry_or_skip("r", "m/pick", retry=True)
    bench.instruct(retry)
    bench.deliver()
    robot.instants["r"] = (retry, ActionStatus.FINISHED)  # and at once it has failed again
    bench.report()
    bench.report()
    assert len(bench.told(ActionRetriable)) == 2

    robot.statuses["m/pick"] = ActionStatus.FINISHED
    bench.report()
    assert bench.told(VdaOrderFinished)


ORDER_ID, UPDATE_ID = "T-1-0", 2


def refusal(**references: str) -> ErrorEntry:
    return ErrorEntry(
        error_type=ErrorType.VALIDATION_FAILURE,
        error_level=ErrorLevel.WARNING,
        error_references=tuple(
            ErrorReference(reference_key=key, reference_value=value) for key, value in references.items()
        ),
    )


@pytest.mark.parametrize(
    ("references", "meant"),
    [
        ({}, True),
        ({"topic": "order"}, True),
        ({"topic": "instantActions"}, False),
        ({"topic": "order", "orderId": ORDER_ID}, True),
        ({"topic": "order", "orderId": "T-9-0"}, False),
        ({"orderId": ORDER_ID, "orderUpdateId": "1"}, False),
    ],
)
def test_errors_about_another_topic_order_or_update_do_not_refuse_an_update(
    references: dict[str, str], *, meant: bool
) -> None:
    found = failures.refuses_update(refusal(**references), ORDER_ID, UPDATE_ID)

    assert found is meant


def test_errors_about_another_topic_do_not_refuse_an_order() -> None:
    vda_order = make_vda_order(ORDER_ID)
    meant, foreign = refusal(topic="order"), refusal(topic="instantActions")

    assert failures.refusals((meant, foreign), vda_order, frozenset()) == (meant,)


def test_a_reason_and_the_robots_details_form_one_sentence() -> None:
    assert str(failures.with_details(Reason.of("it has failed"), ())) == "it has failed"
    assert (
        str(failures.with_details(Reason.of("it has failed"), ("cancelled", "jammed")))
        == "it has failed: cancelled; jammed"
    )
