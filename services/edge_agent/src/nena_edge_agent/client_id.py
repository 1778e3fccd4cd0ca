"""What a robot is called at the broker."""

from __future__ import annotations

from nena_shared.mqtt.client_id import private_client_id
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey


def client_id_of(robot: RobotKey, settings: MqttSettings) -> str:
    """Give the robot's MQTT client id, where the settings name none.

    Raises:
        ConfigurationError: a file with the robot's secret cannot be read.

    """
    return private_client_id(f"nena-edge-agent-{robot.manufacturer}-{robot.serial_number}", settings)
