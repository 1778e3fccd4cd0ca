"""A conversation as a person reads it."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from nena_conversations.recording import read_file
from nena_conversations.show import describe, show
from nena_shared.vda5050.action import Action, InstantActions
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.topics import RobotKey
from support.conversations import FOLDER
from support.fleet_examples import connection, factsheet, position, state, visualization, way
from support.robot_core import action, order
from support.talk import HEADER, Talk, doing
from support.zones import responses, transfer, zone


def shown(talk: Talk, **options: Any) -> str:
    out = io.StringIO()
    show(talk.entries, Console(file=out, width=300), **options)
    return out.getvalue()


def test_state_is_compared_with_the_previous_one_of_the_same_robot() -> None:
    talk = Talk().state("n0", of="")
    talk.raw("fleet/v3/ACME/0002/state", talk.codec.encode(state(robot=RobotKey("ACME", "0002"))))
    text = shown(talk.state("n0", of="", driving=True))

    assert text.split("state 3.0.0")[-1] == "\n    driving: yes\n"


def test_sender_and_receiver_are_shown() -> None:
    text = shown(Talk().order("n0", "n1").state("n0", "n1"))

    assert "fleet → ACME/0001 order 3.0.0" in text
    assert "ACME/0001 → fleet state 3.0.0" in text


def test_a_state_that_changes_nothing_is_left_out_unless_all_is_asked_for() -> None:
    talk = Talk().state("n0", of="").state("n0", of="")

    assert shown(talk).count("state 3.0.0") == 1
    assert "no change" in shown(talk, everything=True)


def test_unreadable_message_is_shown_with_the_reason() -> None:
    assert "malformed: " in shown(Talk().raw("fleet/v3/ACME/0001/state", b"?"))


OLD = {"headerId": 1, "timestamp": "2026-01-01T00:00:00.000Z", "manufacturer": "ACME", "serialNumber": "7"}


@pytest.mark.parametrize(
    ("topic", "version", "label"),
    [
        ("agv/v1/ACME/7", {"version": "1.3.0"}, "1.3.0"),
        ("uagv/v1/ACME/7", {"version": "1.1"}, "1.1.0"),
        ("uagv/v1/ACME/7", {}, "1.x"),
        ("uagv/v1/ACME/7", {"version": "VDA1_1"}, "1.x"),
        ("fleet/robots/ACME/7", {"version": "1.1.0"}, "1.1.0"),
        ("uagv/v2/ACME/7", {"version": "1.1.0"}, "1.1.0"),
        ("uagv/v2/ACME/7", {"version": "1.3.2"}, "1.3.2"),
    ],
)
def test_unsupported_version_is_named_once_for_each_robot(
    topic: str, version: dict[str, str], label: str
) -> None:
    talk = Talk()
    for number, online in enumerate(("ONLINE", "OFFLINE", "ONLINE")):
        content = {**OLD, **version, "headerId": number, "connectionState": online}
        talk.raw(f"{topic}/connection", json.dumps(content).encode())
    text = shown(talk)
    assert text.count("VDA 5050 1.x is not supported") == 1
    assert f"connection {label}\n" in text
    assert text.count("connection ") == (3 if "/v2" in topic else 1)
    assert "malformed" not in text
    assert [each.rule.code for each in talk.findings] == ["version"]
    assert talk.texts.startswith("VDA 5050 1.x is not supported")


def test_label_has_no_version_that_neither_topic_nor_header_names() -> None:
    text = shown(Talk().raw("uagv/v2/ACME/7/state", b"{}").raw("uagv/site/ACME/7/state", b"{}"))
    assert "state 2.x\n" in text
    assert "state unknown\n" in text


def test_many_small_moves_are_shown_as_one() -> None:
    talk = Talk()
    for number in range(10):
        talk.state("n0", of="", mobile_robot_position=position(number * 0.02, 0.0))
    assert [line for line in shown(talk).splitlines() if "at x" in line] == [
        f"    at x {x:.2f}, y 0.00 on 'hall'" for x in (0.0, 0.06, 0.12, 0.18)
    ]


def test_one_robot_is_picked_out() -> None:
    assert shown(Talk().online(), robot="ACME/0002") == ""
    assert "ONLINE" in shown(Talk().online(), robot="ACME/0001")


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.jsonl")), ids=lambda file: file.stem)
def test_every_recorded_message_is_shown(file: Path) -> None:
    entries = list(read_file(file))

    out = io.StringIO()
    assert show(entries, Console(file=out, width=300), everything=True) == len(entries)
    assert "not readable" not in out.getvalue()


WALL = error(ErrorType.NODE_UNREACHABLE, "wall")
FULL: dict[str, Any] = {
    "order_id": "o1",
    "last_node_id": "n0",
    "driving": True,
    "paused": False,
    "new_base_request": False,
    "mobile_robot_position": position(4.0, 2.0),
    "loads": ({"load_id": "box"},),
    "errors": (WALL,),
    "action_states": doing(("a", "RUNNING")),
    "maps": ({"map_id": "hall", "map_version": "1", "map_status": "ENABLED"},),
    "zone_sets": ({"zone_set_id": "s1", "map_id": "hall", "zone_set_status": "ENABLED"},),
    **way("n1", "n2", released=1),
}


def changed(fields: dict[str, Any], before: dict[str, Any] | None = None) -> list[str]:
    """Return the lines shown for a state that differs from the one before it by ``fields``."""
    return describe(state(2, **{**(before or {}), **fields}), state(1, **(before or {})))


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"order_id": "o1"}, "order 'o1' update 0"),
        ({"driving": True}, "driving: yes"),
        ({"operating_mode": OperatingMode.MANUAL}, "mode: MANUAL"),
        ({"paused": True}, "paused: yes"),
        ({"new_base_request": True}, "requests more base: yes"),
        ({"last_node_id": "n7", "last_node_sequence_id": 14}, "last node 'n7' (14)"),
        (way("n1", "n2", released=1), "nodes left: n1, horizon n2"),
        ({"loads": ({"load_id": "box"}, {"load_type": "EPAL"}, {})}, "loads: box, EPAL, a load"),
        ({"power_supply": {"state_of_charge": 79.4, "charging": False}}, "battery 79 %"),
        ({"power_supply": {"state_of_charge": 79.6, "charging": True}}, "charging: yes"),
        (
            {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}},
            "emergency stop: MANUAL",
        ),
        (
            {"safety_state": {"active_emergency_stop": "NONE", "field_violation": True}},
            "field violation: yes",
        ),
        ({"maps": FULL["maps"]}, "maps: hall ENABLED"),
        ({"zone_sets": FULL["zone_sets"]}, "zone sets: s1 ENABLED"),
        (
            {
                "zone_requests": (
                    {
                        "request_id": "r1",
                        "request_type": "ACCESS",
                        "zone_id": "z",
                        "zone_set_id": "s1",
                        "request_status": "REQUESTED",
                    },
                )
            },
            "requests: r1 REQUESTED",
        ),
        ({"errors": (WALL,)}, "CRITICAL NODE_UNREACHABLE: wall"),
        ({"action_states": doing(("a", "RUNNING"))}, "work 'a' RUNNING"),
        ({"instant_action_states": doing(("a", "RUNNING"))}, "work 'a' RUNNING"),
    ],
)
def test_only_changes_of_a_state_are_shown(fields: dict[str, Any], line: str) -> None:
    assert changed(fields) == [line]


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"order_id": ""}, "no order yet"),
        ({"order_update_id": 1}, "order 'o1' update 1"),
        ({"driving": False}, "driving: no"),
        ({"node_states": ()}, "nodes left: none"),
        (way("n1", "n2"), "nodes left: n1, n2"),
        ({"loads": ()}, "loads: none"),
        ({"loads": None}, "loads: none"),
        ({"maps": ()}, "maps: none"),
        ({"errors": ()}, "cleared: NODE_UNREACHABLE"),
        ({"action_states": doing(("a", "FINISHED"))}, "work 'a' FINISHED"),
        ({"action_states": ()}, "no longer listed: a"),
        ({"mobile_robot_position": None}, "position unknown"),
        ({"mobile_robot_position": position(4.0, 2.0, localized=False)}, "not localised"),
        ({"mobile_robot_position": {**position(4.0, 2.0), "map_id": "yard"}}, "at x 4.00, y 2.00 on 'yard'"),
    ],
)
def test_ends_are_shown(fields: dict[str, Any], line: str) -> None:
    assert changed(fields, FULL) == [line]


def test_first_state_shows_the_position_and_no_empty_values() -> None:
    assert describe(state(), None) == [
        "no order yet",
        "last node '' (0)",
        "nodes left: none",
        "mode: AUTOMATIC",
        "battery 80 %",
    ]
    first = describe(state(**FULL), None)
    assert {"driving: yes", "loads: box", "work 'a' RUNNING", "maps: hall ENABLED"} <= set(first)
    assert not any("paused" in each or "emergency" in each for each in first)


@pytest.mark.parametrize(
    ("message", "lines"),
    [
        (
            order("n0", "n1", "n2", released=2),
            ["order 'o1' update 0", "base n0 → n1, horizon n2"],
        ),
        (
            order(
                "n0",
                "n1",
                update=3,
                node_actions={"n1": [action("a", "HARD", "pick", lhd=1, side="left")]},
                edge_actions={"n0-n1": [action("b")]},
            ),
            [
                "order 'o1' update 3",
                "base n0 → n1",
                "on n1: pick(lhd=1, side=left) as 'a', HARD",
                "along n0-n1: work() as 'b', NONE",
            ],
        ),
    ],
)
def test_an_order_shows_its_way_and_its_actions(message: Order, lines: list[str]) -> None:
    assert describe(message, None) == lines


def test_other_messages_are_shown_in_one_line() -> None:
    def instant(*actions: Action) -> InstantActions:
        return InstantActions(**HEADER, actions=actions)

    assert describe(connection(), None) == ["ONLINE"]
    assert describe(factsheet(), None) == ["Carrier 100: supports none"]
    assert describe(instant(action("a", "NONE", "startPause"), action("b")), None) == [
        "do startPause() as 'a', NONE",
        "do work() as 'b', NONE",
    ]
    assert describe(responses("r1", "GRANTED"), None) == ["r1: GRANTED"]
    assert describe(transfer(zone("z", "BLOCKED", 0, 1), zone("y", "BLOCKED", 0, 1)), None) == [
        "zone set 's1': z, y"
    ]
    assert describe(visualization(), None) == []
