"""A brief says what the codec reads, of every message that the codec takes, and of no other."""

from __future__ import annotations

from enum import Enum
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import fields
from pydantic import BaseModel

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.brief import reader
from nena_shared.vda5050.brief.reader import read_brief
from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_0 import CODEC as CODEC_2_0
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from nena_shared.vda5050.v3_0 import CODEC as CODEC_3_0
from nena_shared.vda5050.versions import CODECS
from support.fleet_examples import position, state, way
from support.messages import messages

KINDS = (StateBrief, VisualizationBrief)
EACH_KIND = pytest.mark.parametrize(
    ("codec", "kind"),
    [(codec, kind) for codec in CODECS.values() for kind in KINDS],
    ids=lambda value: value.version if isinstance(value, Codec) else value.__name__,
)
WORDS = ('"x"', '"INVALID_ORDER"', '"initPosition"', '"TEACHIN"', '"AUTOACK"', '"2026-01-01T01:00:00+01:00"')
VALUES = st.sampled_from((*WORDS, "null", "true", "-1", "0.5", "[]", "{}", "1e400", "NaN", '"\\ud800"'))


def same(brief: object, full: object) -> bool:
    """Tell whether a brief, or a value in it, is what the full message has there."""
    if isinstance(brief, Struct):
        return isinstance(full, BaseModel) and all(
            same(getattr(brief, each), getattr(full, each)) for each in common_fields(type(brief), full)
        )
    if isinstance(brief, tuple):
        return isinstance(full, tuple) and len(brief) == len(full) and all(map(same, brief, full))
    return (isinstance(brief, Enum), brief) == (isinstance(full, Enum), full)


def common_fields(form: type[Struct], full: BaseModel) -> list[str]:
    """Give the fields of a brief; each of them must be one of the full message."""
    names = [each.name for each in fields(form)]
    assert set(names) <= set(type(full).model_fields)
    return names


def full_or_none(codec: Codec, kind: type[Any], payload: bytes) -> Header | None:
    try:
        full: Header = codec.decode(kind.FULL, payload)
    except MalformedMessageError:
        return None
    return full


def check(codec: Codec, kind: type[Any], payload: bytes) -> None:
    full = full_or_none(codec, kind, payload)
    if full is None:
        with pytest.raises(MalformedMessageError):
            read_brief(kind, codec, payload)
    else:
        assert same(read_brief(kind, codec, payload), full)


@EACH_KIND
@settings(max_examples=50)
@given(st.data())
def test_it_says_what_the_codec_reads(codec: Codec, kind: type[Any], data: st.DataObject) -> None:
    check(codec, kind, codec.encode(data.draw(messages(kind.FULL))))


@EACH_KIND
@settings(max_examples=50)
@given(st.data())
def test_a_message_of_another_version_is_read_or_refused_as_by_the_codec(
    codec: Codec, kind: type[Any], data: st.DataObject
) -> None:
    other = data.draw(st.sampled_from(list(CODECS.values())))
    number = f'"{codec.version}"'.encode()
    payload = other.encode(data.draw(messages(kind.FULL)))
    check(codec, kind, payload)
    check(codec, kind, payload.replace(f'"{other.version}"'.encode(), number))


@EACH_KIND
@settings(max_examples=100)
@given(st.data())
def test_what_is_put_into_a_message_is_judged_as_by_the_codec(
    codec: Codec, kind: type[Any], data: st.DataObject
) -> None:
    text = codec.encode(data.draw(messages(kind.FULL))).decode()
    ends = [at for at, sign in enumerate(text) if sign == ":" and text[at - 1] == '"']
    start = data.draw(st.sampled_from(ends)) + 1
    end = min(at for at in (text.find(",", start), text.find("}", start)) if at > 0)
    check(codec, kind, (text[:start] + data.draw(VALUES) + text[end:]).encode())


@pytest.mark.parametrize("codec", [CODEC_2_0, CODEC_2_1, CODEC_3_0], ids=lambda codec: codec.version)
def test_an_ordinary_state_goes_the_short_way(codec: Codec, monkeypatch: pytest.MonkeyPatch) -> None:
    error = {
        "error_type": "noRouteError",
        "error_level": "WARNING",
        "error_references": ({"reference_key": "nodeId", "reference_value": "B"},),
    }
    payload = codec.encode(
        state(**way("A", "B"), mobile_robot_position=position(1.0, 2.0), errors=(error,), paused=False)
    )
    monkeypatch.setattr(reader, "convert", None)
    brief = read_brief(StateBrief, codec, payload)
    assert same(brief, codec.decode(State, payload))
    assert [each.node_id for each in brief.node_states] == ["A", "B"]


def test_a_message_that_is_too_long_is_refused() -> None:
    payload = CODEC_2_1.encode(state())
    with pytest.raises(MalformedMessageError, match="longer than"):
        read_brief(StateBrief, CODEC_2_1, payload + b" " * MAXIMUM_PAYLOAD)
