"""Recordings are MCAP files that the format's own reader reads."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from nena_shared.extensions.black_box.mcap_file import Recording, write_mcap
from nena_shared.extensions.black_box.ring import Channel, Entry
from nena_shared.log import in_plain_text

UTC_NOW = datetime(2026, 1, 1, 12, 0, 0, tzinfo=UTC)
STATE, ORDER = Channel("uagv/v2/ACME/1/state"), Channel("uagv/v2/ACME/1/order", own=False)
IMU = Channel("/imu", "sensor_msgs/msg/Imu")


def read(path: Path) -> list[tuple[Any, Any, Any]]:
    """Return schema, channel and message of each message, in the order of time."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return list(reader.iter_messages())


def written(path: Path, *entries: Entry, lines: tuple[str, ...] = ()) -> list[tuple[Any, Any, Any]]:
    about = {"source": "ACME/1", "reason": "request"}
    recording = Recording(entries, lines, 100.0, UTC_NOW, about)
    write_mcap(path, recording, ros_schema=lambda name: f"# {name}".encode())
    return read(path)


def test_messages_have_their_topic_and_time(tmp_path: Path) -> None:
    late, early = Entry(99.5, STATE, b'{"headerId":2}'), Entry(90.0, ORDER, b'{"headerId":1}')
    found = written(tmp_path / "a.mcap", late, early)

    assert [(channel.topic, message.data) for _, channel, message in found] == [
        (ORDER.topic, b'{"headerId":1}'),
        (STATE.topic, b'{"headerId":2}'),
    ]
    noon = int(UTC_NOW.timestamp()) * 10**9
    assert [message.log_time - noon for _, _, message in found] == [-10 * 10**9, -(10**9) // 2]
    assert {(channel.message_encoding, schema.encoding) for schema, channel, _ in found} == {
        ("json", "jsonschema")
    }


def test_a_received_message_that_is_not_json_is_kept_readable(tmp_path: Path) -> None:
    found = written(
        tmp_path / "a.mcap",
        *(
            Entry(float(number), ORDER, each)
            for number, each in enumerate((b"\xff{", b"[1]", b"{}", b"", b"[" * 99999))
        ),
    )

    contents = [json.loads(message.data) for _, _, message in found]
    assert contents[:4] == [{"unreadable": "\\xff{"}, {"unreadable": "[1]"}, {}, {"unreadable": ""}]
    assert set(contents[4]) == {"unreadable"}


def test_ros_messages_keep_their_encoding_with_their_definition(tmp_path: Path) -> None:
    ((schema, channel, message),) = written(tmp_path / "a.mcap", Entry(1.0, IMU, b"\0\1\0\0data"))

    assert (schema.name, schema.encoding, schema.data) == (IMU.schema, "ros2msg", b"# sensor_msgs/msg/Imu")
    assert (channel.topic, channel.message_encoding, message.data) == ("/imu", "cdr", b"\0\1\0\0data")


def test_log_lines_are_shown_in_foxgloves_log_panel(tmp_path: Path) -> None:
    warning = {"timestamp": "2026-01-01T11:59:59.250000Z", "level": "warning", "event": "reported"}
    strange = {"timestamp": "2026-01-01T11:59:59.500000Z", "level": "notice", "event": "strange level"}
    lines = (
        in_plain_text(None, "", {**warning, "robot": "ACME/1"}),
        "a line of a traceback",
        in_plain_text(None, "", {**strange}),
    )
    first, second = written(tmp_path / "a.mcap", lines=lines)

    schema, channel, message = first
    assert (schema.name, channel.topic) == ("foxglove.Log", "/nena/log")
    content = json.loads(message.data)
    assert (content["level"], content["message"].split()) == (3, ["reported", "robot=ACME/1"])
    assert content["timestamp"] == {"sec": int(UTC_NOW.timestamp()) - 1, "nsec": 250_000_000}
    assert json.loads(second[2].data)["level"] == 0


def test_the_file_says_what_it_is(tmp_path: Path) -> None:
    written(tmp_path / "a.mcap")

    with (tmp_path / "a.mcap").open("rb") as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    assert (metadata.name, metadata.metadata) == ("nena", {"source": "ACME/1", "reason": "request"})
