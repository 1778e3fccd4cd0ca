"""A record equals the codec's result for every message that the codec accepts, and for no other."""

from __future__ import annotations

import json
from enum import Enum
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import fields
from pydantic import BaseModel

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.records import RECORDED, read_record, record_of
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from nena_shared.vda5050.v3_0 import CODEC as CODEC_3_0
from nena_shared.vda5050.versions import CODECS
from support.examples import MESSAGES
from support.fleet_examples import position, state
from support.messages import messages

EACH_KIND = pytest.mark.parametrize(
    ("codec", "kind"),
    [(codec, kind) for codec in CODECS.values() for kind in RECORDED],
    ids=lambda value: value.version if isinstance(value, Codec) else value.__name__,
)
WORDS = ('"x"', '"INVALID_ORDER"', '"initPosition"', '"TEACHIN"', '"AUTOACK"', '"2026-01-01T01:00:00+01:00"')
VALUES = st.sampled_from((*WORDS, "null", "true", "-1", "0.5", "[]", "{}", "1e400", "NaN", '"\\ud800"'))


def same(record: object, full: object) -> bool:
    """Return whether a record, or a value in it, equals that of the full message."""
    if isinstance(record, Struct):
        return isinstance(full, BaseModel) and all(
            same(getattr(record, each), getattr(full, each)) for each in common_fields(type(record), full)
        )
    if isinstance(record, tuple):
        return isinstance(full, tuple) and len(record) == len(full) and all(map(same, record, full))
    return (isinstance(record, Enum), record) == (isinstance(full, Enum), full)


def common_fields(form: type[Struct], full: BaseModel) -> list[str]:
    """Return the fields of a message; its record has them all and no others."""
    names = list(type(full).model_fields)
    members = {each.name for each in fields(form) if not each.name.startswith("other_")}
    assert members <= set(names)
    assert all(hasattr(form, each) for each in names)
    return names


def check(codec: Codec, kind: type[Any], payload: bytes) -> None:
    try:
        full: Header = codec.decode(kind, payload)
    except MalformedMessageError:
        with pytest.raises(MalformedMessageError):
            read_record(kind, codec, payload)
    else:
        assert same(read_record(kind, codec, payload), full)


@EACH_KIND
@settings(max_examples=MESSAGES)
@given(st.data())
def test_record_equals_the_message_of_the_codec(codec: Codec, kind: Any, data: st.DataObject) -> None:
    check(codec, kind, codec.encode(data.draw(messages(kind))))


@EACH_KIND
@settings(max_examples=MESSAGES)
@given(st.data())
def test_a_message_of_another_version_is_read_or_refused_as_by_the_codec(
    codec: Codec, kind: Any, data: st.DataObject
) -> None:
    other = data.draw(st.sampled_from(list(CODECS.values())))
    number = f'"{codec.version}"'.encode()
    payload = other.encode(data.draw(messages(kind)))
    check(codec, kind, payload)
    check(codec, kind, payload.replace(f'"{other.version}"'.encode(), number))


@EACH_KIND
@settings(max_examples=2 * MESSAGES)
@given(st.data())
def test_inserted_values_are_accepted_as_by_the_codec(codec: Codec, kind: Any, data: st.DataObject) -> None:
    text = codec.encode(data.draw(messages(kind))).decode()
    ends = [at for at, sign in enumerate(text) if sign == ":" and text[at - 1] == '"']
    start = data.draw(st.sampled_from(ends)) + 1
    end = min(at for at in (text.find(",", start), text.find("}", start)) if at > 0)
    check(codec, kind, (text[:start] + data.draw(VALUES) + text[end:]).encode())


def test_a_message_that_is_too_long_is_refused() -> None:
    payload = CODEC_2_1.encode(state())
    with pytest.raises(MalformedMessageError, match="longer than"):
        read_record(State, CODEC_2_1, payload + b" " * MAXIMUM_PAYLOAD)


def test_parameters_have_their_neutral_names() -> None:
    reference = {"reference_key": "parameter", "reference_value": "order.edges.maximumSpeed"}
    error = {"error_type": "orderError", "error_level": "WARNING", "error_references": (reference,)}
    payload = CODEC_2_1.encode(state(errors=(error,)))
    assert b"order.edges.maxSpeed" in payload
    (entry,) = read_record(State, CODEC_2_1, payload).errors
    assert entry.error_references[0].reference_value == "order.edges.maximumSpeed"


def test_a_trajectory_without_degree_and_knots_is_filled_in() -> None:
    points = ({"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0})
    edge = {"edge_id": "e", "sequence_id": 1, "released": True, "trajectory": {"control_points": points}}
    payload = CODEC_2_1.encode(state(edge_states=(edge,)))
    bare = payload.replace(b'"degree":1,', b"").replace(b'"knotVector":[0.0,0.0,1.0,1.0],', b"")
    assert len(bare) < len(payload)
    trajectory = read_record(State, CODEC_2_1, bare).edge_states[0].trajectory
    assert trajectory is not None
    assert (trajectory.degree, trajectory.knot_vector) == (1, (0.0, 0.0, 1.0, 1.0))


def test_an_older_name_of_an_action_alone_is_read_as_the_newer_one() -> None:
    action = {"action_id": "a", "action_type": "initializePosition", "action_status": "RUNNING"}
    record = read_record(State, CODEC_2_1, CODEC_2_1.encode(state(action_states=(action,))))
    assert record.action_states[0].action_type == "initializePosition"


def test_unused_fields_are_validated_too() -> None:
    trajectory = {"control_points": ({"x": 0.0, "y": 0.0, "weight": 0.5}, {"x": 1.0, "y": 0.0})}
    payload = CODEC_3_0.encode(state(planned_path={"trajectory": trajectory}))
    assert read_record(State, CODEC_3_0, payload).header_id == 1
    with pytest.raises(MalformedMessageError, match="weight"):
        read_record(State, CODEC_3_0, payload.replace(b'"weight":0.5', b'"weight":0.0'))


@EACH_KIND
@settings(max_examples=20)
@given(st.data())
def test_parsed_message_yields_the_same_record(codec: Codec, kind: Any, data: st.DataObject) -> None:
    payload = codec.encode(data.draw(messages(kind)))
    record = record_of(kind, codec, json.loads(payload))
    assert record is None or same(record, codec.decode(kind, payload))


def test_nan_and_infinity_yield_no_record() -> None:
    content = json.loads(
        CODEC_2_1.encode(state(mobile_robot_position=position(1.0, 2.0), velocity={"vx": 1.0}))
    )
    assert record_of(State, CODEC_2_1, content) is not None
    for place, name in ((content["velocity"], "vx"), (content["agvPosition"], "theta")):
        for value in (nan, inf, -inf):
            right, place[name] = place[name], value
            assert record_of(State, CODEC_2_1, content) is None
            place[name] = right
