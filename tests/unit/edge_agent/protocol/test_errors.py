"""Active errors (section 6.6.5)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.errors import LIMIT, ActiveErrors, Until
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error


def refusal(order_id: str, text: str = "no") -> ErrorEntry:
    return error(ErrorType.OTHER_ORDER_ACTIVE, text, order_id=order_id)


def lost(text: str = "lost") -> ErrorEntry:
    return error(ErrorType.LOCALIZATION_ERROR, text)


@pytest.mark.clause("6.6.5")
def test_there_is_one_entry_per_type_and_references() -> None:
    errors = ActiveErrors()
    errors.report(refusal("o1"), Until.ORDER_ACCEPTED)
    errors.report(refusal("o2"), Until.ORDER_ACCEPTED)
    errors.report(refusal("o1", "still no"), Until.ORDER_ACCEPTED)

    assert [each.error_description for each in errors.entries] == ["no", "still no"]


def test_a_repeated_error_is_no_change() -> None:
    errors = ActiveErrors()
    errors.report(refusal("o1"), Until.ORDER_ACCEPTED)
    revision = errors.revision

    errors.report(refusal("o1"), Until.ORDER_ACCEPTED)

    assert errors.revision == revision


@pytest.mark.clause("6.6.5")
def test_an_error_ends_with_its_own_cause_only() -> None:
    errors = ActiveErrors()
    errors.report(refusal("o1"), Until.ORDER_ACCEPTED)
    errors.report(lost(), Until.CONDITION_OVER)

    errors.end(Until.INSTANT_ACTION_ACCEPTED)
    assert len(errors.entries) == 2
    errors.end(Until.ORDER_ACCEPTED, Until.ORDER_OVER)
    assert list(errors.entries) == [lost()]


@pytest.mark.clause("6.6.5")
def test_a_condition_is_reported_once_and_ends_with_its_cause() -> None:
    errors = ActiveErrors()
    errors.set_condition(ErrorType.LOCALIZATION_ERROR, lost("a"))
    errors.set_condition(ErrorType.LOCALIZATION_ERROR, lost("b"))
    assert list(errors.entries) == [lost("b")]

    errors.set_condition(ErrorType.LOCALIZATION_ERROR, None)
    assert list(errors.entries) == []


def test_a_condition_with_other_references_replaces_the_old_one() -> None:
    errors = ActiveErrors()
    for order_id in ("o1", "o2"):
        entry = error(ErrorType.NAVIGATION_NOT_AVAILABLE, "gone", order_id=order_id)
        errors.set_condition(ErrorType.NAVIGATION_NOT_AVAILABLE, entry)

    assert list(errors.entries) == [entry]


@pytest.mark.clause("6.6.5")
def test_the_number_of_errors_is_bounded_and_the_oldest_is_dropped() -> None:
    errors = ActiveErrors()
    for number in range(LIMIT + 1):
        errors.report(refusal(f"o{number}"), Until.ORDER_ACCEPTED)

    assert len(errors.entries) == LIMIT
    assert errors.entries[0] == refusal("o1")


@pytest.mark.clause("6.6.5")
def test_a_message_resent_with_another_header_id_is_the_same_error() -> None:
    errors = ActiveErrors()
    for number in (1, 2):
        entry = error(ErrorType.OTHER_ORDER_ACTIVE, "no", header_id=number, order_id="o1")
        errors.report(entry, Until.ORDER_ACCEPTED)

    assert errors.entries == (entry,)


@pytest.mark.clause("6.6.5")
def test_refusals_do_not_displace_the_reason_for_a_stop() -> None:
    errors = ActiveErrors()
    stands = error(ErrorType.NODE_UNREACHABLE, "blocked", node_id="n1")
    errors.report(stands, Until.ORDER_OVER)
    for number in range(LIMIT + 1):
        errors.report(refusal(f"o{number}"), Until.ORDER_ACCEPTED)

    assert len(errors.entries) == LIMIT
    assert stands in errors.entries
