"""Plug-ins that are really installed: the one of docs/actions.md, and broken ones beside it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from nena_shared.vda5050.topics import Topic
from support.broker import Broker
from support.distributions import environment_with, install
from support.edge_agent import AgentProcess, FleetControl, ended, error_types, status_of
from support.robot_core import action, order
from support.waiting import until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

PAGE = Path(__file__).parents[3] / "docs" / "actions.md"
BROKEN_PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "acme-broken"
version = "1.0.0"
[project.entry-points."nena.actions"]
broken = "acme_broken:make"
no_ros = "acme_no_ros:make"
[tool.hatch.build.targets.wheel]
only-include = ["acme_broken.py", "acme_no_ros.py"]
"""
NO_ROS = """
from nena_edge_agent.actions.api import PluginUnavailableError

def make(context):
    if context.ros is None:
        raise PluginUnavailableError("it needs ROS")
"""


def example() -> dict[str, str]:
    """Return the files of the example, as they are on the page."""
    part = PAGE.read_text(encoding="utf-8").split("## A plug-in of your own")[1]
    (project, *_), (code, *_) = (
        re.findall(rf"```{kind}\n(.*?)```", part, re.DOTALL) for kind in ("toml", "python")
    )
    return {"pyproject.toml": project, "acme_forks.py": code}


@pytest.fixture(scope="module")
def forks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(example(), tmp_path_factory.mktemp("forks"))


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    files = {
        "pyproject.toml": BROKEN_PROJECT,
        "acme_broken.py": "import acme_hydraulics\n",
        "acme_no_ros.py": NO_ROS,
    }
    return install(files, tmp_path_factory.mktemp("broken"))


@pytest.mark.clause("6.2.3", "6.10", "6.6.9")
async def test_agent_runs_plugin_actions_despite_broken_plugins(
    broker: Broker,
    interface_name: str,
    tmp_path: Path,
    fleet: FleetControl,
    monkeypatch: pytest.MonkeyPatch,
    *,
    forks: Path,
    broken: Path,
) -> None:
    monkeypatch.setenv("PYTHONPATH", environment_with(forks, broken)["PYTHONPATH"])
    options = ("--actions.options", '{"forks": {"speed": 2.0}}', "--loopback.speed", "20")
    with AgentProcess(broker, interface_name, tmp_path, *options) as process:
        state = await fleet.state(error_types)
        warning = state["errors"][0]
        assert warning["errorType"] == "ACTION_PLUGIN_UNUSABLE"
        assert warning["errorLevel"] == "WARNING"
        assert "No module named 'acme_hydraulics'" in warning["errorDescription"]
        assert "it needs ROS" in warning["errorDescription"]

        sheets = await until(lambda: fleet.peer.payloads(fleet.topic(Topic.FACTSHEET)))
        actions: list[dict[str, Any]] = json.loads(sheets[-1])["protocolFeatures"]["agvActions"]
        (height,) = next(each for each in actions if each["actionType"] == "raiseForks")["actionParameters"]
        assert height["description"] == "m, at least 0 and at most 2"
        assert height["isOptional"] is False

        fleet.send(
            order("n0", order_id="high", node_actions={"n0": [action("a0", "HARD", "raiseForks", height=3)]})
        )
        refused = await fleet.state(lambda each: "orderError" in error_types(each))
        assert refused["orderId"] == ""

        raise_forks = action("a1", "HARD", "raiseForks", height=1.5)
        fleet.send(order("n0", "n1", order_id="job", node_actions={"n1": [raise_forks]}))
        done = await fleet.state(ended("job"))
        assert status_of(done, "a1") == "FINISHED"
        results = {each.get("resultDescription") for each in done["actionStates"]}
        assert results == {"at 1.50 m"}
        assert process.terminate() == 0
