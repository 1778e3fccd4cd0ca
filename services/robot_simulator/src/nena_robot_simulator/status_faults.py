"""What becomes of a status array on its way, where a fault disturbs it."""

from __future__ import annotations

from nena_robot_simulator import faults
from nena_robot_simulator.faults import Faults
from nena_robot_simulator.status_array import Snapshot


def disturbed(newest: Snapshot, before: Snapshot, active: Faults) -> tuple[Snapshot, ...]:
    """Give the arrays that come in place of ``newest``; ``before`` is the one that came about before it."""
    if active.on(faults.TerminalFirst) and not all(goal.ended for goal in newest):
        return ()
    if active.on(faults.ReorderedStatus) and before:
        return (newest, before, newest)
    if active.on(faults.DuplicateStatus):
        return (newest, newest)
    return (newest,)
