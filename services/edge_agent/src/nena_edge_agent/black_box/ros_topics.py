"""Records ROS topics as they arrive, without reading them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

from nena_edge_agent.actions.messages import UnknownTypeError, class_of
from nena_edge_agent.black_box.settings import RecordedTopic
from nena_shared.black_box.ring import Channel, Ring
from nena_shared.clock import Clock
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)


class RosTopicRecorder:
    """A node extension that puts the serialised messages of topics into the ring, in the ROS thread."""

    def __init__(self, topics: Iterable[RecordedTopic], ring: Ring, clock: Clock) -> None:
        self._topics = tuple(topics)
        self._ring = ring
        self._clock = clock

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Subscribe on a new node; a topic whose type is not installed is logged and left out."""
        from nena_edge_agent.nav2.node import SENSOR  # noqa: PLC0415 - the loopback needs no ROS

        for each in self._topics:
            try:
                kind = class_of(each.type)
            except UnknownTypeError as error:
                log.warning("topic not recorded", topic=each.topic, reason=str(error))
                continue
            name = node.resolve_topic_name(each.topic)
            add = partial(self._add, Channel(name, each.type))
            session.subscribe_serialised(node, kind, each.topic, SENSOR, add)

    def _add(self, channel: Channel, message: bytes) -> None:
        self._ring.add(channel, message, self._clock.monotonic())
