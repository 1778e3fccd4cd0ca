"""Each rule of a site's access list, violated: what others send or receive does not get through.

Mosquitto grants every subscription and every publication, and withholds the messages. So each test ends with
an allowed message after the forbidden ones: what has not arrived before it never will.
"""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nena_deploy.identities import Kind
from nena_shared.mqtt import Outbound
from nena_shared.settings import MqttTlsSettings
from support.certificates import Authority
from support.running_site import (
    AGGREGATOR,
    HOST,
    ORDER_SERVICE,
    OTHER_HOST,
    ROBOT_1,
    ROBOT_2,
    Client,
    RunningSite,
    connected,
)
from support.waiting import PATIENCE, until

pytestmark = pytest.mark.broker

SCHEMES = ("uagv/v2", "vda5050/v3")
SAID_BY_ROBOTS = ("state", "visualization", "connection", "factsheet")
SAID_TO_ROBOTS = ("order", "instantActions", "zoneSet", "responses")
ALL = ("uagv/v2/#", "vda5050/v3/#", "nena/v1/#")

OF_ANOTHER_HOST = tuple(
    f"nena/v1/hosts/mes/{each}"
    for each in (
        "transportOrders/create",
        "transportOrders/answer",
        "commands/delivery",
        "commands/delivery/answer",
    )
)
TOLD_BY_THE_ORDER_SERVICE = (
    "nena/v1/plantModel",
    "nena/v1/transportOrders/T/status",
    "nena/v1/orderSequences/S/status",
    "nena/v1/vehicles/1/status",
    "nena/v1/hosts/wms/transportOrders/answer",
    "nena/v1/hosts/wms/commands/delivery/answer",
)
COMMANDS_OF_NOBODY = ("nena/v1/hosts/wms/commands/withdraw", "nena/v1/hosts/wms/commands/instantAction")


def of_robot(serial: str, *topics: str) -> list[str]:
    return [f"{scheme}/ACME/{serial}/{topic}" for scheme in SCHEMES for topic in topics]


def said_by_robot(serial: str) -> list[str]:
    own = f"nena/v1/robots/ACME/{serial}"
    return [*of_robot(serial, *SAID_BY_ROBOTS), f"{own}/map", f"{own}/recordings/chunk"]


async def all_came(client: Client, topics: Sequence[str]) -> None:
    await until(lambda: set(topics) <= set(client.topics), what=f"{topics} came; {client.topics}")


async def nothing_gets_through(running: RunningSite, who: tuple[Kind, str], *forbidden: str) -> None:
    """Publish as ``who``; the order service and the aggregator, who read it all, hear the others only."""
    marker = "nena/v1/transportOrders/M/status"
    async with (
        running.client(AGGREGATOR, *ALL) as watcher,
        running.client(ORDER_SERVICE, *ALL) as service,
        running.client(who) as client,
    ):
        client.publish(*forbidden)
        assert await client.link.drain(PATIENCE), "the broker has had all of it"
        service.publish(marker)
        await all_came(watcher, [marker])
        await all_came(service, [marker])

        assert (watcher.topics, service.topics) == ([marker], [marker])


@pytest.mark.parametrize("tls", ["no certificate", "a foreign authority's", "no TLS"])
async def test_client_without_a_site_certificate_is_rejected(running: RunningSite, tls: str) -> None:
    good = running.settings_in(running.folder_of(*ORDER_SERVICE))
    foreign = Authority(running.site.folder.parent, "foreign").sign("order-service")
    settings = {
        "no certificate": MqttTlsSettings(ca=good.tls.ca),
        "a foreign authority's": MqttTlsSettings(
            ca=good.tls.ca, certificate=foreign.certificate, key=foreign.key
        ),
        "no TLS": MqttTlsSettings(),
    }
    async with running.client(ORDER_SERVICE):
        pass  # the broker is there, and lets in whom it knows
    stranger = Client(good.model_copy(update={"tls": settings[tls]}), "stranger")

    async with connected(stranger):
        await until(lambda: stranger.link.state.last_error or stranger.link.state.connects)
        async with running.client(ORDER_SERVICE):
            pass  # it still is

    assert stranger.link.state.connects == 0


async def test_host_cannot_read_messages_of_hosts_or_robots(running: RunningSite) -> None:
    own, commands = "nena/v1/hosts/wms/transportOrders/answer", of_robot("1", *SAID_TO_ROBOTS)
    states, answers = said_by_robot("1"), [each for each in OF_ANOTHER_HOST if "answer" in each]
    async with (
        running.client(HOST, "#", *ALL, *OF_ANOTHER_HOST, *commands, *states) as host,
        running.client(OTHER_HOST, "nena/v1/hosts/#") as other,
        running.client(ROBOT_1, *commands) as robot,
        running.client(AGGREGATOR, *ALL) as watcher,
        running.client(ORDER_SERVICE) as service,
    ):
        robot.publish(*states)
        await all_came(watcher, states)
        service.publish(*OF_ANOTHER_HOST, *commands, own)
        await all_came(other, answers)
        await all_came(robot, commands)
        await all_came(host, [own])

        assert set(host.topics) == {own}


