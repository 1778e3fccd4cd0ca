"""Count messages and VDA orders to and from the robots, for the metrics."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from nena_order_service.fleet import outputs
from nena_order_service.fleet.failures import FailureKind
from nena_shared.histogram import ANSWERS, LONG, Histogram
from nena_shared.vda5050.topics import Topic

COUNTED: Final = (Topic.CONNECTION, Topic.FACTSHEET, Topic.STATE)
SENT: Final = (Topic.ORDER, Topic.INSTANT_ACTIONS, Topic.RESPONSES, Topic.ZONE_SET)
RESENT: Final = (Topic.ORDER, Topic.INSTANT_ACTIONS)

ACTIONS_REMEMBERED: Final = 1000
"""Number of remembered instant action IDs, with which resends are recognised."""


@dataclass(slots=True)
class _Delivery:
    """The delivery of a VDA order; times are in monotonic seconds."""

    begun: float
    sent: float | None = None
    accepted: float | None = None
    update_id: int = -1
    """The last update that was sent."""


class FleetStatistics:
    """Counts since the start of the program, and durations of the steps of VDA orders."""

    def __init__(self) -> None:
        self.received = dict.fromkeys(COUNTED, 0)
        self.malformed = dict.fromkeys(COUNTED, 0)
        self.sent = dict.fromkeys(SENT, 0)
        self.resent = dict.fromkeys(RESENT, 0)
        self.states_ignored = 0
        """States that were ignored, because their headers do not come after the last ones."""
        self.robot_limit = 0
        """Messages from robots beyond ``robots_limit``."""
        self.too_many = 0
        """Messages beyond ``messages_per_second``."""
        self.name_too_long = 0
        """Messages from robots whose names are longer than the store can hold."""
        self.foreign = 0
        """Commands to robots that were not sent by this program."""
        self.nodes_passed = 0
        self.ended = {"finished": 0, "cancelled": 0, "failed": 0}
        """VDA orders by outcome."""
        self.failures = dict.fromkeys(FailureKind, 0)
        """VDA orders that have failed, by kind."""
        self.sending = Histogram(ANSWERS)
        """Seconds from the decision to send a VDA order until it is first sent."""
        self.acknowledgement = Histogram(ANSWERS)
        """Seconds from then to the first state that echoes it."""
        self.execution = Histogram(LONG)
        """Seconds from then to the end, for finished VDA orders."""
        self._deliveries: dict[str, _Delivery] = {}
        self._actions: OrderedDict[str, None] = OrderedDict()

    @property
    def undelivered(self) -> int:
        """Number of VDA orders that no robot has echoed yet."""
        return sum(delivery.accepted is None for delivery in self._deliveries.values())

    def begun(self, order_id: str, now: float, *, restored: bool = False) -> None:  # noqa: ARG002 - of listeners
        """Count a VDA order that is to be sent, or was restored after a restart."""
        self._deliveries[order_id] = _Delivery(now)

    def published(self, topic: Topic, output: outputs.Publish, now: float) -> None:
        """Count a message to a robot."""
        self.sent[topic] += 1
        if isinstance(output, outputs.PublishOrder):
            delivery = self._deliveries.get(output.vda_order.order_id)
            if delivery is None:
                return
            # A robot that has accepted it before a restart would show a sending without a decision.
            if delivery.sent is None and delivery.accepted is None:
                delivery.sent = now
                self.sending.observe(now - delivery.begun)
            self.resent[Topic.ORDER] += output.order_update_id == delivery.update_id
            delivery.update_id = output.order_update_id
        elif isinstance(output, outputs.PublishInstantActions):
            ids = [action.action_id for action in output.actions]
            self.resent[Topic.INSTANT_ACTIONS] += any(action_id in self._actions for action_id in ids)
            self._actions.update(dict.fromkeys(ids))
            while len(self._actions) > ACTIONS_REMEMBERED:
                self._actions.popitem(last=False)

    def happened(self, event: outputs.FleetOutput, now: float) -> None:
        """Count an event of the core."""
        match event:
            case outputs.NodePassed():
                self.nodes_passed += 1
            case outputs.StateIgnored():
                self.states_ignored += 1
            case outputs.VdaOrderAccepted(order_id=order_id):
                delivery = self._deliveries.get(order_id)
                if delivery and delivery.accepted is None:
                    delivery.accepted = now
                    if delivery.sent is not None:
                        self.acknowledgement.observe(now - delivery.sent)
            case outputs.VdaOrderFinished(order_id=order_id):
                self.ended["finished"] += 1
                delivery = self._deliveries.pop(order_id, None)
                if delivery and delivery.accepted is not None:
                    self.execution.observe(now - delivery.accepted)
            case outputs.VdaOrderCancelled(order_id=order_id):
                self.ended["cancelled"] += 1
                self._deliveries.pop(order_id, None)
            case outputs.VdaOrderFailed(order_id=order_id, kind=kind):
                self.ended["failed"] += 1
                self.failures[kind] += 1
                self._deliveries.pop(order_id, None)
            case _:
                pass
