from __future__ import annotations

import pytest
from pydantic import BaseModel, ValidationError

from nena_shared.vda5050.malformed import problems_of, received_in


class Node(BaseModel):
    sequence: int


class Way(BaseModel):
    nodes: list[Node]


def test_findings_name_the_path_of_the_field() -> None:
    with pytest.raises(ValidationError) as caught:
        Way.model_validate({"nodes": [{"sequence": 1}, {"sequence": "x"}]})
    (problem,) = problems_of(caught.value)
    assert problem.startswith("nodes.1.sequence: ")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_another_encoding_is_named(encoding: str) -> None:
    payload = '{"nodeId": "n"}'.encode(encoding)
    with pytest.raises(ValidationError) as caught:
        Node.model_validate_json(payload)
    assert received_in(caught.value, payload) == "text in UTF-16 or UTF-32; JSON is sent in UTF-8"


def test_what_is_no_json_is_quoted_around_the_place() -> None:
    payload = b'{"sequence": 1,\n "text": "' + b"x" * 100 + b' f\xfcr Scanner"}'
    with pytest.raises(ValidationError) as caught:
        Node.model_validate_json(payload)
    assert "f\\xfcr" in received_in(caught.value, payload)


def test_error_about_the_whole_message_has_no_path() -> None:
    with pytest.raises(ValidationError) as caught:
        Way.model_validate(3)
    (problem,) = problems_of(caught.value)
    assert problem.startswith("message: ")
