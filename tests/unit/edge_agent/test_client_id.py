from __future__ import annotations

from nena_edge_agent.client_id import client_id_of
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey


def test_a_robot_is_called_by_its_topics_and_what_only_it_has() -> None:
    robot, secret = RobotKey("ACME", "1"), MqttSettings.model_validate({"password": "a"})

    assert client_id_of(robot, MqttSettings()) == "nena-edge-agent-ACME-1"
    assert client_id_of(robot, secret).startswith("nena-edge-agent-ACME-1-")
    assert client_id_of(robot, secret) != client_id_of(RobotKey("ACME", "2"), secret)
