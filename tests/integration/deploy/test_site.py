"""A site of nena-deploy at a real Mosquitto: who gets in, and what each may not do."""

from __future__ import annotations

import asyncio
import shutil
import signal
import ssl
from pathlib import Path

import psutil
import pytest
from typer.testing import CliRunner

from nena_deploy.commands import app
from nena_deploy.identities import Kind, SiteTopics, topics_of_robot
from nena_deploy.site import Site
from nena_edge_agent.messages import client_id_of
from nena_shared.mqtt import Outbound
from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from support.running_site import (
    AGGREGATOR,
    HOST,
    ORDER_SERVICE,
    ROBOT_1,
    ROBOT_2,
    Client,
    RunningSite,
    connected,
)
from support.waiting import PATIENCE, until

UAGV = TopicScheme("uagv", "v2")
pytestmark = pytest.mark.broker


async def test_the_main_job_is_possible(running: RunningSite) -> None:
    """Orders reach the robot that they are for, and its states everybody who is to see them."""
    state, order = "vda5050/v3/ACME/1/state", "vda5050/v3/ACME/1/order"
    asked, told = "nena/v1/hosts/wms/transportOrders/create", "nena/v1/transportOrders/T/status"
    async with (
        running.client(ROBOT_1, order) as robot,
        running.client(
            ORDER_SERVICE, "vda5050/v3/+/+/state", "nena/v1/hosts/+/transportOrders/create"
        ) as service,
        running.client(AGGREGATOR, "vda5050/v3/#", "nena/v1/#") as aggregator,
        running.client(HOST, "nena/v1/transportOrders/+/status") as host,
    ):
        host.publish(asked)
        await until(lambda: asked in service.topics)
        service.publish(order, told)
        await until(lambda: order in robot.topics and told in host.topics)
        robot.publish(state)
        await until(lambda: state in service.topics and state in aggregator.topics)


async def test_certificates_pass_strict_verification(running: RunningSite) -> None:
    """Verify them as CPython 3.13 does, whatever version runs this test."""
    async with running.client(ROBOT_2):
        pass  # the broker is there
    context = tls_context(running.settings_in(running.folder_of(*ROBOT_1)).tls)
    assert context is not None
    context.verify_flags |= ssl.VERIFY_X509_STRICT

    _, writer = await asyncio.open_connection("127.0.0.1", running.port, ssl=context)

    writer.close()


async def test_robot_can_neither_command_nor_impersonate_another(running: RunningSite) -> None:
    forbidden = [
        "uagv/v2/ACME/2/order",
        "uagv/v2/ACME/2/instantActions",
        "uagv/v2/ACME/2/state",
        "uagv/v2/ACME/1/order",
        "nena/v1/hosts/wms/transportOrders/create",
        "nena/v1/plantModel",
    ]
    async with (
        running.client(AGGREGATOR, "uagv/v2/#", "nena/v1/#") as watcher,
        running.client(ROBOT_2, "uagv/v2/ACME/2/order", "uagv/v2/ACME/2/instantActions") as neighbour,
        running.client(ROBOT_1) as robot,
    ):
        robot.publish(*forbidden, "uagv/v2/ACME/1/state")
        await until(lambda: watcher.came)

        assert watcher.topics == ["uagv/v2/ACME/1/state"], "what was sent before it never came"
        assert neighbour.came == []


async def test_robot_cannot_read_orders_of_others(running: RunningSite) -> None:
    async with (
        running.client(ROBOT_1, "uagv/v2/+/+/order", "#") as robot,
        running.client(ORDER_SERVICE) as service,
    ):
        service.publish("uagv/v2/ACME/2/order", "uagv/v2/ACME/1/order")
        await until(lambda: robot.came)

        assert set(robot.topics) == {"uagv/v2/ACME/1/order"}


