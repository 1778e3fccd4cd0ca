"""The public API for authors of action plug-ins, in one import; changes are announced."""

from nena_edge_agent.actions.plugin import (
    ActionFailedError,
    ActionPlugin,
    BackgroundAction,
    Countdown,
    DriveError,
    DrivePort,
    Fields,
    PluginContext,
    PluginFactory,
    PluginUnavailableError,
    Publisher,
    Report,
    RosActionClient,
    RosError,
    RosPort,
    RunningAction,
    ServiceClient,
    TopicQos,
    WorkFailedError,
)
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

__all__ = [
    "Action",
    "ActionDeclaration",
    "ActionFailedError",
    "ActionPlugin",
    "ActionReport",
    "ActionScope",
    "ActionStatus",
    "BackgroundAction",
    "BlockingType",
    "Countdown",
    "DriveError",
    "DrivePort",
    "Fields",
    "Load",
    "LoadChange",
    "Parameter",
    "PluginContext",
    "PluginFactory",
    "PluginUnavailableError",
    "Pose",
    "Publisher",
    "Report",
    "RosActionClient",
    "RosError",
    "RosPort",
    "RunningAction",
    "ServiceClient",
    "TopicQos",
    "ValueDataType",
    "WorkFailedError",
]
