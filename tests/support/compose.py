"""The whole stack in containers, by docker-compose, with images built from this tree."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from support.broker import free_port

ROOT = Path(__file__).parents[2]
BASES = ("python:3.13-slim", "eclipse-mosquitto:2", "postgres:17", "prom/prometheus")
PORTS = ("MQTT_PORT", "REST_PORT", "PANEL_PORT", "PROMETHEUS_PORT")
BUILD_SECONDS = 1500.0


def skip_without_docker() -> None:
    """Skip the test, and say what to do, where images cannot be built and run."""
    if "NENA_COMPOSE_TEST" not in os.environ:
        pytest.skip("builds every image, which takes minutes: `make compose-test` runs it")
    if not shutil.which("docker") or docker("info").returncode:
        pytest.skip("no Docker Engine answers: install docker.io and start it")
    if not _compose_command():
        pytest.skip("docker-compose is not installed: apt-get install docker-compose")
    for image in BASES:
        if not image_is_there(image):
            pytest.skip(f"there is no image {image}, and no registry gives it")


class Compose:
    """A project of docker-compose with a name and ports of its own; ``close`` removes all but the images."""

    def __init__(self) -> None:
        self.ports = {name: free_port() for name in PORTS}
        self.name = f"nena-test-{secrets.token_hex(4)}"
        self.password = secrets.token_hex(16)
        self._environment = {
            **os.environ,
            **{name: str(port) for name, port in self.ports.items()},
            "COMPOSE_PROJECT_NAME": self.name,
            "NENA_VERSION": "compose-test",
            "POSTGRES_PASSWORD": self.password,
            "HISTORY_URL": "postgresql+psycopg://nena@postgres/nena",
            "STORE_URL": "postgresql://nena@postgres/nena",
        }

    def run(self, *arguments: str, timeout: float = 120.0) -> str:
        """Run docker-compose; the test fails, with what it said, when it fails."""
        command = [*_compose_command(), *arguments]
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        assert done.returncode == 0, f"{command}:\n{done.stdout[-5000:]}\n{done.stderr[-5000:]}"
        return done.stdout

    def url(self, port: str) -> str:
        """Give the address of a door by the name of its port variable."""
        return f"http://127.0.0.1:{self.ports[port]}"

    def containers(self) -> dict[str, dict[str, Any]]:
        """Give what Docker knows of each container, by the service's name."""
        label = f"label=com.docker.compose.project={self.name}"
        found = docker("ps", "--all", "--quiet", "--filter", label).stdout.split()
        details = json.loads(docker("inspect", *found).stdout) if found else []
        return {each["Config"]["Labels"]["com.docker.compose.service"]: each for each in details}

    def health(self) -> dict[str, str]:
        """Give each container's health, or its state where it has no health check."""
        states = {name: each["State"] for name, each in self.containers().items()}
        return {
            name: state.get("Health", {}).get("Status", state["Status"]) for name, state in states.items()
        }

    def execute(self, service: str, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command in a container."""
        return docker("exec", self.containers()[service]["Id"], *command)

    @property
    def login(self) -> dict[str, str]:
        """The header of requests to REST and panel: the token that the first start has made."""
        token = self.execute("order-service", "cat", "/var/lib/nena-access/users.toml.token").stdout.strip()
        return {"authorization": f"Bearer {token}"}

    def logs(self) -> str:
        """Give what all of them logged of late."""
        return self.run("logs", "--no-color", "--tail", "30")

    def close(self) -> None:
        """Remove containers, networks and volumes."""
        self.run("--profile", "demo", "--profile", "postgres", "down", "--volumes", "--remove-orphans")


def _compose_command() -> list[str]:
    if docker("compose", "version").returncode == 0:
        return ["docker", "compose"]
    return ["docker-compose"] if shutil.which("docker-compose") else []


def image_is_there(image: str) -> bool:
    """Tell whether an image is here or comes when it is asked for."""
    if docker("image", "inspect", image).returncode == 0:
        return True
    return docker("pull", "--quiet", image, timeout=300).returncode == 0


def docker(*arguments: str, timeout: float = 60.0, text: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command of Docker's in the project's root; ``text`` is what it reads."""
    command = ["docker", *arguments]
    return subprocess.run(
        command, cwd=ROOT, input=text, capture_output=True, text=True, timeout=timeout, check=False
    )
