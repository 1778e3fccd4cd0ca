"""Find out what a broker lacks, over a connection of its own.

MQTT 3.1.1 requires both, but RabbitMQ 3.10 delivers no retained messages to subscriptions with wildcards, and
changes a ``.`` in topics to a ``/``; NATS 2.9 refuses topics with ``.`` or a space (docs/brokers.md).
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from enum import StrEnum
from typing import Final

from nena_shared.mqtt.client import Client, Inbound, MqttError, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end

ANSWERED_WITHIN: Final = 5.0
"""Timeout of CONNECT and SUBSCRIBE, seconds."""

DELIVERED_WITHIN: Final = 2.0
"""Seconds within which a broker delivers a message."""


class BrokerLack(StrEnum):
    """What a broker does not do."""

    RETAINED = "retained"
    NAMES = "names"


LACKS: Final[Mapping[BrokerLack, str]] = {
    BrokerLack.RETAINED: (
        "This MQTT broker delivers no retained messages to wildcard subscriptions (as RabbitMQ). Statuses "
        "may be up to 15 s old after a start, and robots that the plant model does not have are missing "
        "until they connect again. See docs/brokers.md."
    ),
    BrokerLack.NAMES: (
        "This MQTT broker refuses or changes topics with '.' or a space (as NATS and RabbitMQ): robots with "
        "these in manufacturer or serial number cannot be reached. Rename them, or use another broker. See "
        "docs/brokers.md."
    ),
}


class UntestableError(Exception):
    """The broker delivers not even a message to its exact topic; its access list may withhold it."""


async def find_lacks(
    settings: MqttSettings, client_id: str, place: str, signs: str = ""
) -> tuple[BrokerLack, ...]:
    """Return what the broker lacks.

    Args:
        settings: address and login.
        client_id: MQTT client ID of the connections, which no other client uses.
        place: prefix of the topics that are used; nothing stays retained there.
        signs: characters in names of robots that are tried in a topic.

    Raises:
        UntestableError: the program may not publish or subscribe there.
        MqttError: the broker did not answer, or ended the connection, as RabbitMQ does without permission.
        OSError: the broker cannot be reached.
    """
    lacks = []
    topic = f"{place}/retained"
    clearing = Outbound(topic, b"", retain=True)
    # also as the will, so that nothing stays if the connection ends in between
    async with _connected(settings, client_id, will=clearing) as (client, arrived):
        await client.subscribe([(topic, 1)])
        client.send(Outbound(topic, b"1", retain=True), _ignore)
        if not await _holds(client, lambda: bool(arrived)):
            client.send(clearing, _ignore)
            raise UntestableError("the broker delivered no message to its exact topic")
        await client.subscribe([(f"{place}/+", 1)])
        if not await _holds(client, lambda: any(message.retained for message in arrived)):
            lacks.append(BrokerLack.RETAINED)
        client.send(clearing, _ignore)
    for sign in signs:
        tried = f"{place}/a{sign}b"
        if await topic_of_delivery(settings, client_id, tried) != tried:
            lacks.append(BrokerLack.NAMES)
            break
    return tuple(lacks)


async def topic_of_delivery(settings: MqttSettings, client_id: str, topic: str) -> str:
    """Return the topic on which a message to ``topic`` arrives; empty if it does not.

    RabbitMQ changes a topic with a dot, NATS refuses it or ends the connection, Mosquitto 2.0.11 leaves the
    ``mount_point`` of its listener in front of it; an access list may withhold the message.
    """
    with suppress(MqttError):
        async with _connected(settings, client_id) as (client, arrived):
            granted = await client.subscribe([(topic, 1)])
            if not getattr(granted[0], "is_failure", False):
                client.send(Outbound(topic, b"1"), _ignore)
                await _holds(client, lambda: bool(arrived))
                return arrived[0].topic if arrived else ""
    return ""


@asynccontextmanager
async def _connected(
    settings: MqttSettings, client_id: str, *, will: Outbound | None = None
) -> AsyncIterator[tuple[Client, list[Inbound]]]:
    arrived: list[Inbound] = []
    settings = settings.model_copy(update={"client_id": None})
    async with Client(settings, client_id, timeout=ANSWERED_WITHIN, will=will) as client:
        receiving = asyncio.create_task(client.receive(arrived.append), name="broker check")
        try:
            yield client, arrived
        finally:
            await end(receiving)


async def _holds(client: Client, condition: Callable[[], bool]) -> bool:
    with suppress(TimeoutError):
        async with asyncio.timeout(DELIVERED_WITHIN):
            await client.wait_until(condition)
            return True
    return False


def _ignore() -> None:
    """Ignore an acknowledgement."""
