"""Each version carries any neutral message as far as it can, in a form that its schema accepts."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS
from support.examples import MESSAGES
from support.messages import messages
from support.nearest import nearest, plain
from support.schemas import schema_problems

EACH_MESSAGE = pytest.mark.parametrize(
    ("codec", "topic"),
    [(codec, topic) for codec in CODECS.values() for topic in codec.kinds],
    ids=lambda value: value.version if isinstance(value, Codec) else value,
)
BOTH_OF_3_0 = ("3.0.0", "3.0.1")
"""What is written for one of them fits the schemas of both: 3.0.1 only corrects 3.0.0."""


@pytest.mark.clause("7.3", "7.4", "7.5", "7.6", "7.7", "7.8", "7.9", "7.10/message")
@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_message_arrives_as_the_nearest_that_the_version_can_say(
    codec: Codec, topic: Topic, data: st.DataObject
) -> None:
    kind = codec.kinds[topic]
    message = data.draw(messages(kind))

    assert plain(codec.decode(kind, codec.encode(message))) == nearest(codec.version, plain(message))


@pytest.mark.clause("7.3", "7.4", "7.5", "7.6", "7.7", "7.8", "7.9", "7.10/message")
@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_encoded_message_fits_the_official_schema(codec: Codec, topic: Topic, data: st.DataObject) -> None:
    payload = codec.encode(data.draw(messages(codec.kinds[topic])))

    for version in BOTH_OF_3_0 if codec.version in BOTH_OF_3_0 else (codec.version,):
        assert schema_problems(version, topic, payload) == []


@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_round_trip_is_lossless(codec: Codec, topic: Topic, data: st.DataObject) -> None:
    payload = codec.encode(data.draw(messages(codec.kinds[topic])))

    assert codec.encode(codec.decode(codec.kinds[topic], payload)) == payload


@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_message_of_another_version_can_be_encoded(codec: Codec, topic: Topic, data: st.DataObject) -> None:
    kind = codec.kinds[topic]
    other = data.draw(st.sampled_from([each for each in CODECS.values() if topic in each.kinds]))
    read = other.decode(kind, other.encode(data.draw(messages(kind))))

    payload = codec.encode(read)

    assert schema_problems(codec.version, topic, payload) == []
    assert plain(codec.decode(kind, payload)) == nearest(codec.version, plain(read))


@pytest.mark.clause("7.1/malformed")
@EACH_MESSAGE
@settings(max_examples=MESSAGES)
@given(st.data())
def test_garbled_message_never_breaks_the_reader(codec: Codec, topic: Topic, data: st.DataObject) -> None:
    kind = codec.kinds[topic]
    payload = bytearray(codec.encode(data.draw(messages(kind))))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    outcome: Header | MalformedMessageError
    try:
        outcome = codec.decode(kind, bytes(payload))
    except MalformedMessageError as error:
        outcome = error

    assert outcome.problems if isinstance(outcome, MalformedMessageError) else isinstance(outcome, kind)
