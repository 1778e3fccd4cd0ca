"""VDA 5050 2.1.0: where its messages differ from the neutral ones."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.action import ActionStatus, BlockingType, InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.v2_1.factsheet import FactsheetV21
from nena_shared.vda5050.v2_1.order import InstantActionsV21, OrderV21
from nena_shared.vda5050.v2_1.state import WRITTEN, ConnectionV21, StateV21, VisualizationV21
from nena_shared.vda5050.visualization import Visualization

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
"""What this version can say, and what it means by it."""

CODEC = Codec(
    version="2.1.0",
    interface_name="uagv",
    forms={
        Order: OrderV21,
        InstantActions: InstantActionsV21,
        State: StateV21,
        Visualization: VisualizationV21,
        Connection: ConnectionV21,
        Factsheet: FactsheetV21,
    },
    rules=RULES,
)
