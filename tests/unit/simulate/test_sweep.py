"""Many cases at once: what runs of them say together, and what is told of runs that are lost."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from typing import Any

import pytest

from bench.halls import SPEED_MM_S, two_halls
from nena_simulate.demand import Demand
from nena_simulate.observation import Observed
from nena_simulate.report import Report
from nena_simulate.site import Case
from nena_simulate.sweep import ClusterError, ProcessLostError, executor_for, simulate_all
from nena_simulate.virtual_time import SimulationFailedError
from support.broker import free_port

HALL = two_halls()
CASE = Case(
    plant=HALL.with_robots(2),
    demand=Demand(backlog=4),
    robots=2,
    hours=1.0,
    speed=SPEED_MM_S / 1000,
    work_seconds=2.0,
)


class Scripted(Executor):
    """Answers each case at once, as a function says."""

    def __init__(self, answer: Callable[[Case], Observed | Exception]) -> None:
        self._answer = answer

    def submit(self, _fn: object, /, case: Case, **_: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        try:
            future.set_result(self._answer(case))
        except ProcessLostError as error:
            future.set_exception(error)
        return future


def orders(count: int) -> Observed:
    leads = [60.0] * count
    return Observed(1.0, created=count, leads=leads, finishes=[30.0 * number for number in range(count)])


def test_several_seeds_give_a_mean_and_its_confidence_interval() -> None:
    (found,), missing = simulate_all(
        [CASE], Scripted(lambda case: orders(90 + 10 * case.seed)), seeds=(1, 2, 3)
    )

    assert not missing
    assert (found.orders_per_hour, found.runs, found.hours) == (110.0, 3, 3.0)
    assert found.intervals["orders_per_hour"] == pytest.approx(4.30 * 10 / 3**0.5, abs=0.01)
    report = Report((found,), (1, 2, 3)).to_text()
    assert report.startswith("two halls, seeds 1 to 3\n")
    assert "110.0 ± 24.8" in report
    assert Report((found,), (1, 5, 9)).to_text().startswith("two halls, seeds 1, 5, 9\n")


def test_a_single_run_has_no_interval() -> None:
    (found,), _ = simulate_all([CASE], Scripted(lambda _: orders(100)), seeds=(7,))
    report = Report((found,), (7,)).to_text()

    assert found.intervals == {}
    assert "±" not in report
    assert report.startswith("two halls, seed 7")


def test_plants_are_compared_by_fleet_size() -> None:
    other = CASE.plant.model_copy(update={"name": "new"})
    cases = [replace(CASE, plant=plant, robots=size) for plant in (CASE.plant, other) for size in (2, 4)]
    figures, _ = simulate_all(
        cases, Scripted(lambda case: orders(case.robots * (3 if case.plant.name == "new" else 2)))
    )

    text = Report(tuple(figures), (1,)).to_text().splitlines()
    assert [line.split() for line in text[2:5]] == [
        ["plant", "2", "robots", "4", "robots"],
        ["two", "halls", "4.0", "8.0"],
        ["new", "6.0", "12.0"],
    ]


def test_lost_runs_are_named_and_the_others_reported() -> None:
    def answer(case: Case) -> Observed:
        if case.seed == 2 or case.robots == 4:
            raise ProcessLostError("out of memory")
        return orders(100)

    told: list[str] = []
    cases = [CASE, replace(CASE, robots=4)]
    figures, missing = simulate_all(cases, Scripted(answer), seeds=(1, 2), tell=told.append)

    assert [(each.robots, each.runs, each.orders_per_hour) for each in figures] == [(2, 1, 100.0)]
    assert len(missing) == 3
    assert "two halls, 2 robots, seed 2: no result: ProcessLostError: out of memory" in missing
    assert len(told) == 4
    report = Report(tuple(figures), (1, 2), missing=tuple(missing))
    assert missing[0] in report.to_text()
    assert missing[0] in report.to_json()


def test_a_failed_program_is_no_lost_run() -> None:
    with pytest.raises(SimulationFailedError, match="why"):
        simulate_all([CASE], Scripted(lambda _: SimulationFailedError("why")))


def test_an_interrupt_ends_with_the_runs_that_are_done() -> None:
    def interrupt(_: str) -> None:
        raise KeyboardInterrupt

    figures, missing = simulate_all([CASE], Scripted(lambda _: orders(9)), seeds=(1, 2, 3), tell=interrupt)

    assert figures[0].runs == 1
    assert missing == ["interrupted with 1 of 3 runs done"]


def test_nothing_is_started_for_robots_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        simulate_all(
            [CASE, replace(CASE, robots=len(HALL.plant.points))], Scripted(lambda _: pytest.fail("started"))
        )


@pytest.mark.simulation
@pytest.mark.long
def test_processes_give_equal_results() -> None:
    case = replace(CASE, hours=0.02)
    with executor_for(None, 2) as executor:
        (one, same, other), _ = simulate_all([case, case, replace(case, seed=2)], executor)
        (whole,), _ = simulate_all([replace(case, hours=0.04)], executor, parts=2)

    assert one == same
    assert one != other
    assert whole.finished == one.finished + other.finished


def test_an_address_without_a_scheduler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nena_simulate.sweep.CONNECT_SECONDS", 0.5)
    address = f"tcp://127.0.0.1:{free_port()}"

    with pytest.raises(ClusterError, match=f"no Dask scheduler at {address}"), executor_for(address, 1):
        pytest.fail("there is none")
