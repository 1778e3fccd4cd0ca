"""Fleet control: the side of VDA 5050 that sends orders and reads states (3.0 section 6).

The core is pure: messages and the time, in monotonic seconds, go in; messages to send and news come out.
"""

from nena_order_service.fleet.addresses import RobotAddresses
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.errors import RobotBusyError
from nena_order_service.fleet.failure_kind import FailureKind
from nena_order_service.fleet.instant_run import retry_or_skip
from nena_order_service.fleet.link import FleetLink
from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.mission_builder import build_mission, mission_id
from nena_order_service.fleet.mission_update import BaseChangedError
from nena_order_service.fleet.operations import OperationMap
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
from nena_order_service.fleet.profile import RobotProfile
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.standing import NotLocatedError, Standing, locate
from nena_order_service.fleet.view import Availability, LinkStatus, MissionPhase, RobotView

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
