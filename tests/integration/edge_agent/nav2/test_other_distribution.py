"""The agent on one distribution of ROS 2 with a robot on another one, in one domain: ``make kilted-test``."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
import rclpy

from support import simulator
from support.edge_agent import ended, error_types
from support.nav2_agent import Bench, ready
from support.robot_core import order

OTHER = os.environ.get("NENA_OTHER_ROS", "")
"""The programs' folder of a virtual environment with another distribution."""

FOUND_BY = ("LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""Variables by which programs find the libraries of this environment: the ROS wheels set them at import."""

pytestmark = [
    pytest.mark.ros,
    pytest.mark.broker,
    pytest.mark.skipif(not OTHER, reason="NENA_OTHER_ROS is not set; `make kilted-test` sets it"),
]


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the simulator run with the other distribution."""
    for name in FOUND_BY:
        monkeypatch.delenv(name, raising=False)
    programs = Path(OTHER).absolute()
    asked = [str(programs / "python"), "-c", "import rclpy.impl; print(rclpy.impl.__file__)"]
    found = subprocess.run(asked, check=True, capture_output=True, text=True, timeout=60)
    assert found.stdout.strip() != rclpy.impl.__file__
    monkeypatch.setattr(simulator, "PROGRAMS", programs)


@pytest.mark.usefixtures("other")
@pytest.mark.parametrize("navigation", ["topics", "action"])
async def test_order_is_driven_by_a_robot_of_another_distribution(bench: Bench, navigation: str) -> None:
    async with bench.robot(ros={"navigation": navigation}) as fleet:
        fleet.send(order("n0", "n1", "n2"))
        done = await fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n2", [])
    assert ready(done)
