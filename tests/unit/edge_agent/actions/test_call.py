from __future__ import annotations

import pytest

from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.call import Call
from nena_edge_agent.actions.message_types import service_type
from nena_edge_agent.actions.ports import RosError
from nena_edge_agent.actions.settings import CallSettings, OperationBase
from nena_edge_agent.actions.values import ActionValues
from support.ros_port import ScriptedRos

NOTHING = ActionValues(OperationBase(action_type="go"))


def call(ros: ScriptedRos, type_name: str, **settings: object) -> Call:
    chosen = CallSettings.model_validate({"service": "x", "type": type_name, **settings})
    return Call(chosen, ros.client("x", type_name), service_type(type_name), NOTHING, "p")


async def test_a_service_that_tells_nothing_has_succeeded() -> None:
    ros = ScriptedRos()
    ros.services["x"] = {}

    assert await call(ros, "std_srvs/srv/Empty").do({}) is None


async def test_what_is_expected_may_hold_values_of_the_action() -> None:
    ros = ScriptedRos()
    ros.services["x"] = {"success": False, "message": "a1 done"}
    named = call(ros, "std_srvs/srv/Trigger", expect={"message": "{actionId} done"}, result="")

    assert await named.do({"actionId": "a1"}) is None
    with pytest.raises(WorkFailedError, match="x says that it has failed"):
        await named.do({"actionId": "a2"})


async def test_one_that_is_not_there_is_ros_to_tell() -> None:
    with pytest.raises(RosError, match="nobody offers"):
        await call(ScriptedRos(), "std_srvs/srv/Trigger").do({})
