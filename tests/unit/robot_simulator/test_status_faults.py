from __future__ import annotations

from uuid import UUID

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.faults import Faults, Lasting
from nena_robot_simulator.status_array import GoalEntry, GoalStatus
from nena_robot_simulator.status_faults import disturbed

RUNS = (GoalEntry(UUID(int=1), 1, GoalStatus.EXECUTING),)
OVER = (GoalEntry(UUID(int=1), 1, GoalStatus.SUCCEEDED),)


def with_fault(fault: Lasting) -> Faults:
    active = Faults()
    active.apply(fault)
    return active


def test_without_a_fault_each_array_comes_once() -> None:
    assert disturbed(OVER, RUNS, Faults()) == (OVER,)


@pytest.mark.parametrize(
    ("fault", "shown"),
    [
        (faults.DuplicateStatus(), (OVER, OVER)),
        (faults.ReorderedStatus(), (OVER, RUNS, OVER)),
        (faults.TerminalFirst(), (OVER,)),
    ],
)
def test_a_fault_disturbs_what_comes(fault: Lasting, shown: tuple[object, ...]) -> None:
    assert disturbed(OVER, RUNS, with_fault(fault)) == shown


def test_what_runs_is_not_seen_before_its_end() -> None:
    assert disturbed(RUNS, (), with_fault(faults.TerminalFirst())) == ()
