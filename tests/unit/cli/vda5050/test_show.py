"""A conversation as a person reads it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from nena_cli.vda5050.recording import read_file
from nena_cli.vda5050.show import show
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.state import EmergencyStop, Load, OperatingMode, SafetyState
from support.conversations import FOLDER
from support.fleet_examples import factsheet, position
from support.robot_core import action
from support.talk import Talk, doing
from support.zones import responses


def shown(talk: Talk, **options: Any) -> str:
    out = io.StringIO()
    show(talk.entries, Console(file=out, width=300), **options)
    return out.getvalue()


def change(**fields: Any) -> str:
    """Give what is told of a state by what it changes."""
    text = shown(Talk().state("n0", of="").state("n0", of="", **fields))
    return text.split("state 3.0.0")[-1]


def test_it_says_who_speaks_to_whom() -> None:
    text = shown(Talk().order("n0", "n1").state("n0", "n1"))

    assert "fleet → ACME/0001 order 3.0.0" in text
    assert "ACME/0001 → fleet state 3.0.0" in text


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"driving": True}, "driving: yes"),
        ({"operating_mode": OperatingMode.MANUAL}, "mode: MANUAL"),
        ({"paused": True}, "paused: yes"),
        ({"new_base_request": True}, "wants more base: yes"),
        ({"last_node_id": "n7", "last_node_sequence_id": 14}, "last node 'n7' (14)"),
        ({"action_states": doing(("a", "RUNNING"))}, "work 'a' RUNNING"),
        ({"errors": (error(ErrorType.NODE_UNREACHABLE, "wall"),)}, "CRITICAL NODE_UNREACHABLE: wall"),
        ({"mobile_robot_position": position(4.0, 2.0)}, "at x 4.00, y 2.00"),
        ({"loads": (Load(load_id="box"),)}, "loads: box"),
        (
            {"safety_state": SafetyState(active_emergency_stop=EmergencyStop.MANUAL, field_violation=True)},
            "emergency stop: MANUAL",
        ),
    ],
)
def test_of_a_state_it_tells_what_has_changed(fields: dict[str, Any], line: str) -> None:
    text = change(**fields)

    assert f"    {line}" in text
    assert "battery" not in text


def test_a_state_that_changes_nothing_is_left_out_unless_all_is_asked_for() -> None:
    talk = Talk().state("n0", of="").state("n0", of="")

    assert shown(talk).count("state 3.0.0") == 1
    assert "nothing new" in shown(talk, everything=True)


def test_a_horizon_that_becomes_base_is_told() -> None:
    nodes = ({"node_id": "n1", "sequence_id": 2, "released": True}, {"node_id": "n2", "sequence_id": 4})
    talk = Talk()
    for released in (False, True):
        talk.state("n0", node_states=(nodes[0], nodes[1] | {"released": released}))

    assert "nodes left: n1, horizon n2\n" in shown(talk)
    assert "nodes left: n1, n2\n" in shown(talk)


def test_an_error_that_is_gone_is_over() -> None:
    entry = error(ErrorType.NODE_UNREACHABLE, "wall")
    talk = Talk().state("n0", of="", errors=(entry,)).state("n0", of="")

    assert "over: NODE_UNREACHABLE" in shown(talk)


def test_an_order_shows_its_way_and_its_actions() -> None:
    talk = Talk().order(
        "n0", "n1", "n2", released=2, node_actions={"n1": [action("a", "HARD", "pick", lhd=1)]}
    )

    assert "base n0 → n1, horizon n2" in shown(talk)
    assert "on n1: pick(lhd=1) as 'a', HARD" in shown(talk)


def test_the_other_messages_are_told_in_a_line() -> None:
    talk = Talk().online().say(factsheet()).act(action("a", "NONE", "startPause"))
    text = shown(talk.say(responses("r1", "GRANTED")))

    assert "    ONLINE" in text
    assert "can do" in text
    assert "do startPause() as 'a', NONE" in text
    assert "r1: GRANTED" in text


def test_what_is_not_readable_says_why() -> None:
    assert "not readable: " in shown(Talk().raw("fleet/v3/ACME/0001/state", b"?"))


def test_one_robot_is_picked_out() -> None:
    assert shown(Talk().online(), robot="ACME/0002") == ""
    assert "ONLINE" in shown(Talk().online(), robot="ACME/0001")


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.jsonl")), ids=lambda file: file.stem)
def test_each_recorded_message_is_told(file: Path) -> None:
    entries = list(read_file(file))

    out = io.StringIO()
    assert show(entries, Console(file=out, width=300), everything=True) == len(entries)
    assert "not readable" not in out.getvalue()
