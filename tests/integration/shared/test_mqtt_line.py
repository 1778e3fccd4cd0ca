"""The proxy that understands MQTT does to messages what it claims, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.broker import Broker, MqttPeer
from support.mqtt_line import Conduct, MqttLine, Way, mqtt_line
from support.waiting import until

COUNT = 20


@pytest.fixture
def line(broker: Broker) -> Iterator[MqttLine]:
    with mqtt_line(broker) as made:
        yield made


async def sent(broker: Broker, line: MqttLine, topic: str, conduct: Conduct) -> list[bytes]:
    """Return what comes of messages under a conduct, up to a last one for which the line is fine again."""
    with MqttPeer(line, topic) as far, MqttPeer(broker) as near:
        near.publish(topic, "first")
        await far.wait_for(topic, lambda each: each.payload == b"first")
        line.conduct = conduct
        seen = line.messages
        for number in range(COUNT):
            near.publish(topic, f"{number:02}")
        if Way.FROM_BROKER not in conduct.held:
            await until(lambda: line.messages >= seen + COUNT, what="the messages have come to the line")
        line.conduct = Conduct()
        near.publish(topic, "last")
        await far.wait_for(topic, lambda each: each.payload == b"last")
        return far.payloads(topic)[1:-1]


ALL = [f"{number:02}".encode() for number in range(COUNT)]


@pytest.mark.parametrize(
    "conduct",
    [Conduct(), Conduct(delay=0.005), Conduct(held={Way.FROM_BROKER}), Conduct(held={Way.TO_BROKER})],
)
async def test_delayed_or_held_messages_arrive_unchanged(
    broker: Broker, line: MqttLine, interface_name: str, conduct: Conduct
) -> None:
    assert await sent(broker, line, interface_name, conduct) == ALL


async def test_repeated_message_arrives_twice(broker: Broker, line: MqttLine, interface_name: str) -> None:
    conduct = Conduct(repeated=1.0)
    assert await sent(broker, line, interface_name, conduct) == sorted(ALL * 2)


async def test_swapped_messages_arrive_in_another_order(
    broker: Broker, line: MqttLine, interface_name: str
) -> None:
    conduct = Conduct(swapped=0.5)
    found = await sent(broker, line, interface_name, conduct)
    assert found != ALL
    assert sorted(found)[:-1] == ALL[:-1] or sorted(found) == ALL


async def test_dropped_message_does_not_arrive_and_the_broker_continues(
    broker: Broker, line: MqttLine, interface_name: str
) -> None:
    conduct = Conduct(swallowed=True)
    assert await sent(broker, line, interface_name, conduct) == []
