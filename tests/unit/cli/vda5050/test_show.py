"""A conversation as a person reads it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from nena_cli.vda5050.recording import read_file
from nena_cli.vda5050.show import show
from nena_shared.vda5050.topics import RobotKey
from support.conversations import FOLDER
from support.fleet_examples import state
from support.talk import Talk


def shown(talk: Talk, **options: Any) -> str:
    out = io.StringIO()
    show(talk.entries, Console(file=out, width=300), **options)
    return out.getvalue()


def test_a_state_is_told_by_what_has_changed_since_the_robots_own_one_before() -> None:
    talk = Talk().state("n0", of="")
    talk.raw("fleet/v3/ACME/0002/state", talk.codec.encode(state(robot=RobotKey("ACME", "0002"))))
    text = shown(talk.state("n0", of="", driving=True))

    assert text.split("state 3.0.0")[-1] == "\n    driving: yes\n"


def test_it_says_who_speaks_to_whom() -> None:
    text = shown(Talk().order("n0", "n1").state("n0", "n1"))

    assert "fleet → ACME/0001 order 3.0.0" in text
    assert "ACME/0001 → fleet state 3.0.0" in text


def test_a_state_that_changes_nothing_is_left_out_unless_all_is_asked_for() -> None:
    talk = Talk().state("n0", of="").state("n0", of="")

    assert shown(talk).count("state 3.0.0") == 1
    assert "nothing new" in shown(talk, everything=True)


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
