"""Brokers that end the connection at a message or a subscription: it is set aside, and all others go on."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from nena_order_service.service import readiness
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.mqtt import LinkHooks, MqttLink, Outbound
from support.broker import Broker, BrokerAddress, MqttPeer
from support.brokers import REFUSED, Nats, RabbitMq
from support.pausing import time_passes
from support.waiting import until

pytestmark = pytest.mark.broker

BIG = b"x" * 50_000
AT_ONCE = 20


@asynccontextmanager
async def running(link: MqttLink) -> AsyncIterator[MqttLink]:
    task = asyncio.create_task(link.run(), name="link")
    try:
        await until(lambda: link.state.connected, what="the link's connection")
        yield link
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
def narrow_mosquitto() -> Iterator[Broker]:
    """Yield a Mosquitto that ends connections at messages of more than 20 kB."""
    broker = Broker(more="max_packet_size 20000\n")
    yield broker
    broker.close()


async def refused_topic_is_set_aside(broker: BrokerAddress, prefix: str, topic: str, payload: bytes) -> None:
    """Publish messages that the broker accepts around ones that it refuses, with each quality of service."""
    with MqttPeer(broker, f"{prefix}/#") as peer:
        async with running(MqttLink(broker.settings, client_id=prefix)) as link:
            for number, (qos, keep) in enumerate(((1, True), (1, False), (0, True), (0, False))):
                await until(lambda: link.state.connected)
                for innocent in range(AT_ONCE):
                    link.publish(Outbound(f"{prefix}/{innocent % 5}", b"%d %d" % (number, innocent)))
                    if innocent == AT_ONCE // 2:
                        link.publish(Outbound(topic, payload, qos=qos, keep=keep, retain=qos == 1))

            while (
                topic not in link.state.set_aside
            ):  # sent again with other content, as the protocols above do
                link.publish(Outbound(topic, payload + b"newer", keep=False))
                await time_passes(0.05)
            await until(lambda: link.state.connected)
            connects = link.state.connects
            for _ in range(100):
                link.publish(Outbound(topic, payload + b"newest"))
            link.publish(Outbound(f"{prefix}/last", b""))
            await peer.wait_for(f"{prefix}/last")

            assert list(link.state.set_aside) == [topic]
            assert link.state.set_aside[topic] >= 100
            assert link.state.connects == connects <= 8
        every = {b"%d %d" % (number, innocent) for number in range(4) for innocent in range(AT_ONCE)}
        assert every <= set(peer.payloads()), "nothing else is lost"


@pytest.mark.parametrize("name", ["WMS-2.1", "Goods in", "a.b.c"])
async def test_nats_refuses_a_topic(nats: Nats, interface_name: str, name: str) -> None:
    await refused_topic_is_set_aside(nats, interface_name, f"other-{interface_name}/{name}", b"x")


async def test_rabbitmq_refuses_a_topic_by_its_access_list(rabbitmq: RabbitMq, interface_name: str) -> None:
    await refused_topic_is_set_aside(rabbitmq, interface_name, f"{REFUSED}/{interface_name}", b"x")


async def test_mosquitto_refuses_a_long_message(narrow_mosquitto: Broker, interface_name: str) -> None:
    await refused_topic_is_set_aside(narrow_mosquitto, interface_name, "other/map", BIG)


async def test_a_refused_first_message_of_each_connection_is_set_aside(
    narrow_mosquitto: Broker, interface_name: str
) -> None:
    """As the plant model is."""
    greeting = [Outbound(f"{interface_name}/{number}", b"hello", retain=True) for number in range(10)]
    greeting.insert(5, Outbound("plant", BIG, retain=True))
    hooks = LinkHooks(on_connected=lambda: greeting)
    link = MqttLink(narrow_mosquitto.settings, client_id=interface_name, hooks=hooks)
    with MqttPeer(narrow_mosquitto, f"{interface_name}/#") as peer:
        async with running(link):
            await until(lambda: "plant" in link.state.set_aside)
            await peer.wait_for(f"{interface_name}/9")
            await until(lambda: link.state.connected)
            link.publish(Outbound(f"{interface_name}/last", b""))
            await peer.wait_for(f"{interface_name}/last")
    assert list(link.state.set_aside) == ["plant"]


async def test_a_set_aside_topic_is_logged_and_shown_while_the_service_stays_ready(
    narrow_mosquitto: Broker, interface_name: str, tmp_path: Path
) -> None:
    url = f"sqlite:///{tmp_path}/orders.db"
    store = Store(open_database(url), InstanceLock.take(url))
    with capture_logs() as logs:
        async with running(MqttLink(narrow_mosquitto.settings, client_id=interface_name)) as link:
            link.publish(Outbound("some/map", BIG))
            await until(lambda: link.state.set_aside)
            await until(lambda: link.state.connected)
            told = readiness(link, store)
    store.close()
    assert [each["topic"] for each in logs if each["log_level"] == "error"] == ["some/map"]
    assert told.ready
    assert any("some/map" in problem for problem in told.problems)


@pytest.mark.parametrize("qos", [0, 1])
async def test_a_broker_that_dies_again_and_again_is_no_refusal(
    own_broker: Broker, interface_name: str, qos: int
) -> None:
    async with running(MqttLink(own_broker.settings, client_id=interface_name)) as link:
        for death in range(4):
            connects = link.state.connects
            own_broker.freeze()
            for number in range(1 if death % 2 else 30):
                link.publish(Outbound(f"a/{number}", b"x", qos=qos))
            own_broker.kill()
            own_broker.start()
            await until(lambda connects=connects: link.state.connects > connects)  # type: ignore[misc] # bound at once
        with MqttPeer(own_broker, "a/#") as peer:
            for number in range(30):
                link.publish(Outbound(f"a/{number}", b"last", qos=qos))
                await peer.wait_for(f"a/{number}", lambda each: each.payload == b"last")
        assert link.state.set_aside == {}


async def test_rabbitmq_ends_the_connection_at_a_subscription_that_the_link_names(
    rabbitmq: RabbitMq, interface_name: str
) -> None:
    link = MqttLink(rabbitmq.settings, client_id=interface_name)
    link.subscribe(f"{interface_name}/a", lambda _: None)
    link.subscribe(f"{REFUSED}/{interface_name}", lambda _: None)
    link.subscribe(f"{interface_name}/b", lambda _: None)
    task = asyncio.create_task(link.run())
    with capture_logs() as logs:
        await until(lambda: f"{REFUSED}/{interface_name}" in link.state.last_error)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert any(f"{REFUSED}/{interface_name}" in each.get("reason", "") for each in logs)


async def test_a_program_works_without_a_subscription_that_it_does_not_need(
    rabbitmq: RabbitMq, interface_name: str
) -> None:
    """Several of them cost two connections, and not two each."""
    link = MqttLink(rabbitmq.settings, client_id=interface_name)
    heard: list[str] = []
    for number in range(5):
        link.subscribe(f"{REFUSED}/{interface_name}/{number}", lambda _: None, needed=False)
    link.subscribe(f"{interface_name}/a", lambda each: heard.append(each.topic))
    with capture_logs() as logs:
        async with running(link):
            link.publish(Outbound(f"{interface_name}/a", b"x"))
            await until(lambda: heard)
    reasons = [each["reason"] for each in logs if f"{REFUSED}/{interface_name}/" in each.get("reason", "")]
    assert len(reasons) == 1, "the second end has the same reason, which is logged once"
