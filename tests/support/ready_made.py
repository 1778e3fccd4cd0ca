"""Ready-made actions of a robot whose ROS side is in the test's hands."""

from __future__ import annotations

from typing import Any

from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.run import ActionRunner
from nena_edge_agent.extension import operation_kinds
from nena_edge_agent.plugin_check import DryDrive
from nena_edge_agent.protocol.events import ActionReport, StartAction
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.topics import RobotKey
from support.edge_agent import SETTINGS
from support.pausing import turn_passes
from support.robot_core import action
from support.ros_port import ScriptedRos
from support.waiting import until

STRING = "std_msgs/msg/String"
COMMAND = {"topic": "lift/command", "type": STRING, "fields": {"data": "raise {height}"}}
STEERED = {
    **COMMAND,
    "on_pause": {"data": "hold"},
    "on_resume": {"data": "go on"},
    "on_cancel": {"data": "stop {actionId}"},
}
ANSWER = {"topic": "lift/result", "type": STRING, "match": {"data": "done"}, "failed": {"data": "jammed"}}
HEIGHT = {"key": "height", "type": "NUMBER", "minimum": 0, "maximum": 2}
LIFT: dict[str, Any] = {
    "kind": "topic",
    "action_type": "lift",
    "parameters": [HEIGHT],
    "command": STEERED,
    "answer": {**ANSWER, "result": "data"},
}
CALL = {"service": "clamp", "type": "std_srvs/srv/SetBool", "fields": {"data": True}}
CLAMP: dict[str, Any] = {"kind": "service", "action_type": "clamp", "call": CALL}


def settings_of(*operations: dict[str, Any], **actions: Any) -> EdgeAgentSettings:
    return SETTINGS.model_validate({"operations": operations, "actions": actions})


def plugins_of(*operations: dict[str, Any], ros: ScriptedRos | None, **actions: Any) -> list[ActionPlugin]:
    settings = settings_of(*operations, **actions)
    context = PluginContext(RobotKey("ACME", "0001"), DryDrive(), ros)
    return list(ready_made(settings.operations, context, settings.actions, operation_kinds()))


async def end_of(reports: list[ActionReport]) -> ActionReport:
    """Return the report of an action's end, once it has come."""
    return await until(lambda: next((each for each in reports if each.status.ended), None))


class Robot:
    """The ready-made actions of one robot, with the ROS side in the test's hands."""

    def __init__(self, *operations: dict[str, Any], **actions: Any) -> None:
        self.ros = ScriptedRos()
        self.registry = ActionRegistry(plugins_of(*operations, ros=self.ros, **actions))
        self.reports: list[ActionReport] = []
        self.runner = ActionRunner(self.registry, self.reports.append)

    async def begin(self, action_type: str, **parameters: Any) -> None:
        self.runner.start(StartAction(action("a", "HARD", action_type, **parameters), ()))
        await turn_passes()

    async def until_published(self, *texts: str) -> None:
        await until(lambda: [each["data"] for _, each in self.ros.published] == list(texts))

    async def end(self) -> tuple[str, str | None]:
        last = await end_of(self.reports)
        return last.status.value, last.result
