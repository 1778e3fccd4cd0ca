"""What fleet control sends, and when: it sends each message again until a state echoes it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from nena_shared.mqtt import Outbound
from nena_shared.vda5050.action import Action, ActionStatus, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import codec_for, topics_for
from nena_shared.vda5050.zone_set import ZoneSetTransfer
from support.restarts.wire import Wire
from support.robot_core import HEADER
from support.zones import responses

AGAIN = 1.0
"""Seconds until a message that no state has echoed is sent again."""
TOPICS: dict[type[Header], Topic] = {
    Order: Topic.ORDER,
    InstantActions: Topic.INSTANT_ACTIONS,
    ZoneSetTransfer: Topic.ZONE_SET,
    Responses: Topic.RESPONSES,
}
When = Callable[[State], bool]


@dataclass(frozen=True)
class Step:
    """One message, and what the last state must show before it is sent."""

    message: Header
    when: When = lambda _: True

    def echoed(self, state: State) -> bool:
        """Return whether ``state`` shows that the robot has the message."""
        match self.message:
            case Order(order_id=order_id, order_update_id=update):
                return (state.order_id, state.order_update_id) == (order_id, update)
            case InstantActions(actions=actions):
                shown = {each.action_id for each in (*state.action_states, *state.instant_action_states)}
                return {each.action_id for each in actions} <= shown
            case ZoneSetTransfer(zone_set=zone_set):
                return any(each.zone_set_id == zone_set.zone_set_id for each in state.zone_sets or ())
            case _:
                raise AssertionError(self.message)


@dataclass(frozen=True)
class Scenario:
    """An order and what happens to it. ``changeful``: its end depends on when something came."""

    name: str
    steps: Sequence[Step]
    version: str = "2.1.0"
    settings: dict[str, Any] = field(default_factory=dict)
    changeful: bool = False


def instants(*actions: Action) -> InstantActions:
    """Make a message."""
    return InstantActions(**HEADER, actions=actions)


class Fleet:
    """Fleet control of one robot, and all states that it has seen."""

    def __init__(self, scenario: Scenario, robot: RobotKey, wire: Wire) -> None:
        self._codec = codec_for(scenario.version)
        self._topics = topics_for(scenario.version, "fleet")
        self._robot = robot
        self._wire = wire
        self._steps = list(scenario.steps)
        self._sent = False
        self.states: list[State] = []
        self.finished = asyncio.Event()
        wire.on_message = self._take

    def _take(self, message: Outbound) -> None:
        if message.topic != self._topics.of(self._robot, Topic.STATE):
            return
        state = self._codec.decode(State, message.payload)
        self.states.append(state)
        if self._steps and self._sent and self._steps[0].echoed(state):
            del self._steps[0]
            self._sent = False
        if self._steps and not self._sent and self._steps[0].when(state):
            self._sent = True
            self._send()
        self._answer(state)
        if not self._steps and over(state):
            self.finished.set()

    def _answer(self, state: State) -> None:
        """Grant the robot's requests."""
        for request in state.zone_requests or ():
            if request.request_status is RequestStatus.REQUESTED:
                self._publish(responses(request.request_id, "GRANTED"))

    def _send(self) -> None:
        """Send the message of the step, now and again."""
        step = self._steps[0]
        self._publish(step.message)
        asyncio.get_running_loop().call_later(AGAIN, self._send_again, step)

    def _publish(self, message: Header) -> None:
        header = {
            "version": self._codec.version,
            "manufacturer": self._robot.manufacturer,
            "serial_number": self._robot.serial_number,
        }
        payload = self._codec.encode(message.model_copy(update=header))
        self._wire.send(self._topics.of(self._robot, TOPICS[type(message)]), payload)

    def _send_again(self, step: Step) -> None:
        if self._sent and self._steps and self._steps[0] is step:
            self._send()


def over(state: State) -> bool:
    """Return whether nothing is left to do, and the robot is at standstill."""
    actions = (*state.action_states, *state.instant_action_states)
    ended = all(each.action_status in (ActionStatus.FINISHED, ActionStatus.FAILED) for each in actions)
    return not state.node_states and not state.driving and ended and not state.paused
