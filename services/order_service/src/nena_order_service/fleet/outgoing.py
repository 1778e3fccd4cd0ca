"""From what the core wants sent to messages of a robot's version, with headers."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, Final

from nena_order_service.fleet.outputs import (
    Publish,
    PublishInstantActions,
    PublishOrder,
    PublishResponses,
    PublishZoneSet,
)
from nena_shared.clock import Clock
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.zone_set import ZoneSetTransfer

Message = Order | InstantActions | Responses | ZoneSetTransfer

HEADER_ID_COUNT: Final = 2**32


class Outgoing:
    """Makes the messages; headerIds are counted for each robot and topic (section 7.2)."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._header_ids: dict[tuple[RobotKey, Topic], int] = defaultdict(int)

    def message(self, output: Publish, version: str) -> tuple[Topic, Message]:
        """Give the message, and the topic that it belongs to."""
        match output:
            case PublishOrder():
                header = self._header(output.robot, Topic.ORDER, version)
                return Topic.ORDER, Order(
                    **header,
                    order_id=output.vda_order.order_id,
                    order_update_id=output.order_update_id,
                    nodes=output.vda_order.nodes,
                    edges=output.vda_order.edges,
                )
            case PublishInstantActions():
                header = self._header(output.robot, Topic.INSTANT_ACTIONS, version)
                return Topic.INSTANT_ACTIONS, InstantActions(**header, actions=output.actions)
            case PublishResponses():
                header = self._header(output.robot, Topic.RESPONSES, version)
                return Topic.RESPONSES, Responses(**header, responses=output.responses)
            case PublishZoneSet():
                header = self._header(output.robot, Topic.ZONE_SET, version)
                return Topic.ZONE_SET, ZoneSetTransfer(**header, zone_set=output.zone_set)

    def _header(self, robot: RobotKey, topic: Topic, version: str) -> dict[str, Any]:
        header_id = self._header_ids[robot, topic]
        self._header_ids[robot, topic] = (header_id + 1) % HEADER_ID_COUNT
        return {
            "header_id": header_id,
            "timestamp": self._clock.now(),
            "version": version,
            "manufacturer": robot.manufacturer,
            "serial_number": robot.serial_number,
        }
