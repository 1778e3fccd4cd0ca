from __future__ import annotations

import pytest

from nena_shared.vda5050 import message_reader as reader
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_0 import CODEC as CODEC_2_0
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from support.fleet_examples import state

TOPIC = "uagv/v2/ACME/r1/state"


def decode(codec: Codec, payload: bytes) -> State:
    return codec.decode(State, payload)


def test_a_robot_may_change_its_version_at_any_message() -> None:
    messages = MessageReader()
    for codec in (CODEC_2_1, CODEC_2_1, CODEC_2_0, CODEC_2_0, CODEC_2_1):
        payload = codec.encode(state(last_node_id="A"))
        message = messages.read(decode, TOPIC, payload, "v2")
        assert (message.version, message.last_node_id) == (codec.version, "A")


def test_a_bad_message_says_what_is_wrong_and_the_next_one_is_read() -> None:
    messages = MessageReader()
    good = CODEC_2_1.encode(state())
    messages.read(decode, TOPIC, good, "v2")
    with pytest.raises(MalformedMessageError, match="headerId"):
        messages.read(decode, TOPIC, good.replace(b'"headerId":1', b'"headerId":-1'), "v2")
    with pytest.raises(MalformedMessageError, match="version"):
        messages.read(decode, TOPIC, good.replace(b'"2.1.0"', b'"3.0.0"'), "v2")
    assert messages.read(decode, TOPIC, good, "v2").header_id == 1


def test_only_so_many_topics_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "TOPICS_REMEMBERED", 3)
    messages = MessageReader()
    for number in range(10):
        messages.read(decode, f"{TOPIC}{number}", CODEC_2_1.encode(state()), "v2")
    assert len(messages._known) <= 3
