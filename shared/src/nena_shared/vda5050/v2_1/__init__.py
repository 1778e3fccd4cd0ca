"""VDA 5050 2.1.0: where its messages differ from the neutral ones."""

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1.connection import ConnectionV21
from nena_shared.vda5050.v2_1.factsheet import FactsheetV21
from nena_shared.vda5050.v2_1.instant_actions import InstantActionsV21
from nena_shared.vda5050.v2_1.order import OrderV21
from nena_shared.vda5050.v2_1.rules import RULES
from nena_shared.vda5050.v2_1.state import StateV21
from nena_shared.vda5050.v2_1.visualization import VisualizationV21
from nena_shared.vda5050.visualization import Visualization

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
