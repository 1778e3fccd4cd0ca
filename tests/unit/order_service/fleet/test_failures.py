"""A robot that waits with a failed action, and what the errors of a state mean."""

from __future__ import annotations

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet import failures
from nena_order_service.fleet.instant_actions import retry_or_skip
from nena_order_service.fleet.outputs import ActionRetriable, VdaOrderFinished
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType
from support.fleet import Bench, make_vda_order


@pytest.mark.clause("6.2.3/retryAsked")
def test_a_retriable_action_is_reported_at_each_failure() -> None:
    robot = HonestRobot(reports_instants_apart=True, version="3.0.0")
    bench = Bench(robot=robot).online()
    bench.start_and_tell(make_vda_order("m", "A", operation="pick"))
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
