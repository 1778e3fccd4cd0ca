from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_plant_formats.exchange import JsonLimits, check_size, parse_json
from nena_shared.plant.errors import PlantModelError

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=10,
)


def code_of(error: pytest.ExceptionInfo[PlantModelError]) -> str:
    (problem,) = error.value.problems
    return problem.code


@given(VALUES)
def test_json_is_read(value: object) -> None:
    assert parse_json(json.dumps(value).encode()) == value


@pytest.mark.parametrize("text", [b"", b"{", b"[1,]", b"\xff", b'{"a": NaN}', b"[Infinity]"])
def test_invalid_json_is_refused(text: bytes) -> None:
    with pytest.raises(PlantModelError) as error:
        parse_json(text)
    assert code_of(error) == "MALFORMED_JSON"


@pytest.mark.parametrize(
    ("text", "limits"),
    [
        (b"[" * 5000 + b"]" * 5000, JsonLimits()),
        (b'"' + b"x" * 99 + b'"', JsonLimits(size_bytes=100)),
        (b"[1,2,3,4]", JsonLimits(values=3)),
    ],
    ids=["too deep", "too long", "too many"],
)
def test_json_beyond_the_limits_is_refused(text: bytes, limits: JsonLimits) -> None:
    with pytest.raises(PlantModelError) as error:
        parse_json(text, limits)
    assert code_of(error) == "LIMIT_EXCEEDED"


def test_text_just_within_the_limits_is_accepted() -> None:
    check_size(b'"' + b"x" * 98 + b'"', JsonLimits(size_bytes=100))
    check_size(b"[1,2,3,4]", JsonLimits(values=4))
