from __future__ import annotations

import json
from datetime import UTC, datetime
from math import pi
from typing import Any

import pytest

from nena_shared.vda5050 import message_reader as reader
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import DEVIATIONS_REMEMBERED, MessageReader
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_0 import CODEC as CODEC_2_0
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from support.fleet_examples import state

TOPIC = "uagv/v2/ACME/r1/state"


def test_a_robot_may_change_its_version_at_any_message() -> None:
    messages = MessageReader()
    for codec in (CODEC_2_1, CODEC_2_1, CODEC_2_0, CODEC_2_0, CODEC_2_1):
        payload = codec.encode(state(last_node_id="A"))
        message = messages.read(State, TOPIC, payload, "v2")
        assert (message.version, message.last_node_id) == (codec.version, "A")


def test_malformed_message_is_explained_and_the_next_one_is_read() -> None:
    messages = MessageReader(strict=True)
    good = CODEC_2_1.encode(state())
    messages.read(State, TOPIC, good, "v2")
    with pytest.raises(MalformedMessageError, match="headerId"):
        messages.read(State, TOPIC, good.replace(b'"headerId":1', b'"headerId":-1'), "v2")
    with pytest.raises(MalformedMessageError, match="version"):
        messages.read(State, TOPIC, good.replace(b'"2.1.0"', b'"3.0.0"'), "v2")
    assert messages.read(State, TOPIC, good, "v2").header_id == 1


def test_only_so_many_topics_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "TOPICS_REMEMBERED", 3)
    messages = MessageReader()
    for number in range(10):
        messages.read(State, f"{TOPIC}{number}", CODEC_2_1.encode(state()), "v2")
    assert len(messages._readers) <= 3


def test_a_message_that_deviates_is_repaired_and_reported_until_it_is_right_again() -> None:
    reports: list[tuple[str, tuple[Repair, ...]]] = []
    messages = MessageReader(lambda topic, repairs: reports.append((topic, repairs)))
    good = CODEC_2_1.encode(state())
    bad = good.replace(b'"headerId":1', b'"headerId":"1"')
    worse = bad.replace(b'"batteryCharge":80.0', b'"batteryCharge":101.3')
    for payload in (good, bad, worse, bad, good):
        assert messages.read(State, TOPIC, payload, "v2").header_id == 1
    number = Repair("headerId", RepairKind.TEXT_AS_NUMBER, '"1"')
    charge = Repair("batteryState.batteryCharge", RepairKind.CLAMPED, "101.3")
    assert reports == [(TOPIC, (number,)), (TOPIC, (number, charge)), (TOPIC, (number,))]


