"""Which errors of a robot are meant for the order that it was sent, where 2.x lets it name nothing."""

from __future__ import annotations

import pytest

from nena_order_service.fleet import failures
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType
from support.fleet import make_mission

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
def test_what_is_about_another_topic_order_or_update_refuses_no_update(
    references: dict[str, str], *, meant: bool
) -> None:
    found = failures.refuses_update(refusal(**references), ORDER_ID, UPDATE_ID)

    assert found is meant


def test_what_is_about_another_topic_refuses_no_order() -> None:
    mission = make_mission(ORDER_ID)
    meant, foreign = refusal(topic="order"), refusal(topic="instantActions")

    assert failures.refusals((meant, foreign), mission, frozenset()) == (meant,)


def test_a_reason_and_what_the_robot_says_of_it_are_one_sentence() -> None:
    assert failures.with_details("it has failed", ()) == "it has failed"
    assert (
        failures.with_details("it has failed", ("cancelled", "jammed")) == "it has failed: cancelled; jammed"
    )
