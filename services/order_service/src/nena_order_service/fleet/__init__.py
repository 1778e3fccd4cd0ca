"""Fleet control: the side of VDA 5050 that sends orders and reads states (3.0 section 6).

The core is pure: messages and the time, in monotonic seconds, go in; messages to send and news come out.
"""

from nena_order_service.fleet.addresses import RobotAddresses
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.failures import FailureKind, RobotBusyError
from nena_order_service.fleet.instant_actions import retry_or_skip
from nena_order_service.fleet.link import FleetLink
from nena_order_service.fleet.mission import (
    BaseChangedError,
    Mission,
    OperationMap,
    build_mission,
    mission_id,
)
from nena_order_service.fleet.outputs import (
    ActionRetriable,
    BaseWanted,
    FleetOutput,
    InstantActionEnded,
    MissionAccepted,
    MissionCancelled,
    MissionFailed,
    MissionFinished,
    NodePassed,
    OperationStarted,
    Outputs,
    PublishInstantActions,
    PublishOrder,
    PublishResponses,
    RobotChanged,
)
from nena_order_service.fleet.position import NotLocatedError, RobotProfile, Standing, locate
from nena_order_service.fleet.robot import Availability, LinkStatus, MissionPhase, RobotView
from nena_order_service.fleet.settings import FleetSettings

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
    "Mission",
    "MissionAccepted",
    "MissionCancelled",
    "MissionFailed",
    "MissionFinished",
    "MissionPhase",
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
    "build_mission",
    "locate",
    "mission_id",
    "retry_or_skip",
]
