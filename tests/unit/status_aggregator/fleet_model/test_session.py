from __future__ import annotations

import pytest

from nena_shared.vda5050.brief.state import StateBrief
from nena_status_aggregator.fleet_model.condition import Condition
from nena_status_aggregator.fleet_model.session import session_of
from support.fleet_briefs import state

BLIND = state(errors=({"error_type": "NAVIGATION_NOT_AVAILABLE", "error_level": "WARNING"},))


@pytest.mark.parametrize(
    ("condition", "last", "session"),
    [
        (Condition.OFFLINE, state(), "NOT_ACTIVE"),
        (Condition.BROKEN, state(), "FAILED"),
        (Condition.SILENT, None, "INITIATING"),
        (Condition.SILENT, state(), "FAILED"),
        (Condition.IDLE, state(), "ACTIVE"),
        (Condition.MANUAL, state(), "ACTIVE"),
        (Condition.IDLE, BLIND, "FAILED"),
    ],
)
def test_the_state_of_a_node(condition: Condition, last: StateBrief | None, session: str) -> None:
    assert session_of(condition, last).value == session
