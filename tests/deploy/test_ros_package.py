"""The edge agent as a ROS package: what colcon builds from its folder, starts, and the launch file finds."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import defusedxml.ElementTree
import pytest

from nena_shared.settings import load
from support.broker import Broker, MqttPeer
from support.edge_agent import SETTINGS
from support.waiting import PATIENCE, until

FOLDER = Path(__file__).parents[2] / "services" / "edge_agent"
SHARED = Path(__file__).parents[2] / "shared" / "src"
LAUNCH = FOLDER / "launch" / "edge_agent.launch.xml"
PACKAGE = "nena_edge_agent"


def test_settings_file_is_valid() -> None:
    settings = load(
        SETTINGS,
        ["--config", str(FOLDER / "config" / "edge_agent.toml")],
        program="test",
        description="",
    )

    assert (settings.manufacturer, settings.serial_number) == ("ACME", "0001")


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder into which colcon has installed the package."""
    colcon = os.environ.get("COLCON") or shutil.which("colcon")
    if not colcon:
        pytest.skip("colcon is not installed: `make colcon-test` brings it and runs this")
    workspace = tmp_path_factory.mktemp("workspace")
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "dist")
    shutil.copytree(FOLDER, workspace / "src" / PACKAGE, ignore=unwanted)
    path = f"{Path(colcon).parent}:{os.environ['PATH']}"
    subprocess.run(
        [colcon, "build"], cwd=workspace, env={**os.environ, "PATH": path}, check=True, timeout=100
    )
    return workspace / "install" / PACKAGE


def in_workspace(prefix: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a command of the workspace to its end."""
    script = after_setup(prefix, command)
    return subprocess.run(script, capture_output=True, text=True, timeout=PATIENCE, check=False)


def after_setup(prefix: Path, command: str) -> list[str]:
    """Return a command as on a robot: after the workspace's setup, with pip's packages."""
    installed = next(path for path in sys.path if path.endswith("site-packages"))
    script = f'. "{prefix.parent}/setup.bash" && PYTHONPATH="$PYTHONPATH:{SHARED}:{installed}" exec {command}'
    return ["bash", "-c", script]


def test_colcon_installs_a_ros_package(prefix: Path) -> None:
    share = prefix / "share"

    assert (share / "ament_index" / "resource_index" / "packages" / PACKAGE).is_file()
    assert (share / PACKAGE / "package.xml").read_text() == (FOLDER / "package.xml").read_text()
    where = in_workspace(prefix, f"python3 -c 'import {PACKAGE}; print({PACKAGE}.__file__)'")
    assert where.stdout.startswith(str(prefix)), where.stderr


def test_launch_file_finds_its_executable(prefix: Path) -> None:
    launch = defusedxml.ElementTree.fromstring(LAUNCH.read_text())

    def found(text: str) -> Path:
        text = text.replace(f"$(find-pkg-share {PACKAGE})", str(prefix / "share" / PACKAGE))
        return Path(text.replace(f"$(find-pkg-prefix {PACKAGE})", str(prefix)))

    (command,) = (each.get("cmd", "") for each in launch.iter("executable"))
    (default,) = (each.get("default", "") for each in launch.iter("arg"))
    program, options = command.split(" --", 1)
    assert os.access(found(program), os.X_OK)
    assert options == "config $(var config)"
    assert found(default).is_file()
    assert (prefix / "share" / PACKAGE / "launch" / LAUNCH.name).read_text() == LAUNCH.read_text()


@pytest.mark.broker
async def test_installed_agent_runs(prefix: Path, broker: Broker, interface_name: str) -> None:
    config = prefix / "share" / PACKAGE / "config" / "edge_agent.toml"
    options = (
        f"--config {config} --driver loopback --journal.folder {prefix.parent}/journal "
        f"--mqtt.port {broker.port} --interface_name {interface_name}"
    )
    command = after_setup(prefix, f"{prefix}/lib/{PACKAGE}/nena-edge-agent {options}")
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        process = await asyncio.create_subprocess_exec(*command)
        await until(lambda: len(peer.received("+/v2/ACME/0001/connection")) > 0, what="it is there")
        process.send_signal(signal.SIGINT)
        await process.wait()
        await until(lambda: len(peer.received("+/v2/ACME/0001/connection")) > 1, what="its farewell")
    states = [json.loads(each)["connectionState"] for each in peer.payloads("+/v2/ACME/0001/connection")]
    assert states == ["ONLINE", "OFFLINE"]
