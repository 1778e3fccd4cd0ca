from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from nena_shared.fleet_api.transport_order import (
    Destination,
    FailureMeasure,
    FailureStep,
    TransportOrderRequest,
)
from support.order_service import request


@pytest.mark.parametrize(
    ("steps", "problem"),
    [
        ([{"do": "FAIL"}, {"do": "RETRY"}], "HOLD and FAIL must be last"),
        ([{"do": "HOLD"}, {"do": "FAIL"}], "HOLD and FAIL must be last"),
        ([{"do": "SKIP", "times": 2}], "is done once"),
        ([{"do": "HOLD", "after": 2}], "does not wait"),
        ([{"do": "RETRY", "times": 0}], "greater than or equal to 1"),
        ([{"do": "PRAY"}], "Input should be"),
        ([{"do": "RETRY"}] * 21, "at most 20"),
    ],
)
def test_contradictory_policy_is_refused(steps: list[dict[str, object]], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        request("A", onFailure=steps)


def test_a_policy_is_read_for_the_order_and_for_each_destination() -> None:
    body = {
        "destinations": [{"locationName": "A", "onFailure": [{"do": "SKIP"}]}],
        "onFailure": [{"do": "RETRY", "times": 2, "after": 5}, {"do": "HOLD"}],
        "timeout": 60,
    }
    made = TransportOrderRequest.model_validate(body)

    assert made.destinations[0].on_failure == (FailureStep(do=FailureMeasure.SKIP),)
    assert made.on_failure is not None
    assert (made.on_failure[0].times, made.on_failure[0].after, made.timeout) == (2, 5.0, 60.0)


@pytest.mark.parametrize(
    ("value", "text"), [("7", "7"), (7, "7"), (1.5, "1.5"), (True, "true"), (False, "false"), ("", "")]
)
def test_a_property_of_a_destination_is_a_text_a_number_or_a_truth_value(value: object, text: str) -> None:
    content = {"locationName": "Storage", "operation": "Load", "properties": [{"key": "k", "value": value}]}
    read = Destination.model_validate_json(json.dumps(content))
    (only,) = read.properties
    assert (only.value, type(only.value), only.text) == (value, type(value), text)
    assert json.loads(read.model_dump_json(by_alias=True))["properties"] == content["properties"]


@pytest.mark.parametrize("value", [None, [1], {"a": 1}, "x" * 2001])
def test_nothing_else_is_a_property_of_a_destination(value: object) -> None:
    content = {"locationName": "Storage", "properties": [{"key": "k", "value": value}]}
    with pytest.raises(ValidationError, match="value"):
        Destination.model_validate(content)
