"""Broker and PostgreSQL from the images that docker-compose.yml names, by testcontainers."""

from __future__ import annotations

import re
import secrets
import shutil
from typing import Final

from sqlalchemy import NullPool, create_engine
from sqlalchemy.exc import OperationalError
from testcontainers.community.postgres import PostgresContainer
from testcontainers.core.config import testcontainers_config
from testcontainers.core.container import DockerContainer

from support.broker import BrokerAddress, MqttPeer, free_port
from support.compose import ROOT, docker
from support.waiting import PATIENCE, wait_until

CONFIGURATION: Final = ROOT / "deploy/containers/mosquitto.conf"
UPTIME: Final = "$SYS/broker/uptime"
"""A topic that each broker has; who hears of it is let in and served."""

testcontainers_config.ryuk_disabled = True  # one more image that would have to be there; fixtures clean up


def image_of(variable: str) -> str:
    """Return the image that docker-compose.yml uses if its variable is not set."""
    found = re.search(
        rf"image: \$\{{{variable}:-(.+)\}}", (ROOT / "docker-compose.yml").read_text(encoding="utf-8")
    )
    assert found, f"docker-compose.yml has no image by {variable}"
    return found[1]


def why_not_there(image: str) -> str:
    """Return why no container can be made of an image, and what to do; empty: it can."""
    if not shutil.which("docker") or docker("info").returncode:
        return "no Docker Engine answers: install docker.io and start it"
    if docker("image", "inspect", image).returncode:
        return f"there is no image {image}: docker pull {image}"
    return ""


class _Container:
    """A container on one port of loopback, which it keeps while it is killed and started again."""

    def __init__(self, container: DockerContainer, inside: int, port: int) -> None:
        container.ports = {str(inside): ("127.0.0.1", port)}  # type: ignore[dict-item] # typed without addresses
        self._container = container.start().get_wrapped_container()

    def start(self) -> None:
        """Start it again, with what is on its disk."""
        self._container.start()

    def kill(self) -> None:
        """End it as a power cut would."""
        self._container.kill()
        self._container.wait(timeout=PATIENCE)

    def close(self) -> None:
        """Remove it and its disk."""
        self._container.remove(force=True, v=True)


class ImageBroker(BrokerAddress):
    """The broker of docker-compose.yml, with the configuration that it has there."""

    def __init__(self) -> None:
        super().__init__()
        container = DockerContainer(image_of("MOSQUITTO_IMAGE"))
        container.with_volume_mapping(CONFIGURATION, "/mosquitto/config/mosquitto.conf")
        self._container = _Container(container, 1883, self.port)
        wait_until(self._serves, what="the broker lets a client in")

    def start(self) -> None:
        """Start it again."""
        self._container.start()
        wait_until(self._serves, what="the broker lets a client in again")

    def kill(self) -> None:
        """End it as a power cut would."""
        self._container.kill()

    def close(self) -> None:
        """Remove it."""
        self._container.close()

    def _serves(self) -> bool:
        # Docker's end of the port takes connections before the broker does.
        try:
            with MqttPeer(self, UPTIME):
                return True
        except OSError:
            return False


class ImagePostgres:
    """PostgreSQL as docker-compose.yml has it."""

    def __init__(self) -> None:
        port, password = free_port(), secrets.token_hex(16)
        container = PostgresContainer(
            image_of("POSTGRES_IMAGE"), username="nena", password=password, dbname="nena"
        )
        self.url = f"postgresql+psycopg://nena:{password}@127.0.0.1:{port}/nena"
        """Where SQLAlchemy finds it."""
        self._container = _Container(container, 5432, port)
        wait_until(self._answers, what="PostgreSQL answers")

    def start(self) -> None:
        """Start it again."""
        self._container.start()
        wait_until(self._answers, what="PostgreSQL answers again")

    def stop(self) -> None:
        """End it as a power cut would."""
        self._container.kill()

    def close(self) -> None:
        """Remove it."""
        self._container.close()

    def _answers(self) -> bool:
        try:
            with create_engine(self.url, poolclass=NullPool).connect():
                return True
        except OperationalError:
            return False
