"""From the bytes of fleet control to events; what cannot be read becomes an error in the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import (
    Event,
    InstantActionsReceived,
    MessageRefused,
    OrderReceived,
    ResponsesReceived,
    ZoneSetReceived,
)
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.mqtt import Handler, Inbound
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.error import ErrorEntry, ErrorReference, ErrorType, error
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.zone_set import ZoneSetTransfer

log = get_logger(__name__)
M = TypeVar("M", Order, InstantActions, ZoneSetTransfer, Responses)


_UNTIL = {
    Topic.INSTANT_ACTIONS: Until.INSTANT_ACTION_ACCEPTED,
    Topic.ZONE_SET: Until.ZONE_SET_TAKEN,
}
"""What ends the report of a message that was refused, where it is not the next order."""


@dataclass(slots=True)
class InboxCounts:
    """What came in so far."""

    taken: int = 0
    malformed: int = 0
    misdirected: int = 0
    retained: int = 0


class Inbox:
    """Reads the messages of fleet control to one robot."""

    def __init__(self, codec: Codec, robot: RobotKey, put: Callable[[Event], None], clock: Clock) -> None:
        self._codec = codec
        self._robot = robot
        self._put = put
        self._clock = clock
        self._log = log.bind(robot=str(robot))
        self.counts = InboxCounts()

    def handlers(self, *, zones: bool) -> dict[Topic, Handler]:
        """Give what takes the messages under each topic; those for ``zones`` only where they are wanted."""
        always: dict[Topic, Handler] = {
            Topic.ORDER: self.take_order,
            Topic.INSTANT_ACTIONS: self.take_instant_actions,
        }
        of_zones: dict[Topic, Handler] = {
            Topic.ZONE_SET: self.take_zone_set,
            Topic.RESPONSES: self.take_responses,
        }
        return always | of_zones if zones else always

    def take_order(self, message: Inbound) -> None:
        """Read a message under the order topic."""
        order = self._read(Order, message, Topic.ORDER)
        if order is not None:
            self._log.info("order received", order=order.order_id, update=order.order_update_id)
            self._put(OrderReceived(order))

    def take_instant_actions(self, message: Inbound) -> None:
        """Read a message under the instantActions topic."""
        actions = self._read(InstantActions, message, Topic.INSTANT_ACTIONS)
        if actions is not None:
            self._put(InstantActionsReceived(actions))

    def take_zone_set(self, message: Inbound) -> None:
        """Read a message under the zoneSet topic."""
        transfer = self._read(ZoneSetTransfer, message, Topic.ZONE_SET)
        if transfer is not None:
            self._put(ZoneSetReceived(transfer))

    def take_responses(self, message: Inbound) -> None:
        """Read a message under the responses topic."""
        responses = self._read(Responses, message, Topic.RESPONSES)
        if responses is not None:
            self._put(ResponsesReceived(responses, self._clock.now()))

    def _read(self, kind: type[M], message: Inbound, topic: Topic) -> M | None:
        if not message.payload:
            self._log.debug("an empty message is passed over: it clears what the broker keeps", topic=topic)
            return None
        if message.retained:
            self.counts.retained += 1
            self._log.warning("a retained command is passed over; it may be old", topic=message.topic)
            return None
        try:
            read = self._codec.decode(kind, message.payload)
        except MalformedMessageError as malformed:
            self.counts.malformed += 1
            self._refuse(str(malformed), topic, malformed.references)
            return None
        if RobotKey(read.manufacturer, read.serial_number) != self._robot:
            self.counts.misdirected += 1
            to = f"{read.manufacturer}/{read.serial_number}"
            self._refuse(f"the header names the robot {to}", topic, {"headerId": str(read.header_id)})
            return None
        self.counts.taken += 1
        return read

    def _refuse(self, problem: str, topic: Topic, references: dict[str, str]) -> None:
        self._log.warning("message refused", topic=topic.value, problem=problem, **references)
        until = _UNTIL.get(topic, Until.ORDER_ACCEPTED)
        self._put(MessageRefused(_refusal(problem, topic, references), until))


def _refusal(problem: str, topic: Topic, references: dict[str, str]) -> ErrorEntry:
    entry = error(
        ErrorType.VALIDATION_FAILURE,
        problem,
        hint="correct the message and send it again; nothing has changed",
        topic=topic.value,
    )
    known = tuple(
        ErrorReference(reference_key=key, reference_value=value) for key, value in references.items()
    )
    return entry.model_copy(update={"error_references": (*entry.error_references, *known)})
