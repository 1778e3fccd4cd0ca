"""Fleet control: the side of VDA 5050 that sends orders and reads states (3.0 section 6).

The core is pure: messages and the time, in monotonic seconds, go in; messages to send and events come out.
"""

from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.failures import FailureKind, RobotBusyError
from nena_order_service.fleet.instant_actions import retry_or_skip
from nena_order_service.fleet.link import FleetLink, RobotAddresses
from nena_order_service.fleet.outputs import (
    ActionRetriable,
    BaseWanted,
    FleetOutput,
    InstantActionEnded,
    NodePassed,
    OperationStarted,
    Outputs,
    PublishInstantActions,
    PublishOrder,
    PublishResponses,
    RobotChanged,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.position import NotLocatedError, RobotProfile, Standing, locate
from nena_order_service.fleet.robot import Availability, LinkStatus, RobotView, VdaOrderPhase
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import (
    BaseChangedError,
    OperationMap,
    VdaOrder,
    build_vda_order,
    order_id,
)

__all__ = [
    "ActionRetriable",
    "Availability",
    "BaseChangedError",
    "BaseWanted",
    "FailureKind",
    "FleetController",
    "FleetLink",
    "FleetOutput",
    "FleetSettings",
    "InstantActionEnded",
    "LinkStatus",
    "NodePassed",
    "NotLocatedError",
    "OperationMap",
    "OperationStarted",
    "Outputs",
    "PublishInstantActions",
    "PublishOrder",
    "PublishResponses",
    "RobotAddresses",
    "RobotBusyError",
    "RobotChanged",
    "RobotProfile",
    "RobotView",
    "Standing",
    "VdaOrder",
    "VdaOrderAccepted",
    "VdaOrderCancelled",
    "VdaOrderFailed",
    "VdaOrderFinished",
    "VdaOrderPhase",
    "build_vda_order",
    "locate",
    "order_id",
    "retry_or_skip",
]