@pytest.mark.parametrize("charge", [b"101.3", b"NaN"])
def test_recent_deviations_are_repaired_without_checking_the_whole_message(
    charge: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = MessageReader()
    good = CODEC_2_1.encode(state())
    payloads = (
        good,
        good.replace(b'"batteryCharge":80.0', b'"batteryCharge":' + charge),
        good.replace(b'"headerId":1', b'"headerId":"1"'),
    )
    for payload in payloads:
        messages.read(State, TOPIC, payload, "v2")
    monkeypatch.setattr(reader, "parse", None)
    for payload in payloads:
        assert messages.read(State, TOPIC, payload, "v2").header_id == 1


def test_a_deviation_that_ended_is_forgotten_while_another_one_lasts() -> None:
    messages = MessageReader()
    lasting = CODEC_2_1.encode(state()).replace(b'"headerId":1', b'"headerId":"1"')
    for charge in (b"80.0", b"101.3"):
        payload = lasting.replace(b'"batteryCharge":80.0', b'"batteryCharge":' + charge)
        messages.read(State, TOPIC, payload, "v2")
    assert messages._readers[TOPIC].deviations == {"headerId", "batteryState.batteryCharge"}
    for _ in range(DEVIATIONS_REMEMBERED):
        messages.read(State, TOPIC, lasting, "v2")
    assert messages._readers[TOPIC].deviations == {"headerId"}
    for _ in range(2 * DEVIATIONS_REMEMBERED):
        messages.read(State, TOPIC, CODEC_2_1.encode(state()), "v2")
    assert not messages._readers[TOPIC].deviations


def test_a_robot_that_deviates_may_change_its_version() -> None:
    messages = MessageReader()
    for codec in (CODEC_2_1, CODEC_2_0, CODEC_2_1):
        payload = codec.encode(state(maps=({"map_id": "m", "map_version": "1", "map_status": "ENABLED"},)))
        payload = payload.replace(b'"headerId":1', b'"headerId":"1","maps":[]')
        message = messages.read(State, TOPIC, payload, "v2")
        assert (message.version, message.maps is None) == (codec.version, codec is CODEC_2_0)


def test_refusal_names_only_unrepairable_values() -> None:
    payload = CODEC_2_1.encode(state()).replace(b'"orderId":""', b'"orderId":[]')
    broken = payload.replace(b'"batteryCharge":80.0', b'"batteryCharge":101.3')
    with pytest.raises(MalformedMessageError) as caught:
        MessageReader().read(State, TOPIC, broken, "v2")
    assert caught.value.reason == "orderId: Input should be a valid string (received [])"


def test_an_unknown_minor_version_is_read_as_the_nearest_and_reported_once() -> None:
    reports: list[Repair] = []
    messages = MessageReader(lambda _, repairs: reports.extend(repairs))
    payload = CODEC_2_1.encode(state()).replace(b'"2.1.0"', b'"2.7.0"')
    for _ in range(3):
        assert messages.read(State, TOPIC, payload, "v2").version == "2.7.0"
    assert reports == [Repair("version", RepairKind.UNKNOWN_VERSION, "2.7.0, read as 2.1.0")]


def test_a_command_is_repaired_only_where_its_meaning_is_certain(order: dict[str, Any]) -> None:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    order["nodes"][1]["sequenceId"] = 2.0
    order["nodes"][1]["nodePosition"]["theta"] = 3.2
    read, repairs = read_command(Order, CODEC_2_1, json.dumps(order).encode(), now=now)
    assert read.nodes[1].sequence_id == 2
    assert {each.kind for each in repairs} == {RepairKind.WHOLE_NUMBER, RepairKind.ANGLE_WRAPPED}
    for unsafe in ({"maxSpeed": -1.0}, {"maxSpeed": "fast"}, {"released": None}):
        edges = [order["edges"][0] | unsafe]
        with pytest.raises(MalformedMessageError):
            read_command(Order, CODEC_2_1, json.dumps(order | {"edges": edges}).encode(), now=now)


@pytest.mark.clause("7.3/deviation")
@pytest.mark.parametrize(("given", "meant"), [(-0.1, 0.0), (6.28, pi)])
def test_a_deviation_beyond_a_half_turn_allows_every_heading_and_one_below_0_none(
    order: dict[str, Any], given: float, meant: float
) -> None:
    order["nodes"][1]["nodePosition"]["allowedDeviationTheta"] = given
    read, repairs = read_command(
        Order, CODEC_2_1, json.dumps(order).encode(), now=datetime(2026, 1, 1, tzinfo=UTC)
    )
    assert read.nodes[1].node_position is not None
    assert read.nodes[1].node_position.allowed_deviation_theta == meant
    assert [each.kind for each in repairs] == [RepairKind.CLAMPED]


@pytest.mark.parametrize("given", [10, 180.0, -90.0])
def test_deviation_beyond_a_full_turn_is_refused(order: dict[str, Any], given: float) -> None:
    order["nodes"][1]["nodePosition"]["allowedDeviationTheta"] = given
    with pytest.raises(MalformedMessageError):
        read_command(Order, CODEC_2_1, json.dumps(order).encode(), now=datetime(2026, 1, 1, tzinfo=UTC))


def test_refused_command_is_quoted_as_sent(order: dict[str, Any]) -> None:
    payload = json.dumps(order | {"headerId": "7", "orderId": 5, "nodes": None}).encode()
    with pytest.raises(MalformedMessageError) as strict:
        CODEC_2_1.decode(Order, payload)
    with pytest.raises(MalformedMessageError) as tolerant:
        read_command(Order, CODEC_2_1, payload, now=datetime(2026, 1, 1, tzinfo=UTC))
    assert tolerant.value.problems == strict.value.problems


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999", "9" * 400])
@pytest.mark.parametrize("field", ["x", "y", "theta"])
def test_position_with_nan_is_omitted_despite_other_usual_deviations(field: str, value: str) -> None:
    messages = MessageReader()
    turned = json.loads(CODEC_2_1.encode(state()))
    position = {"x": 1.0, "y": 2.0, "theta": 3.2, "mapId": "hall", "positionInitialized": True}
    turned["agvPosition"] = position
    assert messages.read(State, TOPIC, json.dumps(turned).encode(), "v2").mobile_robot_position
    turned["agvPosition"][field] = "HERE"
    payload = json.dumps(turned).replace('"HERE"', value).encode()
    assert messages.read(State, TOPIC, payload, "v2").mobile_robot_position is None


def test_an_integer_beyond_all_floats_is_repaired_or_refused_but_never_breaks_the_reader() -> None:
    messages = MessageReader()
    huge = CODEC_2_1.encode(state()).replace(b'"orderUpdateId":0', b'"orderUpdateId":' + b"9" * 400)
    for _ in range(2):
        assert messages.read(State, TOPIC, huge, "v2").order_update_id == 0
    with_order = huge.replace(b'"orderId":""', b'"orderId":"o1"')
    with pytest.raises(MalformedMessageError, match="orderUpdateId"):
        messages.read(State, TOPIC, with_order, "v2")
