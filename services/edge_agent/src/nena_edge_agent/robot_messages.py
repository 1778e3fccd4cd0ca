"""What one robot publishes: messages with their headers, in its version, on its topics (section 6)."""

from __future__ import annotations

from typing import Any

from nena_edge_agent.factsheet import make_factsheet
from nena_edge_agent.header import HeaderMaker, Reserved
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import Clock
from nena_shared.fleet_api.plant import RobotMap, topic_of_map
from nena_shared.mqtt import Outbound
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import codec_for, topics_for
from nena_shared.vda5050.visualization import Visualization


class RobotMessages:
    """Makes the messages of one robot, ready for the link; each takes the next headerId of its topic."""

    def __init__(
        self,
        settings: EdgeAgentSettings,
        robot: RobotKey,
        capabilities: Capabilities,
        *,
        clock: Clock,
        reserved: Reserved = (),
    ) -> None:
        self._settings = settings
        self._robot = robot
        self._capabilities = capabilities
        self.codec = codec_for(settings.version)
        self._topics = topics_for(settings.version, settings.interface_name)
        self.headers = HeaderMaker(robot, version=settings.version, clock=clock, reserved=reserved)

    def topic(self, topic: Topic) -> str:
        """Name a topic of the robot."""
        return self._topics.of(self._robot, topic)

    def header(self, topic: Topic) -> dict[str, Any]:
        """Give the header of the next message under ``topic``."""
        return self.headers.make(topic)

    def connection(self, state: ConnectionState) -> Outbound:
        """Say whether the robot is there; kept by the broker."""
        message = Connection(**self.header(Topic.CONNECTION), connection_state=state)
        return self._outbound(Topic.CONNECTION, message, qos=1, retain=True)

    def factsheet(self) -> Outbound:
        """Say what the robot can do; kept by the broker."""
        message = make_factsheet(self.header(Topic.FACTSHEET), self._settings, self._capabilities)
        return self._outbound(Topic.FACTSHEET, message, qos=self._settings.qos, retain=True)

    def state(self, message: State, *, keep: bool) -> Outbound:
        """Say how the robot stands; ``keep``: for as long as it takes until the link is there."""
        return self._outbound(Topic.STATE, message, qos=self._settings.qos, keep=keep)

    def visualization(self, message: Visualization) -> Outbound:
        """Say where the robot is; of no use when it is late."""
        return self._outbound(Topic.VISUALIZATION, message, qos=0)

    def map(self, found: RobotMap) -> Outbound:
        """Say what the robot's map looks like; kept by the broker."""
        payload = found.model_dump_json(by_alias=True).encode()
        return Outbound(topic_of_map(self._topics, self._robot), payload, retain=True, keep=False)

    def _outbound(
        self, topic: Topic, message: Header, *, qos: int, retain: bool = False, keep: bool = False
    ) -> Outbound:
        return Outbound(self.topic(topic), self.codec.encode(message), qos=qos, retain=retain, keep=keep)
