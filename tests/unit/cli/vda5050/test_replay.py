"""What of a recording is published again, when, and under which headers."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta

import pytest

from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.replay import LONGEST_PAUSE, Choice, FreshHeaders, is_kept, paced
from nena_cli.vda5050.said import Speaker

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
ORDER, STATE = "uagv/v2/ACME/1/order", "uagv/v2/ACME/1/state"


def entry(topic: str = STATE, payload: bytes = b"{}", *, after: float = 0.0) -> Entry:
    return Entry(NOON + timedelta(seconds=after), topic, payload)


@pytest.mark.parametrize(
    ("choice", "taken"),
    [
        (Choice(), [ORDER, STATE, "lamp"]),
        (Choice(Speaker.FLEET), [ORDER]),
        (Choice(Speaker.ROBOT), [STATE]),
        (Choice(topic_filters=("uagv/#",)), [ORDER, STATE]),
        (Choice(topic_filters=("+/+/+/+/order", "lamp")), [ORDER, "lamp"]),
        (Choice(Speaker.ROBOT, ("+/+/+/+/order",)), []),
    ],
)
def test_messages_are_chosen_by_speaker_and_topic(choice: Choice, taken: list[str]) -> None:
    assert [each for each in (ORDER, STATE, "lamp") if choice.takes(entry(each))] == taken


def test_pauses_are_those_of_the_recording() -> None:
    entries = [entry(), entry(after=3), entry(after=2), entry(after=10_000)]

    assert [pause for pause, _ in paced(entries, 2.0)] == [0.0, 1.5, 0.0, LONGEST_PAUSE]
    assert [each for _, each in paced(entries, 2.0)] == entries


@pytest.mark.parametrize(("last", "kept"), [("connection", True), ("factsheet", True), ("state", False)])
def test_what_robots_leave_at_the_broker_is_left_there(last: str, *, kept: bool) -> None:
    assert is_kept(f"uagv/v2/ACME/1/{last}") is kept


def test_fresh_headers_count_for_each_topic_and_tell_the_time() -> None:
    headers = FreshHeaders()
    payload = b'{"headerId": 77, "timestamp": "2020-01-01T00:00:00Z", "x": 1.5}'
    renewed = [headers.renewed(entry(topic, payload), NOON) for topic in (STATE, ORDER, STATE)]

    read = [json.loads(each.payload) for each in renewed]
    assert [each["headerId"] for each in read] == [0, 0, 1]
    assert {each["timestamp"] for each in read} == {"2026-01-01T12:00:00.000Z"}
    assert {each["x"] for each in read} == {1.5}
    assert [each.topic for each in renewed] == [STATE, ORDER, STATE]


@pytest.mark.parametrize("payload", [b"\xff", b"hello", b"[1]", b'{"x": 1}'])
def test_what_has_no_header_stays_as_it_is(payload: bytes) -> None:
    assert FreshHeaders().renewed(entry(payload=payload), NOON) == entry(payload=payload)
