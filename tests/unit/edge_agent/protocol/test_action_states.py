"""Transitions of action states (section 6.6.9, figure 21)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.action_states import ActionRecord, ActionStates
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from support.robot_core import action


def states(status: str) -> ActionStates:
    made = ActionStates()
    made.add([ActionRecord(action("a"), ActionScope.NODE, 0, ActionStatus(status))])
    return made


@pytest.mark.clause("6.6.9")
@pytest.mark.parametrize("ended", ["FINISHED", "FAILED"])
@pytest.mark.parametrize("to", list(ActionStatus))
def test_an_ended_action_stays_ended(ended: str, to: ActionStatus) -> None:
    made = states(ended)

    assert not made.change("a", to)
    assert made.states[0].action_status == ended


@pytest.mark.clause("6.6.9")
@pytest.mark.parametrize(
    ("old", "new", "allowed"),
    [
        ("WAITING", "INITIALIZING", True),
        ("WAITING", "RUNNING", True),
        ("WAITING", "PAUSED", False),
        ("INITIALIZING", "RUNNING", True),
        ("RUNNING", "INITIALIZING", False),
        ("RUNNING", "PAUSED", True),
        ("RUNNING", "WAITING", False),
        ("RUNNING", "RETRIABLE", True),
        ("PAUSED", "RUNNING", True),
        ("RETRIABLE", "FAILED", True),
        ("INITIALIZING", "FINISHED", True),
    ],
)
def test_allowed_changes(old: str, new: str, allowed: bool) -> None:  # noqa: FBT001
    made = states(old)

    assert made.change("a", ActionStatus(new)) is allowed
    assert made.states[0].action_status == (new if allowed else old)


def test_a_result_alone_is_a_change_and_the_same_status_again_is_none() -> None:
    made = states("RUNNING")
    revision = made.revision

    assert not made.change("a", ActionStatus.RUNNING)
    assert made.revision == revision
    assert made.change("a", ActionStatus.RUNNING, "half done")
    assert made.states[0].action_result == "half done"


def test_an_unknown_action_is_passed_over() -> None:
    assert not states("RUNNING").change("b", ActionStatus.FINISHED)
