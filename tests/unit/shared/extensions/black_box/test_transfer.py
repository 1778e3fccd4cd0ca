"""Chunks and answers: what is read, and how the sender follows the receiver."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.extensions.black_box.transfer import (
    LARGEST_CHUNK,
    Answer,
    BadChunkError,
    Transfer,
    Verdict,
    read_chunk,
)

NAME, SHA = "20260102T030405.678Z-request.mcap", "0" * 64


def transfer(size: int = 100) -> Transfer:
    return Transfer(NAME, size, SHA)


def answer(received: int, verdict: Verdict = Verdict.MORE, name: str = NAME) -> Answer:
    return Answer(name=name, verdict=verdict, received=received)


def test_a_chunk_is_read_as_it_was_sent() -> None:
    sent = transfer().chunk(b"\n\0binary\n")

    assert read_chunk(sent.encode()) == sent


def head(**changes: Any) -> bytes:
    return json.dumps({"name": NAME, "size": 100, "sha256": SHA, "offset": 0} | changes).encode() + b"\n"


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "header"),
        (b"{}\nx", "name"),
        (b"\xff\xfe\nx", "header"),
        (head(name="../../etc/passwd") + b"x", "not a file name"),
        (head(name=f"{NAME}/x") + b"x", "not a file name"),
        (head(size=0) + b"x", "size"),
        (head(size=10**12) + b"x", "size"),
        (head(offset=-1) + b"x", "offset"),
        (head(sha256="no") + b"x", "sha256"),
        (head(), "do not fit"),
        (head(offset=99) + b"xx", "do not fit"),
        (head() + bytes(LARGEST_CHUNK), "exceeds the limit"),
    ],
)
def test_other_payloads_are_refused_with_the_reason(payload: bytes, reason: str) -> None:
    with pytest.raises(BadChunkError, match=reason):
        read_chunk(payload)


@given(st.binary(max_size=300))
def test_no_payload_does_more_harm_than_being_refused(payload: bytes) -> None:
    with pytest.raises(BadChunkError):
        read_chunk(payload)


def test_the_sender_continues_where_the_receiver_is() -> None:
    sender = transfer()
    assert sender.take(answer(30))
    assert sender.offset == 30
    assert sender.take(answer(10))  # the receiver has lost a part
    assert sender.offset == 10
    assert sender.take(answer(100, Verdict.COMPLETE))
    assert sender.end == answer(100, Verdict.COMPLETE)


@pytest.mark.parametrize(
    "ignored",
    [answer(30), answer(40, name="other.mcap"), answer(100), answer(5000)],
    ids=["repeated", "another file", "at the end", "beyond the end"],
)
def test_other_answers_change_nothing(ignored: Answer) -> None:
    sender = transfer()
    sender.take(answer(30))

    assert not sender.take(ignored)
    assert (sender.offset, sender.end) == (30, None)


def test_after_the_end_nothing_is_due() -> None:
    sender = transfer()
    assert sender.take(answer(0, Verdict.REFUSED))
    assert not sender.take(answer(30))
