"""The attention list over a real broker, and over restarts of the aggregator."""

from __future__ import annotations

from typing import Any

import pytest

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.fleet_examples import connection, state
from support.matters import emergency
from support.panel import seconds_now
from support.served_aggregator import Served, serving

pytestmark = pytest.mark.broker

LIST = "/api/v1/attention"


def by(found: dict[str, Any]) -> list[Any]:
    """Return the names of those who have acknowledged each matter."""
    return [each["acknowledged"] and each["acknowledged"]["by"] for each in found["attention"]]


def report(served: Served, peer: MqttPeer, number: int, **fields: Any) -> None:
    served.send(peer, Topic.CONNECTION, connection(number=number), retain=True)
    served.send(peer, Topic.STATE, state(number, at=seconds_now(), **fields))


async def test_acknowledgement_survives_a_restart_and_goes_with_its_matter(
    broker: Broker, interface_name: str
) -> None:
    with MqttPeer(broker) as peer:
        async with serving(broker, interface_name) as served:
            report(served, peer, 1, **emergency("MANUAL"))
            found = await served.until(LIST, lambda found: by(found) == [None])
            address = f"{LIST}/{found['attention'][0]['id']}/acknowledgement"
            done = await served.http.post(address, json={"by": "Anna"})
            assert done.status_code == 200
        async with serving(broker, interface_name) as served:
            report(served, peer, 2, **emergency("MANUAL"))
            await served.until(LIST, lambda found: by(found) == ["Anna"])
            report(served, peer, 3)
            await served.until(LIST, lambda found: by(found) == [])
        async with serving(broker, interface_name) as served:
            report(served, peer, 4, **emergency("MANUAL"))
            await served.until(LIST, lambda found: by(found) == [None])
