from __future__ import annotations

from uuid import UUID

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.faults import Faults, Lasting, disturbed, parse
from nena_robot_simulator.goals import GoalEntry
from nena_robot_simulator.motion import Pose
from nena_shared.ros import GoalStatus


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (
            '{"kind": "unreachable", "circles": [{"x": 1, "y": 2, "radius": 0.5}], "goals": 2}',
            faults.Unreachable,
        ),
        ('{"kind": "abort_halfway", "fraction": 0.25}', faults.AbortHalfway),
        ('{"kind": "reject_goals"}', faults.RejectGoals),
        ('{"kind": "stuck", "active": false}', faults.Stuck),
        ('{"kind": "silence"}', faults.Silence),
        ('{"kind": "amcl_silent"}', faults.AmclSilent),
        ('{"kind": "inactive"}', faults.Inactive),
        ('{"kind": "foreign_goal", "x": 1, "y": -2}', faults.ForeignGoal),
    ],
)
def test_each_kind_is_read(text: str, kind: type[object]) -> None:
    assert isinstance(parse(text), kind)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("no json", "Invalid JSON"),
        ("[]", "object"),
        ('{"kind": "explode"}', "explode"),
        ('{"kind": "stuck", "speed": 3}', "stuck.speed"),
        ('{"kind": "unreachable", "goals": 0}', "goals"),
        ('{"kind": "unreachable", "circles": [{"x": 1, "y": 2, "radius": -1}]}', "radius"),
        ('{"kind": "foreign_goal", "x": NaN, "y": 1}', "x"),
    ],
)
def test_what_is_no_fault_is_refused_with_the_reason(text: str, problem: str) -> None:
    with pytest.raises(faults.FaultRefusedError) as caught:
        parse(text)
    assert any(problem in line for line in caught.value.problems)


def test_a_counted_fault_ends_with_its_last_goal() -> None:
    switched = Faults()
    switched.apply(faults.RejectGoals(goals=2))
    switched.spend(faults.RejectGoals)
    assert switched.on(faults.RejectGoals)
    switched.spend(faults.RejectGoals)
    assert not switched.on(faults.RejectGoals)
    switched.spend(faults.RejectGoals)


def test_unreachable_circles() -> None:
    fault = faults.Unreachable(circles=(faults.Circle(x=1, y=1, radius=0.5),))
    assert fault.concerns(Pose(1.4, 1.0, 0.0))
    assert not fault.concerns(Pose(1.4, 1.4, 0.0))
    assert faults.Unreachable().concerns(Pose(99, 99, 0))


RUNS = (GoalEntry(UUID(int=1), 1, GoalStatus.EXECUTING),)
OVER = (GoalEntry(UUID(int=1), 1, GoalStatus.SUCCEEDED),)


def with_fault(fault: Lasting) -> Faults:
    active = Faults()
    active.apply(fault)
    return active


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
