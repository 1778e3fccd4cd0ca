"""VDA 5050 3.0.0: the neutral messages, with additional spellings that are accepted."""

from __future__ import annotations

from typing import Final

from nena_shared.vda5050.action import ActionStatus, InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.v3_0.messages import (
    ConnectionV30,
    FactsheetV30,
    InstantActionsV30,
    OrderV30,
    ResponsesV30,
    StateV30,
    VisualizationV30,
    ZoneSetTransferV30,
)
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.zone_set import ZoneSetTransfer

RULES: Final = Rules(
    action_statuses=frozenset(ActionStatus),
    instant_states_until_cleared=True,
    first_update_id_is_zero=True,
    equal_update_id_compared=True,
    stitching_node_repeated=True,
    cancel_names_order=True,
    trigger_by_action=True,
    maps=True,
    zones=True,
    hibernation=True,
    # 6.1.2 has no type for it
    wrong_stitching_node=ErrorType.VALIDATION_FAILURE,
    # 6.6.7 keeps lastNodeId when an order is cleared; table 10 of 6.6.6, which names the modes, empties it
    node_forgotten_in=frozenset({OperatingMode.STARTUP, OperatingMode.SERVICE, OperatingMode.TEACH_IN}),
    # table 10: a person may drive the robot anywhere, but its node is right until it leaves
    node_left_in=frozenset({OperatingMode.MANUAL}),
)
"""Rules of this version."""

CODEC = Codec(
    version="3.0.0",
    interface_name="vda5050",
    forms={
        Order: OrderV30,
        InstantActions: InstantActionsV30,
        State: StateV30,
        Visualization: VisualizationV30,
        Connection: ConnectionV30,
        Factsheet: FactsheetV30,
        ZoneSetTransfer: ZoneSetTransferV30,
        Responses: ResponsesV30,
    },
    rules=RULES,
)
