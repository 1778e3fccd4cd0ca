from __future__ import annotations

import re

import pytest

from nena_shared.vda5050.error import ErrorLevel, ErrorReference, ErrorType, error
from support.reference import reference_dir


@pytest.mark.clause("6.6.5.4", "6.6.5.1")
@pytest.mark.parametrize(
    ("kind", "level"),
    [
        (ErrorType.VALIDATION_FAILURE, ErrorLevel.WARNING),
        (ErrorType.UNSUPPORTED_PARAMETER, ErrorLevel.CRITICAL),
        (ErrorType.INSUFFICIENT_MEMORY, ErrorLevel.URGENT),
        (ErrorType.NODE_UNREACHABLE, ErrorLevel.CRITICAL),
        (ErrorType.LOCALIZATION_ERROR, ErrorLevel.FATAL),
        (ErrorType.NO_ORDER_TO_CANCEL, ErrorLevel.WARNING),
        (ErrorType.OUTSIDE_OF_CORRIDOR, ErrorLevel.CRITICAL),
    ],
)
def test_level_is_that_of_the_standards_table(kind: ErrorType, level: ErrorLevel) -> None:
    assert error(kind, "why").error_level is level


@pytest.mark.clause("6.6.5.2")
def test_references_are_camel_case_texts_without_none() -> None:
    entry = error(ErrorType.VALIDATION_FAILURE, "why", order_update_id=3, order_id=None, topic="order")

    assert entry.error_references == (
        ErrorReference(reference_key="orderUpdateId", reference_value="3"),
        ErrorReference(reference_key="topic", reference_value="order"),
    )


@pytest.mark.clause("6.6.5.4")
def test_all_error_types_of_3_0_1_are_known() -> None:
    text = reference_dir("vda5050-3.0.1.md").read_text(encoding="utf-8")
    section = text.split("errorType, complete list of the draft")[1].split("It stays extensible")[0]
    listed = set(re.findall(r"[A-Z]+(?:_[A-Z]+)+", section))

    assert len(listed) == 25
    assert listed <= {each.value for each in ErrorType}
