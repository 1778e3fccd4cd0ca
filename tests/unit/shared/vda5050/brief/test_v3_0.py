from __future__ import annotations

import pytest

from nena_shared.vda5050.brief.reader import read_brief
from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.v3_0 import CODEC
from support.fleet_examples import state


def test_older_names_are_read_as_the_newer_ones() -> None:
    error = {"error_type": "INVALID_ORDER_ACTION", "error_level": "WARNING"}
    action = {"action_id": "a", "action_type": "initializePosition", "action_status": "RUNNING"}
    payload = CODEC.encode(state(errors=(error,), instant_action_states=(action,)))
    older = payload.replace(b"INVALID_ORDER_ACTION", b"INVALID_ORDER")
    older = older.replace(b"initializePosition", b"initPosition")
    assert older != payload
    brief = read_brief(StateBrief, CODEC, older)
    assert brief.errors[0].error_type == "INVALID_ORDER_ACTION"
    assert brief.instant_action_states[0].action_type == "initializePosition"


def test_what_watchers_do_not_need_is_checked_too() -> None:
    trajectory = {"control_points": ({"x": 0.0, "y": 0.0, "weight": 0.5}, {"x": 1.0, "y": 0.0})}
    payload = CODEC.encode(state(planned_path={"trajectory": trajectory}))
    assert read_brief(StateBrief, CODEC, payload).header_id == 1
    with pytest.raises(MalformedMessageError, match="weight"):
        read_brief(StateBrief, CODEC, payload.replace(b'"weight":0.5', b'"weight":0.0'))
