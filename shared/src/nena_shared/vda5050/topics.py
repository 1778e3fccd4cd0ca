"""MQTT topics (VDA 5050 3.0 section 4.2): ``interfaceName/majorVersion/manufacturer/serialNumber/topic``."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

LEVELS_BEHIND_INTERFACE = 4


class Topic(StrEnum):
    """Last level of a topic (section 4.2)."""

    ORDER = "order"
    INSTANT_ACTIONS = "instantActions"
    STATE = "state"
    VISUALIZATION = "visualization"
    CONNECTION = "connection"
    FACTSHEET = "factsheet"
    ZONE_SET = "zoneSet"
    RESPONSES = "responses"


class RobotKey(NamedTuple):
    """Manufacturer and serial number of a robot, as in its topics (section 4.2)."""

    manufacturer: str
    serial_number: str

    def __str__(self) -> str:
        return f"{self.manufacturer}/{self.serial_number}"


class TopicScheme(NamedTuple):
    """Builds and parses the topics of one interface and major version (section 4.2).

    The interface name may have several levels.
    """

    interface_name: str
    major_version: str = "v2"

    def of(self, robot: RobotKey, topic: Topic) -> str:
        """Return ``topic`` of one robot."""
        return f"{self.interface_name}/{self.major_version}/{robot}/{topic}"

    def for_all(self, topic: Topic) -> str:
        """Return the topic filter for ``topic`` of all robots."""
        return f"{self.interface_name}/{self.major_version}/+/+/{topic}"

    def robot_of(self, topic: str) -> RobotKey | None:
        """Return the robot of ``topic``; None if the topic does not belong to this scheme."""
        # from the right, as the interface name may have several levels
        levels = topic.rsplit("/", LEVELS_BEHIND_INTERFACE)
        if len(levels) <= LEVELS_BEHIND_INTERFACE or levels[:2] != [self.interface_name, self.major_version]:
            return None
        return RobotKey(levels[2], levels[3])