async def test_host_cannot_publish_for_robots_or_the_order_service(running: RunningSite) -> None:
    robots = [*said_by_robot("1"), *of_robot("1", *SAID_TO_ROBOTS)]
    forbidden = (*robots, *OF_ANOTHER_HOST, *TOLD_BY_THE_ORDER_SERVICE, *COMMANDS_OF_NOBODY)

    await nothing_gets_through(running, HOST, *forbidden)


async def test_robot_cannot_publish_for_others(running: RunningSite) -> None:
    own = of_robot("1", *SAID_TO_ROBOTS)
    neighbours = [*said_by_robot("2"), *of_robot("2", *SAID_TO_ROBOTS)]
    others = (*OF_ANOTHER_HOST, *TOLD_BY_THE_ORDER_SERVICE, *COMMANDS_OF_NOBODY)

    await nothing_gets_through(running, ROBOT_1, *own, *neighbours, *others)


async def test_robot_cannot_read_messages_of_others(running: RunningSite) -> None:
    own, commands = of_robot("1", "order"), of_robot("2", *SAID_TO_ROBOTS)
    states = said_by_robot("2")
    others = [*OF_ANOTHER_HOST, *TOLD_BY_THE_ORDER_SERVICE[1:]]
    async with (
        running.client(ROBOT_1, "#", *ALL, *commands, *states, *others) as robot,
        running.client(ROBOT_2, *commands) as neighbour,
        running.client(AGGREGATOR, *ALL) as watcher,
        running.client(ORDER_SERVICE) as service,
    ):
        neighbour.publish(*states)
        await all_came(watcher, states)
        service.publish(*commands, *others, *own)
        await all_came(neighbour, commands)
        await all_came(watcher, [*others, *own])
        await all_came(robot, own)

        assert set(robot.topics) == set(own)


async def test_aggregator_answers_the_robot_whose_recording_it_receives(running: RunningSite) -> None:
    own, others = (f"nena/v1/robots/ACME/{serial}/recordings/answer" for serial in "12")
    async with (
        running.client(ROBOT_1, own, others) as robot,
        running.client(ROBOT_2, others) as neighbour,
        running.client(AGGREGATOR) as aggregator,
    ):
        aggregator.publish(others, own)
        await all_came(neighbour, [others])
        await all_came(robot, [own])

        assert robot.topics == [own]


async def test_aggregator_pauses_robots_without_the_order_service(running: RunningSite) -> None:
    pauses, stop = of_robot("1", "instantActions"), "nena/v1/directStops/stop-1"
    async with (
        running.client(ROBOT_1, *pauses) as robot,
        running.client(ORDER_SERVICE, stop) as service,
        running.client(AGGREGATOR) as aggregator,
    ):
        aggregator.publish(*pauses, stop)
        await all_came(robot, pauses)
        await all_came(service, [stop])


async def test_aggregator_cannot_publish_anything_else(running: RunningSite) -> None:
    robots = [*said_by_robot("1"), *of_robot("1", "order", "zoneSet", "responses")]
    forbidden = (*robots, *OF_ANOTHER_HOST, *TOLD_BY_THE_ORDER_SERVICE, *COMMANDS_OF_NOBODY)

    await nothing_gets_through(running, AGGREGATOR, *forbidden, "nena/v1/hosts/wms/transportOrders/create")


async def test_order_service_cannot_publish_for_a_robot(running: RunningSite) -> None:
    await nothing_gets_through(running, ORDER_SERVICE, *of_robot("1", *SAID_BY_ROBOTS))


LONGEST = 16 * 1024 * 1024
"""Bytes of a message, as docs/security.md says."""
PLANT_OF_10_000_POINTS = 15_000_000
"""Bytes of its JSON."""


async def test_oversized_message_is_dropped_and_closes_the_connection(
    running: RunningSite,
) -> None:
    topic = "nena/v1/hosts/wms/transportOrders/create"
    async with running.client(ORDER_SERVICE, topic) as service, running.client(HOST) as host:
        host.link.publish(Outbound(topic, bytes(LONGEST + 1), keep=False))
        await until(lambda: host.link.state.connects == 2 or service.came)
        host.publish(topic)
        await until(lambda: service.came)

        assert [each.payload for each in service.came] == [topic.encode()]
        assert service.link.state.connects == 1, "nobody else has noticed"


async def test_large_plant_model_is_within_the_size_limit(running: RunningSite) -> None:
    topic = "nena/v1/plantModel"
    async with running.client(ORDER_SERVICE) as service, running.client(HOST, topic) as host:
        service.link.publish(Outbound(topic, bytes(PLANT_OF_10_000_POINTS), retain=True))
        await until(lambda: host.came or service.link.state.connects > 1)

        assert [len(each.payload) for each in host.came] == [PLANT_OF_10_000_POINTS]
        assert service.link.state.connects == 1
