"""What the messages of each version of VDA 5050 can express, as the standard's sections define it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.v2_1.state import WRITTEN
from nena_shared.vda5050.versions import CODECS


@dataclass(frozen=True, slots=True)
class Expressible:
    """The values that arrive as they were sent, and how errors are named."""

    blocking_types: frozenset[BlockingType]
    error_levels: frozenset[ErrorLevel]
    operating_modes: frozenset[OperatingMode]
    connection_states: frozenset[ConnectionState]
    error_names: Mapping[ErrorType, str]
    """What each type of error is called on the wire (section 6.6.5.4)."""
    instant_states_apart: bool
    """Instant actions are reported in an array of their own, else among the order's actions."""


_IN_2 = Expressible(
    blocking_types=frozenset(BlockingType) - {BlockingType.SINGLE},
    error_levels=frozenset({ErrorLevel.WARNING, ErrorLevel.FATAL}),
    operating_modes=frozenset(OperatingMode) - {OperatingMode.STARTUP, OperatingMode.INTERVENED},
    connection_states=frozenset(ConnectionState) - {ConnectionState.HIBERNATING},
    error_names={kind: WRITTEN[kind] for kind in ErrorType},
    instant_states_apart=False,
)
_IN_3 = Expressible(
    blocking_types=frozenset(BlockingType),
    error_levels=frozenset(ErrorLevel),
    operating_modes=frozenset(OperatingMode),
    connection_states=frozenset(ConnectionState),
    error_names={kind: kind.value for kind in ErrorType},
    instant_states_apart=True,
)
EXPRESSIBLE = {version: _IN_2 if version.startswith("2.") else _IN_3 for version in CODECS}
