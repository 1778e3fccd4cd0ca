"""A site of nena-deploy with a real Mosquitto that uses the site's files, and its clients."""

from __future__ import annotations

import asyncio
import getpass
import re
import signal
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import count
from pathlib import Path, PurePosixPath

from nena_deploy.identities import Kind, SiteTopics
from nena_deploy.site import Site
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings, MqttTlsSettings
from support.broker import free_port, mosquitto
from support.waiting import PATIENCE, until

ROBOT_1 = (Kind.ROBOT, "ACME/1")
ROBOT_2 = (Kind.ROBOT, "ACME/2")
HOST = (Kind.HOST, "wms")
OTHER_HOST = (Kind.HOST, "mes")
ORDER_SERVICE = (Kind.ORDER_SERVICE, "order-service")
AGGREGATOR = (Kind.STATUS_AGGREGATOR, "status-aggregator")


class Client:
    """A client at the site's broker, and the messages that it received."""

    def __init__(self, settings: MqttSettings, name: str, *filters: str) -> None:
        self.link = MqttLink(settings, client_id=name)
        self.came: list[Inbound] = []
        for each in filters:
            self.link.subscribe(each, self.came.append)

    def publish(self, *topics: str) -> None:
        """Publish under each topic; the payload is the topic."""
        for topic in topics:
            self.link.publish(Outbound(topic, topic.encode()))

    @property
    def topics(self) -> list[str]:
        """Topics of the received messages."""
        return [each.topic for each in self.came]


def identity_in(folder: Path) -> MqttTlsSettings:
    """Return the settings that nena-deploy has written for an identity."""
    return MqttTlsSettings(
        ca=folder / "ca.pem", certificate=folder / "certificate.pem", key=folder / "key.pem"
    )


class RunningSite:
    """A site with its broker."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self._numbers = count()
        data = folder / "data"
        data.mkdir()
        self.site = Site.new(
            folder / "site",
            hosts=("127.0.0.1",),
            port=self.port,
            topics=SiteTopics(),
            days=1,
            data_folder=PurePosixPath(data),
        )
        for kind, name in (ROBOT_1, ROBOT_2, HOST, OTHER_HOST):
            self.site.add(kind, name, days=1)
        self._configuration = folder / "mosquitto.conf"
        made = (self.site.folder / "broker" / "mosquitto.conf").read_text()
        own = f"user {getpass.getuser()}\nlistener {self.port} 127.0.0.1"
        self._configuration.write_text(made.replace(f"listener {self.port}", own))
        self.process = self._start()

    def restart(self) -> None:
        """Restart the broker with the current files of the site."""
        self.end()
        self.process = self._start()

    def limit_memory(self, limit: int) -> None:
        """Restart the broker with another memory limit than the site's, bytes."""
        limits = re.compile(r"^memory_limit \d+$", re.MULTILINE)
        text, found = limits.subn(f"memory_limit {limit}", self._configuration.read_text())
        assert found == 1, "the site limits the broker's memory"
        self._configuration.write_text(text)
        self.restart()

    def end(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(PATIENCE)

    def folder_of(self, kind: Kind, name: str) -> Path:
        identity = next(each for each in self.site if (each.kind, each.name) == (kind, name))
        return self.site.folder_of(identity)

    def settings_in(self, folder: Path) -> MqttSettings:
        return MqttSettings(port=self.port, tls=identity_in(folder), reconnect_min=0.05, reconnect_max=0.2)

    @asynccontextmanager
    async def client(self, who: tuple[Kind, str], *filters: str) -> AsyncIterator[Client]:
        """Connect as a client, until the block ends."""
        name = f"{who[1]}-{next(self._numbers)}"  # client IDs must be unique
        async with connected(Client(self.settings_in(self.folder_of(*who)), name, *filters)) as client:
            await until(lambda: client.link.state.connected, what=f"{who[1]} is let in")
            yield client

    def _start(self) -> subprocess.Popen[bytes]:
        command = [mosquitto(), "-c", str(self._configuration)]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@asynccontextmanager
async def connected(client: Client) -> AsyncIterator[Client]:
    task = asyncio.create_task(client.link.run())
    try:
        yield client
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
