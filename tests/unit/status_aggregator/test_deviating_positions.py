"""Positions that deviate: shown where the order service takes the robot to be."""

from __future__ import annotations

import json
from math import pi
from typing import Any

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.versions import codec_for
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.fleet_examples import ROBOT, sample_plant

PLANT = sample_plant()
MAP = PLANT.only_map()


class Shown:
    """What the aggregator shows of a robot's states."""

    def __init__(self) -> None:
        settings = AggregatorSettings()
        self.model = FleetModel(ModelLimits())
        self._link = FleetSubscriber(settings, self.model, SystemClock())
        self._sent = 0
        self._receive(FleetTopics(settings.topic_prefix).plant_model, PLANT.to_json().encode())

    def send(self, position: dict[str, Any], **fields: Any) -> None:
        """Send a state."""
        self._sent += 1
        state = json.loads(codec_for("2.1.0").encode(HonestRobot(key=ROBOT).state(float(self._sent))))
        state |= {"headerId": self._sent, "agvPosition": state["agvPosition"] | position}
        self._receive(f"uagv/v2/{ROBOT}/state", json.dumps(state | fields).encode())

    def position(self, **fields: Any) -> tuple[float, str]:
        """Send a state; return heading and map."""
        self.send(fields)
        robot = self.model.robots.get(ROBOT)
        assert robot
        assert robot.reported
        return robot.reported.theta, robot.reported.map_id

    def _receive(self, topic: str, payload: bytes) -> None:
        for handler in self._link.mqtt._handlers(topic):
            handler(Inbound(topic, payload, retained=False))


def test_headings_beyond_a_full_turn_are_degrees_for_all_of_a_robots_messages() -> None:
    shown = Shown()
    headings = [shown.position(theta=theta)[0] for theta in (3.0, 90, 3.0)]
    assert headings == pytest.approx([3.0, pi / 2, 3.0 * pi / 180])


def test_robot_without_a_map_is_on_the_plants_only_one() -> None:
    assert MAP
    assert [Shown().position(mapId=name)[1] for name in ("", None, MAP.upper(), "other")] == [
        MAP,
        MAP,
        MAP,
        "other",
    ]


def test_header_of_another_robot_and_names_in_other_letters_are_shown() -> None:
    shown, place = Shown(), PLANT.points[0].name
    shown.send({}, serialNumber="another", lastNodeId=place.upper())
    (robot,) = shown.model.robots
    assert robot.key == ROBOT
    assert robot.state
    assert robot.state.last_node_id == place != place.upper()
    assert list(map(str, robot.deviations)) == [
        'state.serialNumber "another": replaced',
        f'state.lastNodeId "{place.upper()}": letter case',
    ]
