"""What the versions of VDA 5050 ask of both sides beyond the form of their messages: one row per version.

The codecs know how a version says something; this table knows what it can say, and what it means by it. Data
only: who acts differently by version reads it here, and asks for no version number anywhere. Where the
strictest version's behaviour is allowed in all of them, it is done in all of them and there is no column.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.action import ActionStatus, BlockingType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.v2_1.error_type import WRITTEN


@dataclass(frozen=True, slots=True)
class Rules:
    """How one version decides where the others decide differently; section numbers are those of 3.0."""

    blocking_types: frozenset[BlockingType]
    action_statuses: frozenset[ActionStatus]
    error_levels: frozenset[ErrorLevel]
    operating_modes: frozenset[OperatingMode]
    connection_states: frozenset[ConnectionState]
    error_names: Mapping[ErrorType, str]
    """What each type of error is called on the wire (section 6.6.5.4)."""
    instant_states_apart: bool
    """Instant actions are reported in an array of their own, else among the order's actions."""
    instant_states_until_cleared: bool
    """Their ended states stay until clearInstantActions, else until the next order is accepted."""
    first_update_id_is_zero: bool
    """A new order begins with orderUpdateId 0; one with another number is refused (section 6.1.1)."""
    equal_update_id_compared: bool
    """An update with the held number is refused if it says something else, else always dropped silently."""
    stitching_node_repeated: bool
    """An update repeats the decision point unchanged and in full, else only its id and number count."""
    cancel_names_order: bool
    """cancelOrder may name the order that it is for."""
    trigger_by_action: bool
    """Fleet control releases an action that waits for a trigger by an instant action (section 6.2.3)."""
    maps: bool
    """A robot reports its maps and changes them by actions (section 6.3)."""
    zones: bool
    """There are zone sets, requests and responses (sections 6.4 and 6.9)."""


_V2_1: Final = Rules(
    blocking_types=frozenset({BlockingType.NONE, BlockingType.SOFT, BlockingType.HARD}),
    action_statuses=frozenset(ActionStatus) - {ActionStatus.RETRIABLE},
    error_levels=frozenset({ErrorLevel.WARNING, ErrorLevel.FATAL}),
    operating_modes=frozenset(OperatingMode) - {OperatingMode.STARTUP, OperatingMode.INTERVENED},
    connection_states=frozenset(ConnectionState) - {ConnectionState.HIBERNATING},
    error_names=MappingProxyType({kind: WRITTEN[kind] for kind in ErrorType}),
    instant_states_apart=False,
    instant_states_until_cleared=False,
    first_update_id_is_zero=False,
    equal_update_id_compared=False,
    stitching_node_repeated=False,
    cancel_names_order=False,
    trigger_by_action=False,
    maps=True,
    zones=False,
)

RULES: Final[Mapping[str, Rules]] = MappingProxyType(
    {
        "2.0.0": replace(_V2_1, maps=False),
        "2.1.0": _V2_1,
        "3.0.0": Rules(
            blocking_types=frozenset(BlockingType),
            action_statuses=frozenset(ActionStatus),
            error_levels=frozenset(ErrorLevel),
            operating_modes=frozenset(OperatingMode),
            connection_states=frozenset(ConnectionState),
            error_names=MappingProxyType({kind: kind.value for kind in ErrorType}),
            instant_states_apart=True,
            instant_states_until_cleared=True,
            first_update_id_is_zero=True,
            equal_update_id_compared=True,
            stitching_node_repeated=True,
            cancel_names_order=True,
            trigger_by_action=True,
            maps=True,
            zones=True,
        ),
    }
)
"""By version number."""