async def test_host_can_neither_command_robots_nor_impersonate_another_host(running: RunningSite) -> None:
    async with (
        running.client(ORDER_SERVICE, "nena/v1/hosts/#") as service,
        running.client(ROBOT_1, "uagv/v2/ACME/1/order") as robot,
        running.client(HOST) as host,
    ):
        own = "nena/v1/hosts/wms/transportOrders/create"
        withdrawal = "nena/v1/hosts/wms/commands/withdraw"
        host.publish("uagv/v2/ACME/1/order", "nena/v1/hosts/mes/transportOrders/create", withdrawal, own)
        await until(lambda: service.came)

        assert service.topics == [own]
        assert robot.came == []


async def test_aggregator_is_read_only(running: RunningSite) -> None:
    async with (
        running.client(ROBOT_1, "uagv/v2/ACME/1/order") as robot,
        running.client(ORDER_SERVICE) as service,
        running.client(AGGREGATOR) as aggregator,
    ):
        aggregator.publish("uagv/v2/ACME/1/order")
        assert await aggregator.link.drain(PATIENCE)
        service.publish("uagv/v2/ACME/1/order")
        await until(lambda: robot.came)

        assert len(robot.came) == 1


async def test_removed_client_is_rejected(running: RunningSite, tmp_path: Path) -> None:
    shutil.copytree(running.folder_of(*ROBOT_1), tmp_path / "stolen")
    running.site.remove(*ROBOT_1)
    running.restart()
    async with running.client(ROBOT_2):
        pass  # the broker is there

    async with connected(Client(running.settings_in(tmp_path / "stolen"), "gone")) as gone:
        await until(lambda: gone.link.state.last_error)

        assert gone.link.state.connects == 0


async def test_added_client_has_its_rights_without_a_restart(running: RunningSite) -> None:
    new = (Kind.ROBOT, "ACME/3")
    async with running.client(AGGREGATOR, "uagv/v2/#") as watcher:
        running.site.add(*new, days=1)
        running.process.send_signal(signal.SIGHUP)
        async with running.client(new) as robot:
            robot.publish("uagv/v2/ACME/1/state", "uagv/v2/ACME/3/state")
            await until(lambda: watcher.came)

        assert watcher.topics == ["uagv/v2/ACME/3/state"]
        assert watcher.link.state.connects == 1, "nobody else has noticed"


async def test_robot_cannot_take_over_another_session(running: RunningSite) -> None:
    """A robot knows how client IDs are made, but has its own key, so it gets another ID."""
    one, two = (running.settings_in(running.folder_of(*each)) for each in (ROBOT_1, ROBOT_2))
    neighbour = RobotKey("ACME", "2")
    async with connected(Client(two, client_id_of(neighbour, UAGV, two))) as victim:
        await until(lambda: victim.link.state.connected)
        for stolen in (
            client_id_of(neighbour, UAGV, one),
            client_id_of(neighbour, UAGV, MqttSettings()),
        ):
            async with connected(Client(one, stolen)) as thief:
                await until(lambda thief=thief: thief.link.state.connected)  # type: ignore[misc] # bound at once
                thief.publish("uagv/v2/ACME/1/state")
                assert await thief.link.drain(PATIENCE)
        victim.publish("uagv/v2/ACME/2/state")
        assert await victim.link.drain(PATIENCE)

        assert victim.link.state.connects == 1


async def test_lost_site_is_restored_from_its_backup(running: RunningSite, tmp_path: Path) -> None:
    """Follow `docs/operations.md`: restored with its modes, and robots notice nothing."""
    stolen = shutil.copytree(running.folder_of(*ROBOT_2), tmp_path / "stolen")
    on_the_robot = shutil.copytree(running.folder_of(*ROBOT_1), tmp_path / "robot")
    running.site.remove(*ROBOT_2)
    folder = running.site.folder
    copy = shutil.make_archive(str(tmp_path / "copy"), "tar", folder)
    shutil.rmtree(folder)

    shutil.unpack_archive(copy, folder)
    running.restart()

    assert (folder / "authority").stat().st_mode & 0o077 == 0
    async with connected(Client(running.settings_in(on_the_robot), "robot")) as robot:
        await until(lambda: robot.link.state.connected)
    async with connected(Client(running.settings_in(stolen), "gone")) as gone:
        await until(lambda: gone.link.state.last_error)
        assert gone.link.state.connects == 0, "who was removed before the copy stays out"
    again = Site.open(folder)
    again.add(Kind.ROBOT, "ACME/9", days=1)
    assert {each.name for each in again} >= {"ACME/1", "ACME/9", "wms", "order-service"}


