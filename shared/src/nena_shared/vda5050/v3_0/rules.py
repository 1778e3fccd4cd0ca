"""What 3.0 can say, and what it means by it."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.action import ActionStatus, BlockingType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import OperatingMode

RULES: Final = Rules(
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
    wrong_stitching_node=ErrorType.VALIDATION_FAILURE,
    node_forgotten_in=frozenset({OperatingMode.STARTUP, OperatingMode.SERVICE, OperatingMode.TEACH_IN}),
    node_left_in=frozenset({OperatingMode.MANUAL}),
)
