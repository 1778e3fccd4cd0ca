"""Recordings are written and read without loss."""

from __future__ import annotations

import io
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_conversations.broker import MAX_PAUSE, EntryFilter, FreshHeaders, is_retained, paced
from nena_conversations.message import Sender
from nena_conversations.recording import Entry, RecordingError, append, new_file, read, read_file

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
entries = st.builds(
    Entry,
    time=st.datetimes(timezones=st.just(UTC)),
    topic=st.text(min_size=1),
    payload=st.binary() | st.text().map(str.encode),
    qos=st.integers(0, 2),
    retain=st.booleans(),
)


@given(st.lists(entries))
def test_written_entries_are_read_unchanged(recorded: list[Entry]) -> None:
    file = io.StringIO()
    for entry in recorded:
        append(entry, file)

    assert list(read(io.StringIO(file.getvalue()), "it")) == recorded


def test_text_stays_readable_in_the_file() -> None:
    line = Entry(NOON, "fleet/v2/ACME/1/order", '{"ä": 1}'.encode(), 1).to_json()

    assert line.startswith('{"time":"2026-01-01T12:00:00Z","topic":"fleet/v2/ACME/1/order",')
    assert line.endswith('"payload":"{\\"ä\\": 1}","qos":1,"retain":false}')


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("{", "line 2: line: Invalid JSON"),
        ('{"topic": "t", "payload": null}', "line 2: time: is missing"),
        ('{"time": "2026-01-01T12:00:00", "topic": "t", "payload": null}', "line 2: time: .*timezone"),
        (
            '{"time": "2026-01-01T12:00:00Z", "topic": "t", "msg": {}}',
            "payload is missing; .*time, topic, msg",
        ),
        ('{"time": "2026-01-01T12:00:00Z", "topic": "t", "payload_base64": "?"}', "line 2: "),
    ],
)
def test_invalid_line_is_reported(line: str, problem: str) -> None:
    with pytest.raises(RecordingError, match=problem):
        list(read(["\n", line + "\n"], "it"))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.jsonl"):
        list(read_file(tmp_path / "none.jsonl"))
    (tmp_path / "bytes").write_bytes(b"\x89PNG")
    with pytest.raises(RecordingError, match="bytes is no text"):
        list(read_file(tmp_path / "bytes"))


def test_incomplete_last_line_is_skipped() -> None:
    whole = Entry(NOON, "t", b"x").to_json()

    assert len(list(read([whole + "\n", whole[:-9]], "it"))) == 1
    with pytest.raises(RecordingError, match="line 1"):
        list(read([whole[:-9]], "it"))


def test_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "it.jsonl"
    file.write_text("precious")

    with pytest.raises(FileExistsError, match="already exists; choose another"), new_file(file):
        pass
    assert file.read_text() == "precious"


@pytest.mark.parametrize(("recorded", "left"), [([], False), ([Entry(NOON, "t", b"x")], True)])
def test_failed_recording_keeps_the_recorded_messages_only(
    tmp_path: Path, recorded: list[Entry], *, left: bool
) -> None:
    file = tmp_path / "it.jsonl"
    with pytest.raises(OSError, match="away"), new_file(file) as out:  # noqa: PT012 - the file is the point
        for entry in recorded:
            append(entry, out)
        message = "the broker is away"
        raise OSError(message)

    assert file.exists() is left


ORDER, STATE = "uagv/v2/ACME/1/order", "uagv/v2/ACME/1/state"


def entry(topic: str = STATE, payload: bytes = b"{}", *, after: float = 0.0) -> Entry:
    return Entry(NOON + timedelta(seconds=after), topic, payload)


@pytest.mark.parametrize(
    ("choice", "taken"),
    [
        (EntryFilter(), [ORDER, STATE, "lamp"]),
        (EntryFilter(Sender.FLEET), [ORDER]),
        (EntryFilter(Sender.ROBOT), [STATE]),
        (EntryFilter(topic_filters=("uagv/#",)), [ORDER, STATE]),
        (EntryFilter(topic_filters=("+/+/+/+/order", "lamp")), [ORDER, "lamp"]),
        (EntryFilter(Sender.ROBOT, ("+/+/+/+/order",)), []),
    ],
)
def test_messages_are_chosen_by_speaker_and_topic(choice: EntryFilter, taken: list[str]) -> None:
    assert [each for each in (ORDER, STATE, "lamp") if choice.matches(entry(each))] == taken


