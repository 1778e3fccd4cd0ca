"""The link over TLS to a real Mosquitto: which servers and clients are accepted, and that messages flow as
before.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.mqtt.client import NOT_ACCEPTED
from nena_shared.settings import MqttSettings, MqttTlsSettings
from support.broker import Broker, MqttPeer, free_port
from support.certificates import Authority
from support.waiting import until

pytestmark = pytest.mark.broker

LISTENER = """
listener {port} 127.0.0.1
cafile {ca}
certfile {files.certificate}
keyfile {files.key}
require_certificate {wanted}
use_identity_as_username {wanted}
"""


class Site:
    """A broker with a TLS door for everybody and one for those with a certificate."""

    def __init__(self, folder: Path) -> None:
        self.authority = Authority(folder)
        server = self.authority.sign("broker")
        self.open_door, self.strict_door = free_port(), free_port()
        doors = ((self.open_door, "false"), (self.strict_door, "true"))
        more = "".join(
            LISTENER.format(port=port, ca=self.authority.ca, files=server, wanted=wanted)
            for port, wanted in doors
        )
        self.broker = Broker(more=more)

    def settings(self, port: int, tls: MqttTlsSettings) -> MqttSettings:
        return self.broker.settings.model_copy(update={"port": port, "tls": tls})


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    found = Site(tmp_path_factory.mktemp("tls"))
    yield found
    found.broker.close()


@asynccontextmanager
async def running(link: MqttLink) -> AsyncIterator[None]:
    task = asyncio.create_task(link.run())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_many_large_messages_are_delivered_in_both_directions(site: Site, interface_name: str) -> None:
    link = MqttLink(
        site.settings(site.open_door, MqttTlsSettings(ca=site.authority.ca)), client_id=interface_name
    )
    came: list[Inbound] = []
    link.subscribe(f"{interface_name}/in", came.append)
    large = b"x" * 200_000
    async with running(link):
        await until(lambda: link.state.connected)
        with MqttPeer(site.broker, f"{interface_name}/out") as peer:
            for number in range(500):
                link.publish(Outbound(f"{interface_name}/out", b"%d" % number))
                peer.publish(f"{interface_name}/in", b"%d" % number)
            peer.publish(f"{interface_name}/in", large)
            link.publish(Outbound(f"{interface_name}/out", large))
            await until(lambda: len(came) > 500 and len(peer.payloads()) > 500)

            expected = [*(b"%d" % number for number in range(500)), large]
            assert peer.payloads() == expected
            assert [each.payload for each in came] == expected


async def test_client_is_identified_by_its_certificate(site: Site, interface_name: str) -> None:
    robot = site.authority.sign(f"robot-{interface_name}")
    tls = MqttTlsSettings(ca=site.authority.ca, certificate=robot.certificate, key=robot.key)
    link = MqttLink(site.settings(site.strict_door, tls), client_id=interface_name)
    async with running(link):
        await until(lambda: link.state.connected)

    name = f"as {interface_name} (p2, c1, k15, u'robot-{interface_name}')"
    await until(lambda: name in site.broker.log, what="the name in the broker's log")


async def test_connection_without_a_certificate_is_rejected(site: Site, interface_name: str) -> None:
    tls = MqttTlsSettings(ca=site.authority.ca)
    link = MqttLink(site.settings(site.strict_door, tls), client_id=interface_name)
    async with running(link):
        await until(lambda: link.state.last_error)

        assert NOT_ACCEPTED in link.state.last_error
        assert not link.state.connected
        assert link.state.connects == 0


@pytest.mark.parametrize("stranger", ["authority", "name"])
async def test_untrusted_broker_receives_nothing(
    site: Site, stranger: str, interface_name: str, tmp_path: Path
) -> None:
    """Neither another authority's word counts, nor a certificate for another host."""
    other = Authority(tmp_path, "other")
    settings = site.settings(
        site.open_door, MqttTlsSettings(ca=other.ca if stranger == "authority" else site.authority.ca)
    )
    if stranger == "name":
        settings = settings.model_copy(update={"host": "localhost"})  # its certificate names 127.0.0.1
    link = MqttLink(settings, client_id=interface_name)
    async with running(link):
        await until(lambda: link.state.last_error)

        assert "CERTIFICATE_VERIFY_FAILED" in link.state.last_error
        assert link.state.connects == 0
