"""Robots whose timestamps cannot be read: the time of arrival replaces them, and does not define an order."""

from __future__ import annotations

import json

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.clock import SystemClock
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.versions import codec_for
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.fleet_examples import ROBOT


async def test_an_old_state_changes_nothing() -> None:
    model = FleetModel(ModelLimits())
    link = FleetSubscriber(AggregatorSettings(), model, SystemClock())
    topic = f"uagv/v2/{ROBOT}/state"
    state = json.loads(codec_for("2.1.0").encode(HonestRobot(key=ROBOT).state(0.0)))

    def publish(header_id: int, **fields: object) -> int:
        body = json.dumps(state | {"headerId": header_id, "timestamp": "yesterday"} | fields).encode()
        for handler in link.mqtt._handlers(topic):
            handler(Inbound(topic, body, retained=False))
        robot = model.robots.get(ROBOT)
        assert robot
        assert robot.state
        return robot.state.header_id

    assert [publish(each) for each in (10, 9, 11, 11, 12)] == [10, 10, 11, 11, 12]
    publish(12, lastNodeId="B", agvPosition=state["agvPosition"] | {"x": 7.0})
    robot = model.robots.get(ROBOT)
    assert robot
    assert robot.position
    assert robot.position.x == 7.0
    publish(13, driving="perhaps", agvPosition=state["agvPosition"] | {"x": 8.0})
    assert robot.position.x == 8.0
    assert "driving" in robot.unreadable