INVENTED = (
    "uagv/v2/ACME/1/nena/map",
    "nena/v1/robots/ACME/1/map/1",
    "uagv/v2/ACME/1/order",
    "uagv/v2/ACME/1",
)


async def test_robot_cannot_retain_messages_under_other_topics(running: RunningSite) -> None:
    own = "uagv/v2/ACME/1/state"
    async with running.client(ROBOT_1) as robot:
        for topic in (*INVENTED, own):
            robot.link.publish(Outbound(topic, bytes(1024), retain=True))
        assert await robot.link.drain(PATIENCE)
    async with running.client(AGGREGATOR, "uagv/v2/#", "vda5050/v3/#", "nena/v1/#") as watcher:
        await until(lambda: watcher.came)

        assert watcher.topics == [own]


MEGABYTE = 1024 * 1024
LONGEST = 16 * MEGABYTE - 1000
"""Bytes of a message that the broker just accepts."""


async def test_retained_messages_of_a_robot_are_limited(running: RunningSite) -> None:
    """The longest messages on all its topics: the broker refuses what is beyond its limit, and continues."""
    running.limit_memory(64 * MEGABYTE)
    topics = [*topics_of_robot(RobotKey("ACME", "1"), SiteTopics())]
    async with (
        running.client(ORDER_SERVICE, "uagv/v2/+/+/connection") as service,
        running.client(ROBOT_2) as neighbour,
    ):
        async with connected(Client(running.settings_in(running.folder_of(*ROBOT_1)), "flood")) as flood:
            for topic in topics:
                flood.link.publish(Outbound(topic, bytes(LONGEST), qos=1, retain=True))
            await until(lambda: flood.link.state.connects > 1, what="the broker refuses a message")
        neighbour.publish("uagv/v2/ACME/2/connection")
        await until(lambda: "uagv/v2/ACME/2/connection" in service.topics)

        assert psutil.Process(running.process.pid).memory_info().rss < 100 * MEGABYTE
        assert (service.link.state.connects, neighbour.link.state.connects) == (1, 1)


async def test_retained_messages_are_deleted_with_their_robot(running: RunningSite) -> None:
    own = ("uagv/v2/ACME/1/connection", "vda5050/v3/ACME/1/factsheet", "nena/v1/robots/ACME/1/map")
    async with running.client(ROBOT_1) as robot:
        for topic in own:
            robot.link.publish(Outbound(topic, b"mine", retain=True))
        assert await robot.link.drain(PATIENCE)
    async with running.client(ROBOT_2) as neighbour:
        neighbour.link.publish(Outbound("uagv/v2/ACME/2/connection", b"mine", retain=True))
        assert await neighbour.link.drain(PATIENCE)

    await asyncio.to_thread(_remove_robot, running.site.folder)

    async with running.client(AGGREGATOR, "uagv/v2/#", "vda5050/v3/#", "nena/v1/#") as watcher:
        await until(lambda: watcher.came)
        assert watcher.topics == ["uagv/v2/ACME/2/connection"]


def _remove_robot(site: Path) -> None:
    done = CliRunner().invoke(app, ["robot", "remove", str(site), "ACME", "1"])
    assert (done.exit_code, "cannot be reached" in done.stderr) == (0, False), done.stderr


def test_robot_is_removed_without_a_broker(running: RunningSite) -> None:
    running.end()
    done = CliRunner().invoke(app, ["robot", "remove", str(running.site.folder), "ACME", "1"])

    assert done.exit_code == 0
    assert "The broker still has retained messages of ACME/1: it cannot be reached" in done.stderr
    assert "ACME/1" not in {each.name for each in Site.open(running.site.folder)}
