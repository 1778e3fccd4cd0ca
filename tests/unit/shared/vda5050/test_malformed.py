from __future__ import annotations

import json

import pytest
from pydantic import BaseModel, ValidationError

from nena_shared.vda5050.malformed import (
    REFERENCE_LENGTH,
    MalformedMessageError,
    problems_of,
)


class Node(BaseModel):
    sequence: int


class Way(BaseModel):
    nodes: list[Node]


def test_readable_fields_identify_the_message() -> None:
    payload = json.dumps({"headerId": 7, "orderId": "o1", "orderUpdateId": 0, "nodes": 3}).encode()

    error = MalformedMessageError("order", ["nodes: no list"], payload)

    assert error.references == {"headerId": "7", "orderId": "o1", "orderUpdateId": "0"}
    assert str(error) == "not a valid order: nodes: no list"


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"{",
        b"[1]",
        b'{"orderId": true, "headerId": null}',
        json.dumps({"orderId": "x" * (REFERENCE_LENGTH + 1)}).encode(),
    ],
)
def test_unreadable_or_empty_references_are_omitted(payload: bytes) -> None:
    assert MalformedMessageError("order", [], payload).references == {}


def test_findings_name_the_path_of_the_field() -> None:
    with pytest.raises(ValidationError) as caught:
        Way.model_validate({"nodes": [{"sequence": 1}, {"sequence": "x"}]})
    (problem,) = problems_of(caught.value)
    assert problem.startswith("nodes.1.sequence: ")


def test_error_about_the_whole_message_has_no_path() -> None:
    with pytest.raises(ValidationError) as caught:
        Way.model_validate(3)
    (problem,) = problems_of(caught.value)
    assert problem.startswith("message: ")
