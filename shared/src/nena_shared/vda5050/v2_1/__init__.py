"""VDA 5050 2.1.0: messages that differ from the neutral ones."""

from __future__ import annotations

from typing import Final

from nena_shared.vda5050.action import ActionStatus, InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1.factsheet import FactsheetV21
from nena_shared.vda5050.v2_1.order import InstantActionsV21, OrderV21
from nena_shared.vda5050.v2_1.state import ConnectionV21, StateV21, VisualizationV21
from nena_shared.vda5050.visualization import Visualization

RULES: Final = Rules(
    # retries, clearInstantActions, the instant action "trigger", zones and hibernation came with 3.0
    action_statuses=frozenset(ActionStatus) - {ActionStatus.RETRIABLE},
    instant_states_until_cleared=False,
    first_update_id_is_zero=False,
    equal_update_id_compared=False,
    stitching_node_repeated=False,
    cancel_names_order=False,
    trigger_by_action=False,
    maps=True,  # 2.1, 6.7
    zones=False,
    hibernation=False,
    # 2.1, 6.6.4: one type for all updates that do not fit
    wrong_stitching_node=ErrorType.OUTDATED_ORDER_UPDATE,
)
"""Rules of this version."""

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
