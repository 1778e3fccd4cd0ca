from __future__ import annotations

import pytest

from nena_simulate.observation import Doing, Observed, Words
from nena_simulate.report import Figures


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        (
            "robot r-1 travels to destination 1 of 2, but it waits for r-12, which passes 'P1' first",
            "waits for another, which passes a place first",
        ),
        ("waits for r-1, r-2 and r-12, which stand on 'P1'", "waits for others, which stand on a place"),
        ("it would have to turn back 12.5 m", "it would have to turn back n m"),
        ("robot r-2 travels to destination 2 of 2", "between two parts of its base"),
    ],
)
def test_reasons_that_differ_only_in_names_are_one_cause(reason: str, cause: str) -> None:
    assert Words(["r-1", "r-2", "r-12"]).without_names(reason) == cause


def part(*leads: float, waiting: int, idle: float) -> Observed:
    found = Observed(0.05, created=len(leads), waiting=waiting, leads=list(leads), empty=10.0, loaded=30.0)
    found.finishes = [60.0 * number for number, _ in enumerate(leads)]
    found.seconds[Doing.IDLE], found.seconds[Doing.WAITS] = idle, 100.0
    found.places["P1"] = 100.0
    return found


def test_parts_are_reported_as_if_one_had_followed_the_other() -> None:
    one, other = part(10.0, 20.0, waiting=3, idle=100.0), part(60.0, waiting=4, idle=200.0)

    found = Figures.of([one, other], plant="hall", robots=2)

    assert (found.hours, found.created, found.finished, found.waiting) == (0.1, 3, 3, 3.5)
    assert found.finished_by_minute == (1, 1, 0, 1, 0, 0)
    assert (found.orders_per_hour, found.lead_p50) == (30.0, 20.0)
    assert found.doing[Doing.IDLE] == 0.6
    assert found.waiting_by_place == {"P1": 33.33}
    assert (found.driven_km, found.empty_share) == (0.08, 0.25)
    assert one.leads == [10.0, 20.0], "parts stay as they were"
