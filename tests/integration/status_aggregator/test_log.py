"""A robot that repeats its mistake does not fill the log."""

from __future__ import annotations

import pytest
from structlog.testing import capture_logs

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.fleet_examples import ROBOT
from support.served_aggregator import Served

pytestmark = pytest.mark.broker


async def test_repeated_problem_is_logged_once_and_a_new_one_again(broker: Broker, served: Served) -> None:
    topic = served.robots.of(ROBOT, Topic.STATE)
    with capture_logs() as lines, MqttPeer(broker) as peer:
        for payload in (b"{", b"{", b"{", b"[]"):
            peer.publish(topic, payload)
        await served.metric('nena_messages_malformed_total{topic="state"} 4.0')
    warnings = [line for line in lines if line["event"] == "unreadable message"]
    assert [line["robot"] for line in warnings] == ["ACME/r1"] * 2
    assert warnings[0]["problem"] != warnings[1]["problem"]