def test_pauses_are_those_of_the_recording() -> None:
    entries = [entry(), entry(after=3), entry(after=2), entry(after=10_000)]

    assert [pause for pause, _ in paced(entries, 2.0)] == [0.0, 1.5, 0.0, MAX_PAUSE]
    assert [each for _, each in paced(entries, 2.0)] == entries


@pytest.mark.parametrize(("last", "kept"), [("connection", True), ("factsheet", True), ("state", False)])
def test_topics_that_robots_publish_retained(last: str, *, kept: bool) -> None:
    assert is_retained(f"uagv/v2/ACME/1/{last}") is kept


def test_fresh_headers_count_for_each_topic_and_tell_the_time() -> None:
    headers = FreshHeaders()
    payload = b'{"headerId": 77, "timestamp": "2020-01-01T00:00:00Z", "x": 1.5}'
    renewed = [headers.apply(entry(topic, payload), NOON) for topic in (STATE, ORDER, STATE)]

    read = [json.loads(each.payload) for each in renewed]
    assert [each["headerId"] for each in read] == [0, 0, 1]
    assert {each["timestamp"] for each in read} == {"2026-01-01T12:00:00.000Z"}
    assert {each["x"] for each in read} == {1.5}
    assert [each.topic for each in renewed] == [STATE, ORDER, STATE]


@pytest.mark.parametrize("payload", [b"\xff", b"hello", b"[1]", b'{"x": 1}'])
def test_message_without_a_header_stays_unchanged(payload: bytes) -> None:
    assert FreshHeaders().apply(entry(payload=payload), NOON) == entry(payload=payload)


TOPIC = "uagv/v2/ACME/7/state"
PAYLOAD = '{"headerId": 1, "timestamp": "2026-01-01T12:00:00.000Z"}'
TEXT = json.dumps(PAYLOAD)


@pytest.mark.parametrize(
    "line",
    [
        f'{{"tst":"2026-01-01T12:00:00.000000Z+0000","topic":"{TOPIC}","qos":1,"retain":0,"payload":{TEXT}}}',
        f'{{"tst":"2026-01-01T13:00:00.000000Z+0100","topic":"{TOPIC}","qos":1,"retain":0,"payload":{PAYLOAD}}}',
        f'{{"timestamp": 1767268800, "topic": "{TOPIC}", "qos": 1, "payload": {TEXT}}}',
        f'{{"_msgid": "1a", "topic": "{TOPIC}", "payload": {PAYLOAD}, "qos": 1}}',
        f"{TOPIC} {PAYLOAD}",
        f"2026-01-01T12:00:00+0000 {TOPIC} {PAYLOAD}",
        f"1767268800 {TOPIC} {PAYLOAD}",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_lines_of_other_tools_are_read(line: str, encoding: str, tmp_path: Path) -> None:
    (tmp_path / "it").write_bytes(f"{line}\r\n".encode(encoding))
    (entry,) = read_file(tmp_path / "it")
    assert (entry.time, entry.topic, json.loads(entry.payload)) == (NOON, TOPIC, json.loads(PAYLOAD))


def test_message_without_any_time_has_that_of_the_one_before() -> None:
    first, second = read([f"{TOPIC} {PAYLOAD}\n", f'{TOPIC} {{"headerId": 2}}\n'], "it")
    assert (first.time, second.time) == (NOON, NOON)


@pytest.mark.parametrize(
    "content",
    [
        b'{"headerId": 1}\n',
        b'{\n  "topics": []\n}\n',
        b"<model/>",
        b"[mqtt]\n",
        b"sensor 21.5\n",
        b"\x89MCAP0\r\n",
        b"\xd4\xc3\xb2\xa1\x02\x00\xff\xff",
    ],
)
def test_a_file_that_is_no_recording_is_told_the_expected_form(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "it").write_bytes(content)
    with pytest.raises(RecordingError, match=r"it.*one JSON object per line with time, topic and payload"):
        list(read_file(tmp_path / "it"))
