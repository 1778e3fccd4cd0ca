"""What 2.1 can say, and what it means by it."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.action import ActionStatus, BlockingType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.v2_1.error_type import WRITTEN

RULES: Final = Rules(
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
    wrong_stitching_node=ErrorType.OUTDATED_ORDER_UPDATE,
)
