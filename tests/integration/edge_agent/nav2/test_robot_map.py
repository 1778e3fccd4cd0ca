"""The map of a robot, from its ROS topic to the broker that keeps it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nena_shared.fleet_api.plant import MapImage
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey
from support.broker import Broker, MqttPeer
from support.edge_agent import MANUFACTURER, SERIAL
from support.nav2_agent import Bench
from support.ros import RosPeer
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]


async def test_map_is_retained_for_late_subscribers(
    broker: Broker, interface_name: str, peer: RosPeer, domain_id: int, tmp_path: Path
) -> None:
    bench = Bench(broker, interface_name, ros=peer, domain_id=domain_id, folder=tmp_path)
    topic = FleetTopics(f"{interface_name}/nena").robot_map(RobotKey(MANUFACTURER, SERIAL))
    with bench.mqtt:
        async with bench.robot():
            await until(lambda: bool(bench.mqtt.received(topic)), what="the map")
    with MqttPeer(broker, topic) as late:
        await until(lambda: bool(late.received(topic)), what="the map that the broker keeps")
        found = MapImage.model_validate_json(late.payloads(topic)[0])
    assert min(found.size) > 50
    assert found.digest
