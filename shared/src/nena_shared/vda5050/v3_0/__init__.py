"""VDA 5050 3.0.0: the neutral messages, but for spellings that are read besides the right ones."""

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v3_0.connection import ConnectionV30
from nena_shared.vda5050.v3_0.factsheet import FactsheetV30
from nena_shared.vda5050.v3_0.instant_actions import InstantActionsV30
from nena_shared.vda5050.v3_0.order import OrderV30
from nena_shared.vda5050.v3_0.responses import ResponsesV30
from nena_shared.vda5050.v3_0.rules import RULES
from nena_shared.vda5050.v3_0.state import StateV30
from nena_shared.vda5050.v3_0.visualization import VisualizationV30
from nena_shared.vda5050.v3_0.zone_set import ZoneSetTransferV30
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.zone_set import ZoneSetTransfer

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
