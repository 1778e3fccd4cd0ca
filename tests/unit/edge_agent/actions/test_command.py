from __future__ import annotations

import pytest

from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.command import Command
from nena_edge_agent.actions.message_shape import FieldError
from nena_edge_agent.actions.message_types import message_type
from nena_edge_agent.actions.settings import CommandSettings, OperationBase, ParameterSettings
from nena_edge_agent.actions.values import ActionValues
from nena_shared.vda5050.factsheet import ValueDataType
from support.ros_port import ScriptedRos

TYPE = "std_msgs/msg/UInt8"
LEVEL = ParameterSettings(key="level", type=ValueDataType.INTEGER)


def command(ros: ScriptedRos, **settings: object) -> Command:
    full = {"topic": "level", "type": TYPE, "fields": {"data": "{level}"}, **settings}
    values = ActionValues(OperationBase(action_type="go", parameters=(LEVEL,)))
    chosen = CommandSettings.model_validate(full)
    return Command(chosen, ros.publisher("level", TYPE), message_type(TYPE), values, "p")


def test_each_step_sends_its_message_where_it_has_one() -> None:
    ros = ScriptedRos()
    steered = command(ros, on_pause={"data": 0}, on_resume={"data": "{level}"})
    for step in (steered.begin, steered.pause, steered.resume, steered.cancel):
        step({"level": 7})

    assert [each["data"] for _, each in ros.published] == [7, 0, 7]


def test_a_value_that_does_not_fit_is_found_beforehand() -> None:
    with pytest.raises(FieldError, match=r"p\.fields\.data: 300"):
        command(ScriptedRos()).check({"level": 300})


async def test_somebody_must_listen_unless_nobody_need() -> None:
    ros = ScriptedRos()
    ros.listeners = 0
    with pytest.raises(WorkFailedError, match="nobody listens to level"):
        await command(ros, listener_timeout=0.1).heard()
    await command(ros, listener_timeout=0).heard()
    ros.listeners = 1
    await command(ros).heard()
