"""Actions of Nav2's servers end with a reason, even if their results never arrive."""

from __future__ import annotations

import asyncio
import os
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from nena_edge_agent.actions.plugin import PluginContext
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.ros_port import PluginRos
from nena_edge_agent.actions.run import ActionRunner
from nena_edge_agent.extension import operation_kinds
from nena_edge_agent.nav2.session import RosSession
from nena_edge_agent.plugin_check import DryDrive
from nena_edge_agent.protocol.events import ActionReport, CancelAction, StartAction
from nena_robot_simulator.interfaces import build
from nena_shared.vda5050.topics import RobotKey
from support.action_types import needs_action_types
from support.edge_agent import SETTINGS
from support.ready_made import end_of
from support.robot_core import action
from support.spin_server import other_definition, spin_server
from support.waiting import PATIENCE

pytestmark = [pytest.mark.ros, needs_action_types]

TURN: dict[str, Any] = {"kind": "nav2", "action_type": "turn", "behavior": "spin"}
LOST = "its result did not arrive: compare the version of nav2_msgs"
ENDS = [("SUCCEEDED", "FINISHED", None), ("ABORTED", "FAILED", "spin has aborted its goal; ")]


class Turn:
    """The action ``turn`` of a robot, started at once."""

    def __init__(self, port: PluginRos) -> None:
        settings = SETTINGS.model_validate({"operations": [TURN]})
        context = PluginContext(RobotKey("ACME", "0001"), DryDrive(), port)
        self.reports: list[ActionReport] = []
        plugins = ready_made(settings.operations, context, settings.actions, operation_kinds())
        self.runner = ActionRunner(ActionRegistry(plugins), self.reports.append)

    def begin(self) -> None:
        self.runner.start(StartAction(action("a", "HARD", "turn", angle=1.0), ()))

    async def end(self) -> tuple[str, str | None]:
        last = await end_of(self.reports)
        return last.status.value, last.result


def assert_reason(text: str | None, beginning: str | None) -> None:
    assert (text and beginning and text[: len(beginning)]) == beginning


@asynccontextmanager
async def turn(domain_id: int) -> AsyncIterator[Turn]:
    port = PluginRos()
    started = Turn(port)
    session = RosSession(node_name="agent_under_test", namespace="/", domain_id=domain_id)
    await session.start(lambda node: port.enter(session, node))
    try:
        started.begin()
        yield started
    finally:
        await session.stop()


@pytest.fixture(scope="module")
def shorter(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a server whose result has a field less than the agent's."""
    if problem := build.missing_tool():
        pytest.skip(problem)
    goal = "float32 target_yaw\nbuiltin_interfaces/Duration time_allowance\n---\n"
    result = "builtin_interfaces/Duration total_elapsed_time\nuint16 error_code\n---\n"
    ament = os.environ.get("AMENT_PREFIX_PATH")
    made = other_definition(
        tmp_path_factory.mktemp("spin"), f"{goal}{result}float32 angular_distance_traveled\n"
    )
    if ament is None:
        os.environ.pop("AMENT_PREFIX_PATH", None)
    return made


@pytest.mark.parametrize(("status", "end", "reason"), ENDS)
async def test_a_server_with_other_definitions(
    domain_id: int, shorter: dict[str, str], status: str, end: str, reason: str | None
) -> None:
    with spin_server(domain_id, status, environment=shorter):
        async with turn(domain_id) as turning:
            found, text = await turning.end()
    assert found == end
    assert_reason(text, reason and reason + LOST)


@pytest.mark.parametrize("lost", ["never", "silent"])
@pytest.mark.parametrize(("status", "end", "reason"), ENDS)
async def test_a_server_whose_answers_are_lost(
    domain_id: int, status: str, end: str, reason: str | None, lost: str
) -> None:
    with spin_server(domain_id, status, result=lost):
        async with turn(domain_id) as turning:
            found, text = await turning.end()
    assert found == end
    assert_reason(text, reason and reason + LOST)


@pytest.mark.parametrize(("status", "end", "reason"), ENDS)
async def test_a_server_that_has_dropped_its_result(
    domain_id: int, status: str, end: str, reason: str | None
) -> None:
    """The answer then has the status 0 and the code 0 (``action_server_result_timeout``)."""
    with spin_server(domain_id, status, result="dropped"):
        async with turn(domain_id) as turning:
            found, text = await turning.end()
    assert found == end
    assert_reason(text, reason and f"{reason}the server has dropped its result")


async def test_a_server_that_is_killed_and_comes_back(domain_id: int) -> None:
    async with turn(domain_id) as turning:
        with spin_server(domain_id, "") as server:
            await executes(server)
            server.kill()
        with spin_server(domain_id, "SUCCEEDED"):
            end = await turning.end()
    assert end == ("FAILED", "the server of spin has ended or was restarted during the goal")


async def test_a_cancelled_goal_whose_result_is_lost(domain_id: int) -> None:
    with spin_server(domain_id, "", result="never") as server:
        async with turn(domain_id) as turning:
            await executes(server)
            turning.runner.cancel(CancelAction("a"))
            assert await turning.end() == ("FAILED", "cancelled")


async def test_a_goal_cancelled_by_another_client_has_failed(domain_id: int) -> None:
    with spin_server(domain_id, "CANCELED"):
        async with turn(domain_id) as turning:
            assert await turning.end() == ("FAILED", "spin has cancelled its goal")


async def test_a_result_that_arrives_tells_the_reason(domain_id: int) -> None:
    with spin_server(domain_id, "ABORTED"):
        async with turn(domain_id) as turning:
            found, text = await turning.end()
    assert found == "FAILED"
    assert "error code 701" in str(text)


async def executes(server: subprocess.Popen[str]) -> None:
    """Wait until the server executes the goal, and knows that the agent waits for its result."""
    assert server.stdout is not None
    line = await asyncio.wait_for(asyncio.to_thread(server.stdout.readline), PATIENCE)
    assert line == "asked\n"
