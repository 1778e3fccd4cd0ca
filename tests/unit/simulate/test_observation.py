from __future__ import annotations

import pytest

from nena_simulate.observation import Words


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        (
            "vehicle r-1 travels to destination 1 of 2, but it waits for r-12, which passes 'P1' first",
            "waits for another, which passes a place first",
        ),
        ("waits for r-1, r-2 and r-12, which stand on 'P1'", "waits for others, which stand on a place"),
        ("it would have to turn back 12.5 m", "it would have to turn back n m"),
        ("vehicle r-2 travels to destination 2 of 2", "between two parts of its base"),
    ],
)
def test_reasons_that_differ_only_in_names_are_one_cause(reason: str, cause: str) -> None:
    assert Words(["r-1", "r-2", "r-12"]).without_names(reason) == cause
