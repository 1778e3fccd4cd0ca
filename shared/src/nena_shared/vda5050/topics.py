"""MQTT topics (VDA 5050 3.0 section 4.2): ``interfaceName/majorVersion/manufacturer/serialNumber/topic``."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Self

LEVELS_BEHIND_INTERFACE = 4

DEFAULT_MANUFACTURER = "NeNa"
"""Manufacturer of vehicles that have none in the plant model."""


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
    robot: RobotKey | None = None
    """The only robot, whose topics follow the interface name at once; None: any."""

    @classmethod
    def below(cls, prefix: str, version: str | None, robot: RobotKey) -> Self:
        """Return the topics of a robot with a prefix of its own; ``version`` of VDA 5050, None: 2.x."""
        major = f"v{(version or '2').partition('.')[0]}"
        interface = prefix.removesuffix(f"/{major}/{robot}")
        return cls(prefix, major, robot) if interface == prefix else cls(interface, major)

    def of(self, robot: RobotKey, topic: Topic) -> str:
        """Return ``topic`` of one robot."""
        if self.robot:
            return f"{self.interface_name}/{topic}"
        return f"{self.interface_name}/{self.major_version}/{robot}/{topic}"

    def for_all(self, topic: Topic) -> str:
        """Return the topic filter for ``topic`` of all robots."""
        if self.robot:
            return self.of(self.robot, topic)
        return f"{self.interface_name}/{self.major_version}/+/+/{topic}"

    def robot_of(self, topic: str) -> RobotKey | None:
        """Return the robot of ``topic``; None if the topic does not belong to this scheme."""
        if self.robot:
            return self.robot if topic.rpartition("/")[0] == self.interface_name else None
        # from the right, as the interface name may have several levels
        levels = topic.rsplit("/", LEVELS_BEHIND_INTERFACE)
        if len(levels) <= LEVELS_BEHIND_INTERFACE or levels[:2] != [self.interface_name, self.major_version]:
            return None
        return RobotKey(levels[2], levels[3])
