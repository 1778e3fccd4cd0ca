"""The edge agent's image on a ROS installation: built, and its ROS tried."""

from __future__ import annotations

import pytest

from support.compose import BUILD_SECONDS, docker, image_is_there, skip_without_docker

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(BUILD_SECONDS)]

STAND_IN = r"""
FROM python:3.13-slim
RUN python3 -m venv /opt/ros/jazzy \
 && /opt/ros/jazzy/bin/pip install --quiet 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces
RUN printf '%s\n' '#!/bin/bash' 'packages=$(echo /opt/ros/jazzy/lib/python3*/site-packages)' \
 'export PYTHONPATH=$packages AMENT_PREFIX_PATH=/opt/ros/jazzy' \
 'export LD_LIBRARY_PATH=/opt/ros/jazzy/lib:$(echo $packages/ros_*.libs | tr " " :)' 'exec "$@"' \
 >/ros_entrypoint.sh && chmod +x /ros_entrypoint.sh
"""
"""ROS's image where no registry gives it: ROS in a folder of its own, which the entry point makes known."""


@pytest.fixture(scope="module")
def ros_image() -> str:
    skip_without_docker()
    if image_is_there("ros:jazzy"):
        return "ros:jazzy"
    name = "nena-test/ros-stand-in"
    built = docker("build", "--quiet", "--tag", name, "-", text=STAND_IN, timeout=BUILD_SECONDS)
    assert built.returncode == 0, built.stderr
    return name


def test_agent_image_contains_ros(ros_image: str) -> None:
    name, file = "nena/edge-agent:jazzy-test", "services/edge_agent/Dockerfile.jazzy"
    arguments = ("--quiet", "--build-arg", f"ROS_IMAGE={ros_image}", "--tag", name, "--file", file, ".")
    built = docker("build", *arguments, timeout=BUILD_SECONDS)
    assert built.returncode == 0, built.stderr

    fence = ("--rm", "--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL")  # noqa: S108 - the container's own
    done = docker("run", *fence, name, "doctor", "--ros.domain_id", "99")

    assert done.returncode == 1
    assert "no other nodes in domain 99" in done.stdout, done.stdout + done.stderr
