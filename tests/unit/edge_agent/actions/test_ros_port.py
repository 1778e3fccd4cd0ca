"""The port of plug-ins without a session; with one it is shown over DDS in the integration tests."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from nena_edge_agent.actions import ros_port
from nena_edge_agent.actions.plugin import RosError
from nena_edge_agent.actions.ros_port import PluginRos
from nena_edge_agent.driver.port import SessionState

STRING = "std_msgs/msg/String"


def test_without_a_session_nothing_is_sent() -> None:
    port = PluginRos()
    publisher = port.publisher("lift", STRING)

    assert publisher.listeners == 0
    with pytest.raises(RosError, match="the robot's ROS session is not active"):
        publisher.publish({"data": "up"})


async def test_without_a_session_no_service_is_called() -> None:
    client = PluginRos().client("clamp", "std_srvs/srv/Trigger")

    with pytest.raises(RosError, match="the robot's ROS session is not active"):
        await client.call({}, seconds=1.0)


async def test_invalid_messages_and_types_are_refused_first() -> None:
    port = PluginRos()

    with pytest.raises(RosError, match=r"lift\.date: std_msgs/msg/String has no such field"):
        port.publisher("lift", STRING).publish({"date": "up"})
    with pytest.raises(RosError, match=r"clamp\.data: 1 is not true or false"):
        await port.client("clamp", "std_srvs/srv/SetBool").call({"data": 1}, seconds=1.0)
    with pytest.raises(RosError, match="is not installed"):
        port.subscribe("lift", "acme_msgs/msg/Lift", print)


class Silent:
    """A session with clients whose action server accepts goals, if at all, and never answers."""

    state = SessionState.ACTIVE

    def __init__(self, *, accepts: bool) -> None:
        self._accepts = accepts
        self.called: list[str] = []

    def subscribe(self, *_: object, **__: object) -> None:
        """Do nothing: the status array lists no goal."""

    def create_client(self, kind: Any, path: str) -> Any:
        """Return a client that has found its service."""
        made = SimpleNamespace(goal_info=SimpleNamespace(goal_id=None))
        service = SimpleNamespace(Request=lambda: made)
        return SimpleNamespace(
            name=path.rpartition("/")[2].split("_")[0],
            srv_type=service,
            kind=kind,
            service_is_ready=lambda: True,
        )

    async def call(self, client: Any, _request: Any, *, seconds: float) -> Any:
        assert seconds > 0
        self.called.append(client.name)
        return SimpleNamespace(accepted=True) if client.name == "send" and self._accepts else None


@pytest.mark.parametrize(("accepts", "called"), [(False, ["send"]), (True, ["send", "get"])])
async def test_a_goal_without_feedback_is_cancelled(
    monkeypatch: pytest.MonkeyPatch, *, accepts: bool, called: list[str]
) -> None:
    goal = SimpleNamespace(goal_id=SimpleNamespace(uuid=[]))
    kind = SimpleNamespace(
        Impl=SimpleNamespace(
            SendGoalService=SimpleNamespace(Request=lambda **_: goal),
            GetResultService=SimpleNamespace(Request=lambda **_: goal),
        )
    )
    monkeypatch.setattr(ros_port, "installed", lambda _find, _name: (None, kind))
    monkeypatch.setattr(ros_port, "_make_message", lambda *_: None)
    monkeypatch.setattr(ros_port, "RESULT_WAIT", 0.0)
    names = {"action_msgs.srv": ["CancelGoal"], "action_msgs.msg": ["GoalStatusArray"]}
    names["nena_edge_agent.nav2.messages"] = ["status_entries"]
    names["nena_edge_agent.nav2.session"] = ["LATCHED", "STATUS_ARRAYS"]
    for module, attributes in names.items():
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(**dict.fromkeys(attributes)))
    session = Silent(accepts=accepts)
    port = PluginRos()
    action = port.action("lift", "acme_msgs/action/Lift")
    node = SimpleNamespace(get_publishers_info_by_topic=lambda _: [], create_client=session.create_client)
    port.enter(session, node)  # type: ignore[arg-type]

    with pytest.raises(RosError):
        await action.run({})

    assert session.called == [*called, "cancel"]
