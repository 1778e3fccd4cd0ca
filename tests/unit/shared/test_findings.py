from __future__ import annotations

import pytest
from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from nena_shared.findings import in_words


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid")

    weight: int

    @field_validator("weight")
    @classmethod
    def not_odd(cls, value: int) -> int:
        if value % 2:
            message = "is odd"
            raise ValueError(message)
        return value


class Form(BaseModel):
    parts: list[Part]


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({}, "parts: is missing"),
        ({"parts": [{"weight": 2}, {}]}, "parts.1.weight: is missing"),
        ({"parts": [{"weight": 2, "wait": 3}]}, "parts.0.wait: unknown field"),
        ({"parts": [{"weight": 3}]}, "parts.0.weight: is odd"),
        ([], "all of it: Input should be an object"),
    ],
)
def test_each_finding_is_a_line_with_the_place_and_plain_words(given: object, line: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Form.model_validate(given)

    assert in_words(refused.value.errors(), whole="all of it") == [line]


def test_root_is_omitted_once() -> None:
    finding = {"loc": ("body", "body"), "type": "missing", "msg": ""}

    assert in_words([finding, {**finding, "loc": ("body",)}], whole="all of it", root="body") == [
        "body: is missing",
        "all of it: is missing",
    ]


def test_received_text_is_shortened() -> None:
    finding = {"loc": ("x" * 1000,), "type": "value_error", "msg": f"Value error, {'y' * 1000} is no colour"}

    (line,) = in_words([finding], whole="all of it")

    assert line.startswith("xxx")
    assert len(line) < 700


def test_first_of_many_findings_are_listed() -> None:
    findings = [{"loc": ("parts", each), "type": "missing", "msg": ""} for each in range(5)]

    assert in_words(findings, whole="body", most=2) == [
        "parts.0: is missing",
        "parts.1: is missing",
        "body: 3 more invalid values",
    ]
    assert len(in_words(findings, whole="body", most=5)) == 5
