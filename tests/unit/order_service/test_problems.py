from __future__ import annotations

import inspect

import pytest

from nena_order_service import errors
from nena_order_service.api.problems import FORESEEN, STATUS, problem_of


def test_each_error_of_the_service_has_one_status() -> None:
    own = {
        each for _, each in inspect.getmembers(errors, inspect.isclass) if each.__module__ == errors.__name__
    }
    assert {each for each in own if issubclass(each, Exception)} == set(STATUS)
    assert set(STATUS) < set(FORESEEN)


def test_what_is_foreseen_says_what_to_do_in_its_own_words() -> None:
    error = errors.UnknownOrderError("T-9")

    found = problem_of(error)

    assert (found.status, found.detail) == (404, str(error))
    assert "T-9" in found.detail


@pytest.mark.parametrize("error", [KeyError("secret"), RuntimeError("secret"), ValueError("secret")])
def test_what_nobody_foresaw_gives_no_inside_view(error: Exception) -> None:
    found = problem_of(error)

    assert found.status == 500
    assert "secret" not in found.model_dump_json()
