"""The table of differences agrees with the codecs of the versions."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Any

import pytest

from nena_shared.vda5050.action import Action, ActionParameter, ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType, error
from nena_shared.vda5050.order import Node, Order
from nena_shared.vda5050.state import Map, MapStatus, OperatingMode, State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.versions import CODECS, RULES
from support.expressible import EXPRESSIBLE

EACH_VERSION = pytest.mark.parametrize("version", CODECS)


@pytest.fixture
def neutral(state: dict[str, Any]) -> State:
    """Return the smallest state, as a neutral message."""
    return CODEC.decode(State, json.dumps(state).encode())


def arrived(version: str, state: State) -> State:
    codec = CODECS[version]
    return codec.decode(State, codec.encode(state))


def kept(values: type[StrEnum], told: list[StrEnum]) -> frozenset[StrEnum]:
    """Return the values that arrived as they were sent."""
    return frozenset(value for value, other in zip(values, told, strict=True) if value is other)


@pytest.mark.clause("6.6.6/STARTUP")
@EACH_VERSION
def test_operating_modes(version: str, neutral: State) -> None:
    told = [
        arrived(version, neutral.model_copy(update={"operating_mode": mode})).operating_mode
        for mode in OperatingMode
    ]

    assert kept(OperatingMode, list(told)) == EXPRESSIBLE[version].operating_modes


@pytest.mark.clause("6.6.9", "6.6.9/retriable")
@EACH_VERSION
def test_action_statuses(version: str, neutral: State) -> None:
    states = tuple(ActionState(action_id=each, action_status=each) for each in ActionStatus)
    told = arrived(version, neutral.model_copy(update={"action_states": states}))

    assert (
        kept(ActionStatus, [each.action_status for each in told.action_states])
        == RULES[version].action_statuses
    )


@pytest.mark.clause("6.6.5.4", "6.6.5.1")
@EACH_VERSION
def test_names_and_levels_of_errors(version: str, neutral: State) -> None:
    errors = tuple(error(kind, "why") for kind in ErrorType)
    own = tuple(
        errors[0].model_copy(update={"error_type": "own", "error_level": level}) for level in ErrorLevel
    )
    told = arrived(version, neutral.model_copy(update={"errors": (*errors, *own)})).errors

    names = {kind: each.error_type for kind, each in zip(ErrorType, told, strict=False)}
    assert names == EXPRESSIBLE[version].error_names
    levels = [each.error_level for each in told[len(errors) :]]
    assert kept(ErrorLevel, list(levels)) == EXPRESSIBLE[version].error_levels


@pytest.mark.clause("6.6.9/instant")
@EACH_VERSION
def test_array_of_instant_action_states_by_version(version: str, neutral: State) -> None:
    instant = (ActionState(action_id="i", action_status=ActionStatus.RUNNING),)
    told = arrived(version, neutral.model_copy(update={"instant_action_states": instant}))

    apart, among = told.instant_action_states, told.action_states
    assert [bool(apart), bool(among)] == (
        [True, False] if EXPRESSIBLE[version].instant_states_apart else [False, True]
    )


@pytest.mark.clause("6.3")
@EACH_VERSION
def test_maps(version: str, neutral: State) -> None:
    maps = (Map(map_id="m", map_version="1", map_status=MapStatus.ENABLED),)
    told = arrived(version, neutral.model_copy(update={"maps": maps}))

    assert bool(told.maps) is RULES[version].maps


@pytest.mark.clause("4.3")
@EACH_VERSION
def test_zones(version: str) -> None:
    assert (Topic.ZONE_SET in CODECS[version].kinds) is RULES[version].zones
    assert (Topic.RESPONSES in CODECS[version].kinds) is RULES[version].zones


@pytest.mark.clause("6.2.2/single", "6.1.3/named")
@EACH_VERSION
def test_blocking_types_and_the_name_of_the_cancelled_order(version: str, order: dict[str, Any]) -> None:
    actions = tuple(
        Action(
            action_type="cancelOrder",
            action_id=each,
            blocking_type=each,
            action_parameters=(ActionParameter(key="orderId", value="o1"),),
        )
        for each in BlockingType
    )
    message = CODEC.decode(Order, json.dumps(order).encode())
    nodes = (Node(node_id="A", sequence_id=0, released=True, actions=actions),)
    codec = CODECS[version]
    told = codec.decode(Order, codec.encode(message.model_copy(update={"nodes": nodes, "edges": ()})))

    arrived_actions = told.nodes[0].actions
    assert (
        kept(BlockingType, [each.blocking_type for each in arrived_actions])
        == EXPRESSIBLE[version].blocking_types
    )
    named = [each.parameter("orderId") for each in arrived_actions]
    assert named == ["o1" if RULES[version].cancel_names_order else None] * len(BlockingType)


@pytest.mark.clause("7.7")
@EACH_VERSION
def test_connection_states(version: str, neutral: State) -> None:
    header = neutral.model_dump(include={"header_id", "timestamp", "manufacturer", "serial_number"})
    codec = CODECS[version]
    told = [
        codec.decode(
            Connection, codec.encode(Connection(**header, version=version, connection_state=each))
        ).connection_state
        for each in ConnectionState
    ]

    assert kept(ConnectionState, list(told)) == EXPRESSIBLE[version].connection_states


@pytest.mark.parametrize(("version", "strict"), [("2.0.0", False), ("2.1.0", False), ("3.0.0", True)])
def test_only_3_0_is_strict_about_updates(version: str, *, strict: bool) -> None:
    rules = RULES[version]

    assert rules.first_update_id_is_zero is strict
    assert rules.equal_update_id_compared is strict
    assert rules.stitching_node_repeated is strict
    assert rules.instant_states_until_cleared is strict
