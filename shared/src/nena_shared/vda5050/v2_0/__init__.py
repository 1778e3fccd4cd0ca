"""VDA 5050 2.0.0: 2.1.0 without its additions."""

from dataclasses import replace

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_0.messages import FactsheetV20, OrderV20, StateV20, VisualizationV20
from nena_shared.vda5050.v2_1 import RULES
from nena_shared.vda5050.v2_1.order import InstantActionsV21
from nena_shared.vda5050.v2_1.state import ConnectionV21
from nena_shared.vda5050.visualization import Visualization

CODEC = Codec(
    version="2.0.0",
    interface_name="uagv",
    forms={
        Order: OrderV20,
        InstantActions: InstantActionsV21,
        State: StateV20,
        Visualization: VisualizationV20,
        Connection: ConnectionV21,
        Factsheet: FactsheetV20,
    },
    rules=replace(RULES, maps=False),
)
