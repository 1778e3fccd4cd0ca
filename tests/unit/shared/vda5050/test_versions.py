from __future__ import annotations

import json

import pytest

from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import (
    CODECS,
    UnknownVersionError,
    codec_for,
    codec_named,
    nearest_codec,
    reader_of,
    topics_for,
    version_of,
)


def test_unsupported_version_error_lists_supported_ones() -> None:
    with pytest.raises(UnknownVersionError, match=f"'1.1.0' .* {', '.join(CODECS)}") as caught:
        codec_for("1.1.0")

    assert caught.value.version == "1.1.0"


@pytest.mark.clause("4.2")
@pytest.mark.parametrize(
    ("version", "interface", "topic"),
    [
        ("2.0.0", None, "uagv/v2/ACME/1/state"),
        ("2.1.0", None, "uagv/v2/ACME/1/state"),
        ("3.0.0", None, "vda5050/v3/ACME/1/state"),
        ("3.0.0", "hall", "hall/v3/ACME/1/state"),
    ],
)
def test_topics_of_a_version(version: str, interface: str | None, topic: str) -> None:
    assert topics_for(version, interface).of(RobotKey("ACME", "1"), Topic.STATE) == topic


@pytest.mark.clause("7.2/version")
@pytest.mark.parametrize(
    ("version", "spoken"),
    [
        ("2.0.0", "2.0.0"),
        ("2.0.7", "2.0.0"),
        ("2.1.0", "2.1.0"),
        ("2.10.0", "2.1.0"),
        ("3.0.0", "3.0.0"),
        ("3.0.1", "3.0.1"),
        ("3.0.2", "3.0.1"),
    ],
)
def test_robot_is_answered_in_the_nearest_older_version(version: str, spoken: str) -> None:
    assert nearest_codec(version) is CODECS[spoken]


@pytest.mark.parametrize(
    "payload",
    [b"", b"{", b"[]", b"{}", b'{"version":2}', b'{"version":"2"}', b'{"version":"1.1.0"}', b"\xff", b"["],
)
def test_message_without_a_version_that_could_be_spoken(payload: bytes) -> None:
    version = version_of(payload)

    assert version is None or nearest_codec(version) is None


@pytest.mark.clause("7.2/version")
@pytest.mark.parametrize(
    ("version", "topic_level", "reader"),
    [
        ("2.0.0", "v2", "2.0.0"),
        ("3.0.0", "v3", "3.0.0"),
        ("3.0.0", "v2", "2.1.0"),
        ("3.0.1", "v3", "3.0.1"),
        ("2.0.0", "v3", [each for each in CODECS if each.startswith("3.")][-1]),
        ("unreadable", "v2", "2.1.0"),
    ],
)
def test_reader_is_of_the_topic_and_by_the_header_where_both_agree(
    version: str, topic_level: str, reader: str
) -> None:
    assert reader_of(json.dumps({"version": version}).encode(), topic_level).version == reader


def test_topic_of_an_unknown_major_version_has_no_reader() -> None:
    with pytest.raises(UnknownVersionError):
        reader_of(b'{"version":"1.1.0"}', "v1")


def test_version_is_read_from_the_top_of_the_message_alone() -> None:
    assert version_of(b'{"deep":{"version":"3.0.0"},"version":"2.0.0"}') == "2.0.0"
    assert version_of(b'{"deep":{"version":"3.0.0"}}') is None


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("2.0", "2.0.0"),
        ("2.1", "2.1.0"),
        ("v3", "3.0.0"),
        ("V2.0", "2.0.0"),
        (" 2.1.3 ", "2.1.0"),
        ("3.0", "3.0.0"),
        ("3.0.1", "3.0.1"),
    ],
)
def test_a_version_as_people_write_it(text: str, version: str) -> None:
    assert codec_named(text).version == version


@pytest.mark.parametrize("text", ["", "1.1", "4", "two", "2.", "2.0.0.0", "-2", "2" * 9])
def test_unsupported_version_is_refused(text: str) -> None:
    with pytest.raises(UnknownVersionError):
        codec_named(text)
