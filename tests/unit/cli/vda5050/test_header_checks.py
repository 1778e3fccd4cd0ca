"""Headers are counted, tell the time, and name the robot of their topic."""

from __future__ import annotations

from datetime import timedelta

import pytest

from nena_cli.vda5050.finding import Rule
from nena_cli.vda5050.recording import Entry
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.versions import codec_for
from support.fleet_examples import state as example_state
from support.talk import HEADER, START, Talk


def test_a_topic_of_another_major_version_is_named() -> None:
    talk = Talk().raw("fleet/v2/ACME/r1/state", codec_for("3.0.0").encode(example_state()))

    assert talk.rules == [Rule.VERSION]


def test_a_header_of_another_robot_is_named() -> None:
    assert Talk().say(example_state(), serial_number="0002").rules == [Rule.ADDRESS]


@pytest.mark.parametrize(("number", "rules"), [(1, []), (0, []), (3, [Rule.HEADER_ID])])
def test_header_ids_are_counted(number: int, rules: list[Rule]) -> None:
    talk = Talk().state("", of="").say(example_state(), header_id=number)

    assert talk.rules == rules


def test_header_ids_begin_anew_behind_the_last_number() -> None:
    talk = Talk().say(example_state(), header_id=2**32 - 1).say(example_state(), header_id=0)

    assert talk.rules == []


def test_each_topic_has_its_own_count() -> None:
    talk = Talk().say(example_state(), header_id=40).act()

    assert talk.rules == []


def test_time_does_not_go_back() -> None:
    talk = Talk().state("", of="").say(example_state(), timestamp=START - timedelta(hours=1))

    assert talk.rules == [Rule.TIMESTAMP]


def test_a_last_will_may_be_old() -> None:
    talk = Talk().online().state("", of="")
    will = Connection(**HEADER, connection_state=ConnectionState.CONNECTION_BROKEN)

    assert talk.say(will, timestamp=START - timedelta(hours=1), header_id=0).findings == []


def test_what_the_broker_has_kept_is_of_another_time() -> None:
    talk = Talk().state("", of="")
    kept = Entry(START, "fleet/v3/ACME/r1/state", codec_for("3.0.0").encode(example_state()), retain=True)
    talk.entries.insert(0, kept)

    assert talk.rules == []
