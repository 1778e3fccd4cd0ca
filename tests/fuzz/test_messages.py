"""Every reader of VDA 5050 messages, with recorded and damaged messages: read, or refused."""

from __future__ import annotations

import os
from functools import cache
from typing import Any

import pytest

from nena_conversations.checker import Checker
from nena_conversations.recording import Entry, read_file
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.records import read_record
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS, reader_of, version_of
from nena_shared.vda5050.visualization import Visualization
from support.conversations import FOLDER
from support.damage import damaged, stream

MESSAGES = int(os.environ.get("NENA_FUZZ_MESSAGES", "600"))
"""For each version and topic."""
READABLE = 5000
"""Characters."""
SAID = [(version, topic) for version, codec in CODECS.items() for topic in codec.kinds]
RECORDS: dict[Topic, Any] = {Topic.STATE: State, Topic.VISUALIZATION: Visualization}


@cache
def recorded(version: str) -> tuple[Entry, ...]:
    """Return all recorded messages of a version, or of the version before it that has recordings."""
    earlier = list(CODECS)[: list(CODECS).index(version) + 1]
    files = next(found for each in reversed(earlier) if (found := sorted(FOLDER.glob(f"{each}-*.jsonl"))))
    return tuple(entry for file in files for entry in read_file(file))


def samples(version: str, topic: Topic) -> list[bytes]:
    found = [each.payload for each in recorded(version) if each.topic.endswith(f"/{topic}") and each.payload]
    if topic is Topic.VISUALIZATION:  # no recording has one: it is made of the states
        states = (CODECS[version].decode(State, each) for each in samples(version, Topic.STATE))
        found = [CODECS[version].encode(_shown(each)) for each in states if each.mobile_robot_position]
    assert found, f"no recorded conversation has a {topic} of {version}"
    return found


def _shown(state: State) -> Visualization:
    return Visualization(
        header_id=state.header_id,
        timestamp=state.timestamp,
        version=state.version,
        manufacturer=state.manufacturer,
        serial_number=state.serial_number,
        reference_state_header_id=state.header_id,
        mobile_robot_position=state.mobile_robot_position,
        velocity=state.velocity,
    )


@pytest.mark.parametrize(("version", "topic"), SAID)
def test_any_message_is_read_or_refused(version: str, topic: Topic) -> None:
    codec, chance = CODECS[version], stream(f"{version} {topic}")
    found = samples(version, topic)
    outcomes, longest = {True: 0, False: 0}, 0
    for _ in range(MESSAGES):
        payload = damaged(chance.choice(found), chance)
        version_of(payload)
        reader_of(payload, codec.major_version)
        try:
            codec.decode(codec.kinds[topic], payload)
        except MalformedMessageError as error:
            outcomes[False] += 1
            longest = max(longest, len(str(error)))
        else:
            outcomes[True] += 1

    assert longest < READABLE, "a refusal is for people, also that of something huge"
    assert min(outcomes.values()) > MESSAGES / 20, f"nearly all read or refused: {outcomes}"


@pytest.mark.parametrize("topic", RECORDS)
@pytest.mark.parametrize("version", CODECS)
def test_records_and_codec_accept_the_same_messages(version: str, topic: Topic) -> None:
    codec, chance = CODECS[version], stream(f"{version} {topic} as a record")
    found = samples(version, topic)
    for _ in range(MESSAGES):
        payload = damaged(chance.choice(found), chance)
        try:
            codec.decode(codec.kinds[topic], payload)
            taken = True
        except MalformedMessageError:
            taken = False
        try:
            read_record(RECORDS[topic], codec, payload)
        except MalformedMessageError:
            assert not taken, payload[:2000]
        else:
            assert taken, payload[:2000]


@pytest.mark.parametrize("version", CODECS)
def test_checker_reports_findings_and_continues(version: str) -> None:
    chance, checker = stream(version), Checker()
    entries = [
        entry if chance.random() < 0.5 else Entry(entry.time, entry.topic, damaged(entry.payload, chance))
        for entry in recorded(version)
    ]
    findings = [finding for entry in entries for finding in checker.add(entry)]

    assert findings
    assert checker.checked + len(findings) >= len(entries) / 2
