"""The whole stack in containers, by docker-compose, with images built from this tree."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import ssl
import subprocess
import sys
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml  # type: ignore[import-untyped]  # its stubs would be one more dependency

from support.broker import free_port
from support.guides import commands
from support.waiting import until

ROOT = Path(__file__).parents[2]
BASES = (
    "python:3.13-slim",
    "eclipse-mosquitto:2",
    "postgres:17",
    os.environ.get("PROMETHEUS_IMAGE", "prom/prometheus:v3.5.0"),
    os.environ.get("ALERTMANAGER_IMAGE", "prom/alertmanager:v0.28.1"),
)
SERVED_BY_NENA = ("REST_PORT", "PANEL_PORT")
PORTS = ("MQTT_PORT", "MQTTS_PORT", "REST_PORT", "PANEL_PORT", "PROMETHEUS_PORT", "ALERTMANAGER_PORT")
IN_POSTGRESQL = {
    "HISTORY_URL": "postgresql+psycopg://nena@postgres/nena",
    "STORE_URL": "postgresql://nena@postgres/nena",
}
"""As in docs/installation.md: one database for both services."""
BUILD_SECONDS = 1500.0
STARTED_WITHIN = 120.0


def skip_without_docker() -> None:
    """Skip the test with instructions if images cannot be built and run."""
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
    """A project of docker-compose with its own name and ports; ``close`` removes all but the images.

    ``variables`` are those of its files besides the ports.
    """

    def __init__(self, variables: Mapping[str, str]) -> None:
        self.ports = {name: free_port() for name in PORTS}
        self.name = f"nena-test-{secrets.token_hex(4)}"
        self.password = secrets.token_hex(16)
        self._token = ""
        self._site = Path(variables["SITE"]) if "SITE" in variables else None
        self._environment = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            **{name: str(port) for name, port in self.ports.items()},
            "COMPOSE_PROJECT_NAME": self.name,
            "NENA_VERSION": "compose-test",
            "POSTGRES_PASSWORD": self.password,
            **variables,
        }

    def run(self, *arguments: str, timeout: float = 120.0) -> str:
        """Run docker-compose; if it fails, the test fails with its output."""
        return self._run([*_compose_command(), *arguments], timeout)

    def shell(self, commands: str, timeout: float = 120.0) -> str:
        """Run a guide's commands for a shell, up to the first one that fails; the test fails with it."""
        plug_in = _compose_command() == ["docker", "compose"]
        known = 'docker-compose() { docker compose "$@"; }\n' if plug_in else ""
        return self._run(["bash", "-euo", "pipefail", "-c", known + commands], timeout)

    def follow(self, page: str, holding: str, backup: Path) -> None:
        """Run the one block of a guide's commands that holds a text, with another folder for its backups."""
        self.shell(commands(page, holding).replace("/backup/", f"{backup}/"))

    def _run(self, command: list[str], timeout: float) -> str:
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        assert done.returncode == 0, f"{command}:\n{done.stdout[-5000:]}\n{done.stderr[-5000:]}"
        return done.stdout

    def url(self, port: str) -> str:
        """Return the address of a published port by the name of its variable."""
        scheme = "https" if self._site and port in SERVED_BY_NENA else "http"
        return f"{scheme}://127.0.0.1:{self.ports[port]}"

    @cached_property
    def trust(self) -> ssl.SSLContext:
        """What trusts the certificates of a site's services."""
        return ssl.create_default_context(cafile=self._site / "broker" / "ca.pem" if self._site else None)

    def read(self, port: str, path: str) -> Any:
        """Return the JSON at a path of REST or panel, as a user; None while there is none."""
        return read(f"{self.url(port)}{path}", self.trust, **self.login)

    def containers(self) -> dict[str, dict[str, Any]]:
        """Return Docker's description of each container, by the service's name."""
        label = f"label=com.docker.compose.project={self.name}"
        found = docker("ps", "--all", "--quiet", "--filter", label).stdout.split()
        details = json.loads(docker("inspect", *found).stdout) if found else []
        return {each["Config"]["Labels"]["com.docker.compose.service"]: each for each in details}

    def health(self) -> dict[str, str]:
        """Return each container's health, or its state where it has no health check."""
        states = {name: each["State"] for name, each in self.containers().items()}
        return {
            name: state.get("Health", {}).get("Status", state["Status"]) for name, state in states.items()
        }

    async def all_healthy(self, names: set[str]) -> None:
        """Wait until exactly these containers exist and are healthy."""
        try:
            await until(
                lambda: (health := self.health()).keys() == names and set(health.values()) == {"healthy"},
                timeout=STARTED_WITHIN,
                what="health of every container",
            )
        except AssertionError as error:
            text = f"{self.health()}\n{self.logs()}"
            raise AssertionError(text) from error

    def lose_volume(self, service: str, volume: str) -> None:
        """Remove a service's container and its data."""
        self.run("rm", "--force", "--stop", service)
        removed = docker("volume", "rm", f"{self.name}_{volume}")
        assert removed.returncode == 0, removed.stderr

    def execute(self, service: str, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command in a container."""
        return docker("exec", self.containers()[service]["Id"], *command)

    @property
    def login(self) -> dict[str, str]:
        """Headers of requests to REST API and panel, with the token that the first start created."""
        if not self._token:
            file = "/var/lib/nena-access/users.toml.token"
            self._token = self.execute("order-service", "cat", file).stdout.strip()
        return {"authorization": f"Bearer {self._token}"}

    def create(self, *destinations: tuple[str, str]) -> str:
        """Create a transport order from locations and operations; return its name."""
        body = {"destinations": [{"locationName": place, "operation": done} for place, done in destinations]}
        answer = httpx.post(
            f"{self.url('REST_PORT')}/v1/transportOrders",
            json=body,
            headers=self.login,
            timeout=10.0,
            verify=self.trust,
        )
        assert answer.is_success, answer.text
        name: str = answer.json()["name"]
        return name

    def order(self, name: str) -> dict[str, Any] | None:
        """Return a transport order, or None while the order service does not answer."""
        order: dict[str, Any] | None = self.read("REST_PORT", f"/v1/transportOrders/{name}")
        return order

    def logs(self) -> str:
        """Return the recent log lines of all containers."""
        return self.run("logs", "--no-color", "--tail", "30")

    def close(self) -> None:
        """Remove containers, networks and volumes."""
        self.run("--profile", "demo", "--profile", "postgres", "down", "--volumes", "--remove-orphans")


def site_environment(service: str) -> dict[str, Any]:
    """Return a service's environment by the files for a site, as docker-compose merges them."""
    found: dict[str, Any] = {}
    for name in ("docker-compose.yml", "docker-compose.site.yml"):
        found |= yaml.safe_load((ROOT / name).read_text())["services"][service]["environment"]
    return found


def names_certified(service: str) -> tuple[str, ...]:
    """Return the names for which the guide makes a service's HTTPS certificate."""
    guide = commands("installation.md", "$SITE --host")
    (hosts,) = re.findall(rf"^nena-deploy https \$SITE {service} (.*)$", guide, re.MULTILINE)
    return tuple(re.findall(r"--host (\S+)", hosts))


def read(url: str, trust: ssl.SSLContext | bool = True, **headers: str) -> Any:  # noqa: FBT001, FBT002 - httpx's
    """Return the JSON at a URL; None if unavailable."""
    try:
        answer = httpx.get(url, headers=headers, timeout=5.0, verify=trust)
    except httpx.HTTPError:
        return None
    return answer.json() if answer.is_success else None


def _compose_command() -> list[str]:
    if docker("compose", "version").returncode == 0:
        return ["docker", "compose"]
    return ["docker-compose"] if shutil.which("docker-compose") else []


def image_is_there(image: str) -> bool:
    """Return whether an image is present or can be pulled."""
    if docker("image", "inspect", image).returncode == 0:
        return True
    return docker("pull", "--quiet", image, timeout=300).returncode == 0


def docker(*arguments: str, timeout: float = 60.0, text: str = "") -> subprocess.CompletedProcess[str]:
    """Run a Docker command in the project's root; ``text`` is its standard input."""
    command = ["docker", *arguments]
    return subprocess.run(
        command, cwd=ROOT, input=text, capture_output=True, text=True, timeout=timeout, check=False
    )
