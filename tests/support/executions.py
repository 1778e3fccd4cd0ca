"""What robots have done by their own account: each time that a load was taken up or set down."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from nena_shared.mqtt import Inbound
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC

WORK = ("pick", "drop")


@dataclass(frozen=True, slots=True)
class Execution:
    """Of an action that moves a load, to its good end."""

    robot: str
    """Serial number."""
    drive_order: str
    action_id: str


def drive_order_of(order_id: str) -> str:
    """Return the drive order that a VDA 5050 order is for, whichever try of it that is."""
    return order_id.partition("~")[0]


def executions(states: Iterable[Inbound]) -> list[Execution]:
    """Return the executed actions, in the order in which robots report them in their states (2.x).

    An action is executed when a robot first reports FINISHED, and again each time that it does so after it
    has reported another status. A restarted robot reports its journal: there FINISHED stays FINISHED. Two
    programs with one serial number count as one robot.
    """
    found: list[Execution] = []
    at_end: set[Execution] = set()
    for robot, state in _said_once(states):
        for action in state.action_states:
            each = Execution(robot, drive_order_of(state.order_id), action.action_id)
            if not action.action_status.ended:
                at_end.discard(each)
            elif (
                action.action_status is ActionStatus.FINISHED
                and action.action_type in WORK
                and each not in at_end
            ):
                at_end.add(each)
                found.append(each)
    return found


def ended_actions(log: str) -> set[Execution]:
    """Return what was done by the log of robots, which has no holes where the broker was away."""
    found = set()
    for line in log.splitlines():
        if " action ended " in line:
            said = dict(part.split("=", 1) for part in line.split() if "=" in part)
            if said["status"] == ActionStatus.FINISHED and said["type"] in WORK:
                robot = said["robot"].partition("/")[2]
                found.add(Execution(robot, drive_order_of(said["order"]), said["action"]))
    return found


def _said_once(states: Iterable[Inbound]) -> Iterator[tuple[str, State]]:
    """Yield each robot's states in the order of arrival, without repeated ones.

    A replayed or redelivered state has its old header. After a restart headerIds may start again, and with a
    clock set back timestamps repeat; both together never do.
    """
    known = set()
    for message in states:
        robot = message.topic.split("/")[-2]
        with suppress(MalformedMessageError):  # somebody else said it: a hostile message
            state = CODEC.decode(State, message.payload)
            header = robot, state.header_id, state.timestamp
            if header not in known:
                known.add(header)
                yield robot, state
