"""Ready-made actions and a node in another process, over DDS; and a whole order that they do."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from std_msgs.msg import String
from std_srvs.srv import SetBool

from nena_edge_agent.actions.plugin import Fields, PluginContext, RosError, TopicQos
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.ros_port import PluginRos
from nena_edge_agent.actions.run import ActionRunner
from nena_edge_agent.extension import operation_kinds
from nena_edge_agent.nav2.session import RosSession
from nena_edge_agent.plugin_check import DryDrive
from nena_edge_agent.protocol.events import ActionReport, CancelAction, StartAction
from nena_shared.vda5050.topics import RobotKey, Topic
from support.edge_agent import SETTINGS, FleetControl, ended, error_types, status_of
from support.lift_process import lift_process
from support.nav2_agent import Bench, ready
from support.ready_made import end_of
from support.robot_core import action, hard, order
from support.ros import LATCHED, RosPeer
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

STRING = "std_msgs/msg/String"
HEIGHT = {"key": "height", "type": "NUMBER", "minimum": 0, "maximum": 2}
ANSWER = {
    "topic": "lift/result",
    "type": STRING,
    "match": {"data": "done {actionId}"},
    "failed": {"data": "failed {actionId}"},
    "progress": {"data": "at 50 % for {actionId}"},
    "result": "data",
}


def lifting(action_type: str, verb: str, **more: Any) -> dict[str, Any]:
    """Return the settings of an action executed by the lift."""
    return {
        "kind": "topic",
        "action_type": action_type,
        "parameters": [HEIGHT],
        "command": {
            "topic": "lift/command",
            "type": STRING,
            "fields": {"data": f"{verb} to {{height}} for {{actionId}}"},
            "on_cancel": {"data": "stop {actionId}"},
            "listener_timeout": 20.0,
        },
        "answer": ANSWER,
        **more,
    }


def calling(action_type: str, service: str, kind: str = "SetBool", **call: Any) -> dict[str, Any]:
    settings = {"service": service, "type": f"std_srvs/srv/{kind}", **call}
    return {"kind": "service", "action_type": action_type, "call": settings}


OPERATIONS: list[dict[str, Any]] = [
    lifting("pick", "raise", load="take"),
    lifting("drop", "lower", load="give"),
    lifting("jam", "jam"),
    lifting("dream", "dream"),
    calling("close", "clamp", fields={"data": True}),
    calling("open", "clamp", fields={"data": False}),
    calling("sleep", "sleep", "Trigger", response_timeout=0.3),
    calling("nowhere", "nowhere", "Trigger", response_timeout=0.3),
    {
        "kind": "signal",
        "action_type": "waitForLoad",
        "answer": {
            "topic": "lift/loaded",
            "type": "std_msgs/msg/Bool",
            "match": {"data": True},
            "qos": "latched",
        },
    },
    {"kind": "turn_signal", "scopes": ["NODE", "EDGE"]},
]


class Robot:
    """The actions of one robot on a separate node."""

    def __init__(self, port: PluginRos) -> None:
        settings = SETTINGS.model_validate({"operations": OPERATIONS})
        context = PluginContext(RobotKey("ACME", "0001"), DryDrive(), port)
        plugins = ready_made(settings.operations, context, settings.actions, operation_kinds())
        self.reports: list[ActionReport] = []
        self.runner = ActionRunner(ActionRegistry(plugins), self.reports.append)

    def begin(self, action_type: str, action_id: str = "a1", **parameters: Any) -> None:
        self.runner.start(StartAction(action(action_id, "HARD", action_type, **parameters), ()))

    async def end(self) -> tuple[str, str | None]:
        last = await end_of(self.reports)
        return last.status.value, last.result


@asynccontextmanager
async def session(port: PluginRos, domain_id: int) -> AsyncIterator[RosSession]:
    made = RosSession(node_name="agent_under_test", namespace="/", domain_id=domain_id)
    await made.start(lambda node: port.enter(made, node))
    try:
        yield made
    finally:
        await made.stop()


@pytest.fixture
def lift(domain_id: int) -> Iterator[None]:
    with lift_process(domain_id):
        yield


@pytest.mark.usefixtures("lift")
async def test_actions_by_topics_and_services(domain_id: int, peer: RosPeer) -> None:
    heard = peer.subscribe(String, "lift/heard")
    await asyncio.to_thread(lambda: peer.call(peer.client(SetBool, "clamp"), SetBool.Request(data=True)))
    port = PluginRos()  # and the lift knows by now who listens

    async def done(action_type: str, **parameters: Any) -> tuple[str, str | None]:
        robot.reports.clear()
        robot.begin(action_type, **parameters)
        return await robot.end()

    robot = Robot(port)
    async with session(port, domain_id):
        assert await done("pick", height=1) == ("FINISHED", "done a1")
        assert "waits for lift/result" in [each.result for each in robot.reports]
        assert heard.wait_for().data == "raise to 1 for a1"
        assert await done("jam", height=0.5) == ("FAILED", "failed a1")
        assert await done("waitForLoad") == ("FINISHED", None)
        assert await done("close") == ("FINISHED", "closed")
        assert await done("open") == ("FAILED", "the clamp is jammed")
        assert await done("nowhere") == ("FAILED", "no node offers the service nowhere")
        assert await done("setTurnSignal", direction="left") == (
            "FAILED",
            "no node subscribes to turn_signal",
        )

        robot.reports.clear()
        robot.begin("dream", height=1)
        await asyncio.to_thread(heard.wait_for, lambda each: each.data.startswith("dream"))
        robot.runner.cancel(CancelAction("a1"))
        assert await robot.end() == ("FAILED", "cancelled")
        await asyncio.to_thread(heard.wait_for, lambda each: each.data == "stop a1")

        signals = peer.subscribe(String, "turn_signal")
        assert await done("setTurnSignal", direction="right") == ("FINISHED", None)
        assert (await asyncio.to_thread(signals.wait_for)).data == "right"

        assert await done("sleep") == ("FAILED", "the service sleep did not answer within 0.3 s")


@pytest.mark.usefixtures("lift")
async def test_requested_endpoints_are_created_in_each_session_and_refused_without_one(
    domain_id: int,
) -> None:
    port = PluginRos()
    robot = Robot(port)
    robot.begin("close")
    assert await robot.end() == ("FAILED", "the robot's ROS session is not active")

    for _ in range(2):
        robot.reports.clear()
        async with session(port, domain_id):
            robot.begin("pick", height=1)
            assert await robot.end() == ("FINISHED", "done a1")

    robot.reports.clear()
    robot.begin("close")
    assert await robot.end() == ("FAILED", "the robot's ROS session is not active")


async def test_open_session_accepts_more_endpoints(domain_id: int, peer: RosPeer) -> None:
    port = PluginRos()
    came: list[Fields] = []

    def fail(_: Fields) -> None:
        message = "one that fails hurts nobody"
        raise RuntimeError(message)

    async with session(port, domain_id):
        port.subscribe("tap", STRING, came.append, qos=TopicQos.BEST_EFFORT)
        port.subscribe("tap", STRING, fail)
        taps = await asyncio.to_thread(peer.publisher, String, "tap")

        def heard() -> bool:
            taps.publish(String(data="tap"))
            return bool(came)

        await until(heard)
        latched: list[Fields] = []
        port.subscribe("kept", STRING, latched.append, qos=TopicQos.LATCHED)
        kept = await asyncio.to_thread(peer.publisher, String, "kept", LATCHED)
        kept.publish(String(data="once"))
        await until(lambda: latched)
        port.subscribe("kept", STRING, came.append, qos=TopicQos.LATCHED)  # who comes later hears it too
        assert came[-1] == {"data": "once"}
        with pytest.raises(RosError, match="no such field"):
            port.publisher("tap", STRING).publish({"date": "x"})
        with pytest.raises(RosError, match="is not installed"):
            port.publisher("tap", "std_msgs/msg/Strin")


async def factsheet(fleet: FleetControl) -> dict[str, Any]:
    payloads = await until(lambda: fleet.peer.payloads(fleet.topic(Topic.FACTSHEET)))
    sheet: dict[str, Any] = json.loads(payloads[-1])
    return sheet


@pytest.mark.clause("6.2.3/pick", "6.1.4.3", "6.10")
@pytest.mark.usefixtures("lift")
async def test_order_loads_drives_docks_and_unloads(bench: Bench) -> None:
    operations = [*OPERATIONS[:2], {"kind": "dock", "action_type": "dock", "forward": 1.0, "timeout": 60.0}]
    sensor = {"topic": "lift/loaded"}
    async with bench.robot(operations=operations, actions={"load_sensor": sensor}) as fleet:
        sheet = await factsheet(fleet)
        listed = {each["actionType"]: each for each in sheet["protocolFeatures"]["agvActions"]}
        assert [each["key"] for each in listed["pick"]["actionParameters"]] == [
            "height",
            "loadId",
            "loadType",
        ]
        assert sheet["loadSpecification"]["loadPositions"]

        fleet.send(order("n0", "n2", order_id="bad", node_actions={"n2": [hard("d0", "drop", height=0)]}))
        refused = await fleet.state(lambda state: error_types(state) == ["orderError"])
        assert "carries none" in refused["errors"][0]["errorDescription"]
        assert refused["orderId"] == ""

        fleet.send(
            order(
                "n0",
                "n2",
                order_id="job",
                node_actions={
                    "n0": [hard("p1", "pick", height=1, loadId="box", loadType="EPAL")],
                    "n2": [hard("k1", "dock"), hard("d1", "drop", height=0)],
                },
            )
        )
        carried = await fleet.state(lambda state: status_of(state, "p1") == "FINISHED")
        assert [each["loadId"] for each in carried["loads"]] == ["box"]
        done = await fleet.state(ended("job"))

    assert [status_of(done, each) for each in ("p1", "k1", "d1")] == ["FINISHED"] * 3
    assert done["loads"] == []
    assert done["lastNodeId"] == "n2"
    assert done["agvPosition"]["x"] == pytest.approx(21.0, abs=0.75)  # docked 1 m behind the node
    assert ready(done)
