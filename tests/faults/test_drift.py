from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from faults.drift import WARM_UP_ORDERS, Window, drift
from faults.footprint import Footprint
from faults.soak import Soaked, document

COUNT = 10


def run(
    *,
    megabytes: Callable[[int], float] = lambda _: 100.0,
    descriptors: Callable[[int], int] = lambda _: 20,
    threads: Callable[[int], int] = lambda _: 5,
    answer: Callable[[int], float] = lambda _: 0.01,
    order: Callable[[int], float] = lambda _: 8.0,
    yardstick: Callable[[int], float] = lambda _: 0.004,
) -> list[Window]:
    """Return the windows of a run, each by its number."""
    return [
        Window(
            answers=[answer(number)] * 20,
            orders=[order(number)] * 20,
            footprints={"order-service": Footprint(megabytes(number), descriptors(number), threads(number))},
            yardstick=[yardstick(number)] * 5,
        )
        for number in range(COUNT)
    ]


def test_a_steady_run_has_not_drifted() -> None:
    assert drift(run()) == []


def test_fluctuating_values_are_not_drift() -> None:
    assert (
        drift(
            run(
                megabytes=lambda number: 100 + 15 * (number % 2),
                answer=lambda number: 0.01 * (1 + number % 3),
            )
        )
        == []
    )


def test_a_busier_machine_is_not_drift_but_slower_programs_are() -> None:
    def busy(number: int) -> float:
        return 0.004 * (1 + number)

    assert drift(run(order=lambda number: 8.0 * (1 + number), yardstick=busy)) == []
    (finding,) = drift(run(order=lambda number: 8.0 * (1 + number) ** 2, yardstick=busy))
    assert "times as busy" in finding
    assert drift(run(megabytes=lambda number: 100 + 5 * number, yardstick=busy))
    assert drift(run(order=lambda _: 8.0, yardstick=lambda number: 0.004 * (10 - number))) == []


def test_the_first_window_is_warm_up() -> None:
    assert drift(run(megabytes=lambda number: 20 if number == 0 else 100.0)) == []


@pytest.mark.parametrize(
    ("found", "word"),
    [
        (run(megabytes=lambda number: 100 + 5 * number), "megabytes"),
        (run(descriptors=lambda number: 20 + 2 * number), "descriptors"),
        (run(threads=lambda number: 5 + number), "threads"),
        (run(answer=lambda number: 0.05 * (1 + number)), "answers"),
        (run(order=lambda number: 5.0 * (1 + number)), "orders"),
    ],
)
def test_steady_growth_is_reported(found: list[Window], word: str) -> None:
    (said,) = drift(found)

    assert word in said


def test_growth_while_the_order_cache_fills_does_not_count() -> None:
    def windows(orders: int) -> list[Window]:
        found = run(megabytes=lambda number: 100.0 + 10 * min(number, 5))
        return [replace(each, orders=[8.0] * orders) for each in found]

    assert drift(windows(10)) != [], "too few for all of them"
    assert drift(windows(WARM_UP_ORDERS // 5)) == []


def test_later_growth_is_reported() -> None:
    found = [
        replace(each, orders=[8.0] * WARM_UP_ORDERS)
        for each in run(megabytes=lambda number: 100 + 5 * number)
    ]
    assert len(drift(found)) == 1


def test_a_run_that_is_too_short_does_not_count() -> None:
    with pytest.raises(ValueError, match="at least 4 windows"):
        drift(run()[:3])


def report(windows: list[Window], fault: str = "") -> str:
    return document(Soaked(windows, 10, fault), minutes=10, load=2.0)


def test_the_report_has_a_line_per_window_and_names_drift() -> None:
    text = report(run(threads=lambda number: 5 + number))

    assert text.count("| 10 ms | 10 ms |") == COUNT
    assert "threads in the last third" in text
    assert "No drift" in report(run())


def test_the_report_contains_the_checkers_findings() -> None:
    text = report(run(), fault="{'T-7': 'the robot cannot continue the order'}")

    assert "**{'T-7': 'the robot cannot continue the order'}**" in text
    assert "None lost" not in text
