from __future__ import annotations

from typing import Any

import pytest

from nena_shared.vda5050.brief.state import StateBrief
from nena_status_aggregator.fleet_model.condition import Condition
from nena_status_aggregator.fleet_model.session import RosSession, SessionState, ros_session, session_of
from support.fleet_briefs import state

BLIND = state(errors=({"error_type": "NAVIGATION_NOT_AVAILABLE", "error_level": "WARNING"},))


def telling(told: str, **fields: Any) -> StateBrief:
    """Give a state of a robot whose edge agent tells of its ROS session."""
    facts = {"state": told, "namespace": "/r1", "domainId": "7"}
    references = [{"reference_key": key, "reference_value": value} for key, value in facts.items()]
    entry = {"info_type": "rosSession", "info_level": "INFO", "info_references": references}
    return state(information=(entry,), **fields)


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
        *((Condition.IDLE, telling(each), each) for each in SessionState),
        (Condition.IDLE, telling("ACTIVE", errors=BLIND.errors), "ACTIVE"),
        (Condition.IDLE, telling("DREAMING"), "ACTIVE"),
        (Condition.SILENT, telling("ACTIVE"), "FAILED"),
        (Condition.OFFLINE, telling("ACTIVE"), "NOT_ACTIVE"),
    ],
)
def test_the_state_of_a_node(condition: Condition, last: StateBrief | None, session: str) -> None:
    assert session_of(condition, last).value == session


def test_where_the_session_is() -> None:
    assert ros_session(telling("FAILED")) == RosSession(SessionState.FAILED, "/r1", "7")
    assert ros_session(state()) is None
