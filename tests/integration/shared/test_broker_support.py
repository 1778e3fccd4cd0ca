from __future__ import annotations

import pytest

from support.broker import Broker, BrokerAddress, MqttPeer
from support.brokers import Nats

pytestmark = pytest.mark.broker


async def test_peer_records_by_topic_in_order(broker: Broker, interface_name: str) -> None:
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        for number in range(3):
            peer.publish(f"{interface_name}/a", str(number))
        peer.publish(f"{interface_name}/b", "last")

        assert (await peer.wait_for(f"{interface_name}/b")).payload == b"last"
        assert peer.payloads(f"{interface_name}/a") == [b"0", b"1", b"2"]


async def test_restart_discards_retained_messages(own_broker: Broker) -> None:
    with MqttPeer(own_broker) as peer:
        peer.publish("kept", "x", retain=True)
    own_broker.restart()
    with MqttPeer(own_broker, "#") as peer:
        peer.publish("fresh", "y")
        await peer.wait_for("fresh")
        assert peer.payloads("kept") == []


async def test_frozen_broker_answers_again_when_thawed(own_broker: Broker) -> None:
    with MqttPeer(own_broker, "#") as peer:
        own_broker.freeze()
        own_broker.thaw()
        peer.publish("after", "z")
        assert (await peer.wait_for("after")).payload == b"z"


async def test_each_broker_delivers(each_broker: BrokerAddress, interface_name: str) -> None:
    with MqttPeer(each_broker, f"{interface_name}/#") as peer:
        peer.publish(f"{interface_name}/a", "x")
        assert (await peer.wait_for(f"{interface_name}/a")).payload == b"x"


async def test_nats_keeps_retained_messages_over_a_restart() -> None:
    with Nats() as own_nats:
        with MqttPeer(own_nats) as peer:
            peer.publish("kept", "x", retain=True)
        own_nats.restart()
        with MqttPeer(own_nats, "kept") as peer:
            assert (await peer.wait_for("kept")).retained
