"""A robot with a fault: an honest agent behind a bridge that changes what it says or hears."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from nena_conversations.broker import BrokerAddress, connect_broker
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from support.broker import Broker

Message = dict[str, Any]
Change = Callable[[Topic, Message], Message | None]
"""Changes a message; None: it is lost."""

SAID = (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET, Topic.VISUALIZATION)
HEARD = (Topic.ORDER, Topic.INSTANT_ACTIONS)


def honest(_topic: Topic, message: Message) -> Message:
    return message


@asynccontextmanager
async def mutant(
    broker: Broker,
    honest_interface: str,
    interface: str,
    robot: RobotKey,
    codec: Codec,
    *,
    says: Change = honest,
    hears: Change = honest,
    retained: bool = True,
) -> AsyncIterator[TopicScheme]:
    """Show the agent of one interface under another one, with changed messages; yield its topics."""
    inner = TopicScheme(honest_interface, codec.major_version)
    outer = TopicScheme(interface, codec.major_version)
    address = BrokerAddress(MqttSettings(host=broker.host, port=broker.port), ())

    async with connect_broker(address, f"mutant-{interface}") as link:

        def pass_on(topic: Topic, target: TopicScheme, change: Change) -> Callable[[Inbound], None]:
            def handle(inbound: Inbound) -> None:
                try:
                    message = json.loads(inbound.payload)
                except ValueError:
                    payload: bytes | None = inbound.payload
                else:
                    changed = change(topic, message)
                    payload = None if changed is None else json.dumps(changed).encode()
                keep = retained and topic in (Topic.CONNECTION, Topic.FACTSHEET)
                if payload is not None:
                    link.publish(Outbound(target.of(robot, topic), payload, qos=1, retain=keep))

            return handle

        for topic in SAID:
            link.subscribe(inner.of(robot, topic), pass_on(topic, outer, says))
        for topic in HEARD:
            link.subscribe(outer.of(robot, topic), pass_on(topic, inner, hears))
        yield outer
        link.publish(Outbound(outer.of(robot, Topic.CONNECTION), b"", qos=1, retain=True))
        link.publish(Outbound(outer.of(robot, Topic.FACTSHEET), b"", qos=1, retain=True))
        await link.drain(5.0)
