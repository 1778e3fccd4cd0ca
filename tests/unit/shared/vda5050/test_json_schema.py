"""The schemas of our own messages: all sent messages fit them, and they have the official fields."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema_rs import Draft202012Validator, meta

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS, UnknownVersionError
from support.examples import MESSAGES
from support.json_schema import json_schema
from support.messages import messages
from support.schemas import official_schema

EACH_MESSAGE = pytest.mark.parametrize(
    ("codec", "topic"),
    [(codec, topic) for codec in CODECS.values() for topic in codec.kinds],
    ids=lambda value: value.version if isinstance(value, Codec) else value,
)
NOT_HERE = {
    ".nodes[].nodePosition.mapDescription",
    ".nodeStates[].nodePosition.mapDescription",
    ".nodeStates[].nodePosition.allowedDeviationXY",
    ".nodeStates[].nodePosition.allowedDeviationTheta",
    ".agvPosition.mapDescription",
    ".localizationParameters",
    ".protocolLimits.maxStringLens.enumLen",
}
"""Optional fields of 2.x that say nothing which 3.0 still says."""

NOT_OF_THE_STANDARD = {".nenaEpoch", ".edges[].turnsAsPlanned"}
"""Orders and instant actions name the epoch of their order service; other robots ignore it.

How an edge is turned on is only stored, and removed before the order is sent."""
ONLY_IN_THE_TEXT = {
    ".actions[].retriable",
    ".physicalParameters.angularSpeedMax",
    ".physicalParameters.angularSpeedMin",
}
"""Fields that the official schemas forgot."""

READ_WITHOUT = {
    ".headerId",
    ".timestamp",
    ".physicalParameters.heightMin",
    ".edges[].trajectory.degree",
    ".edges[].trajectory.knotVector",
    ".edgeStates[].trajectory.degree",
    ".edgeStates[].trajectory.knotVector",
    ".nodes[].nodePosition.allowedDeviationXY.theta",
}
"""Fields that are always sent, and may be missing in what is read."""


@cache
def validator(version: str, topic: Topic) -> Draft202012Validator:
    schema = json_schema(version, topic)
    meta.validate(schema)
    return Draft202012Validator(schema)


def fields(schema: Mapping[str, Any]) -> dict[str, bool]:
    """Return the path of every field below ``schema``, and whether it is required."""
    return dict(_fields(schema, schema, ""))


def _fields(root: Mapping[str, Any], part: Mapping[str, Any], path: str) -> Iterator[tuple[str, bool]]:
    if "$ref" in part:
        target: Any = root
        for key in part["$ref"].removeprefix("#/").split("/"):
            target = target[key]
        part = {**target, **part}
    for branch in (part, *(each["then"] for each in part.get("allOf", ()))):
        for name, field in branch.get("properties", {}).items():
            yield f"{path}.{name}", name in part.get("required", ())
            yield from _fields(root, field, f"{path}.{name}")
    if "items" in part:
        yield from _fields(root, part["items"], path + "[]")


@pytest.mark.clause("7.3", "7.4", "7.5", "7.6", "7.7", "7.8", "7.9", "7.10/message")
@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_everything_sent_fits(codec: Codec, topic: Topic, data: st.DataObject) -> None:
    payload = codec.encode(data.draw(messages(codec.kinds[topic])))

    assert [error.message for error in validator(codec.version, topic).iter_errors(json.loads(payload))] == []


@pytest.mark.clause("7.3", "7.4", "7.5", "7.6", "7.7", "7.8", "7.9", "7.10/message")
@EACH_MESSAGE
def test_fields_are_those_of_the_official_schema(codec: Codec, topic: Topic) -> None:
    official = fields(official_schema(codec.version, topic))
    ours = fields(json_schema(codec.version, topic))

    assert official.keys() - ours.keys() <= NOT_HERE
    assert ours.keys() - official.keys() <= ONLY_IN_THE_TEXT | NOT_OF_THE_STANDARD
    assert {name for name, required in official.items() if required and not ours[name]} <= READ_WITHOUT
    assert {name for name, required in official.items() if name in ours and ours[name] > required} == set()


@pytest.mark.clause("7.7")
@pytest.mark.parametrize(
    ("version", "field", "words"),
    [
        ("2.0.0", "connectionState", ["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]),
        ("2.1.0", "connectionState", ["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]),
    ],
)
def test_closed_lists_hold_the_words_of_the_version(version: str, field: str, words: list[str]) -> None:
    schema = json_schema(version, Topic.CONNECTION)

    assert sorted(schema["properties"][field]["enum"]) == sorted(words)


def test_nothing_is_ever_null(order: dict[str, Any]) -> None:
    assert list(validator("2.1.0", Topic.ORDER).iter_errors(order)) == []
    order["edges"][0]["maxSpeed"] = None
    assert len(list(validator("2.1.0", Topic.ORDER).iter_errors(order))) == 1


@pytest.mark.clause("7.6")
def test_zone_needs_what_belongs_to_its_type() -> None:
    corners = [{"x": 0, "y": 0}, {"x": 1, "y": 0}, {"x": 0, "y": 1}]
    zone = {"zoneId": "z", "zoneType": "SPEED_LIMIT", "vertices": corners}
    message = {
        "headerId": 0,
        "timestamp": "2026-01-01T00:00:00.000Z",
        "version": "3.0.0",
        "manufacturer": "ACME",
        "serialNumber": "1",
    }
    found = validator("3.0.0", Topic.ZONE_SET).iter_errors(
        message | {"zoneSet": {"mapId": "m", "zoneSetId": "s", "zones": [zone]}}
    )

    assert [error.message for error in found] == ['"maximumSpeed" is a required property']


@pytest.mark.clause("4.3")
def test_unknown_message_or_version() -> None:
    with pytest.raises(MalformedMessageError, match=r"2\.1\.0 has no such message"):
        json_schema("2.1.0", Topic.ZONE_SET)
    with pytest.raises(UnknownVersionError):
        json_schema("1.1.0", Topic.ORDER)
