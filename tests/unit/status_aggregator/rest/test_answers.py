from __future__ import annotations

import json

import pytest

from nena_status_aggregator.rest.answers import as_json, found
from nena_status_aggregator.rest.problem import ProblemError


def test_what_is_there_is_given_also_when_it_is_empty() -> None:
    assert found([], "nothing") == []
    assert found(0, "nothing") == 0


def test_what_is_not_there_is_a_problem_with_what_to_do() -> None:
    with pytest.raises(ProblemError, match="Start one") as caught:
        found(None, "Start one.")
    assert caught.value.status == 404


def test_views_are_written_as_they_are() -> None:
    answer = as_json({"stateAge": None, "robots": ("ä",)})
    assert answer.headers["content-type"] == "application/json"
    assert json.loads(bytes(answer.body)) == {"stateAge": None, "robots": ["ä"]}
