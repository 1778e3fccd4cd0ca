"""Events at robots and hosts, by their own clocks, and the rules that they must not break: judged afterwards.

Nothing here depends on how NeNa works. Robots note each order received, each action begun and ended, and each
place entered and left; hosts note each status received.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from nena_shared.fleet_api.epoch import epoch_of
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.mqtt import Inbound
from support.executions import drive_order_of

LEGS = 2
"""Drive orders of each transport order: fetch a load, bring it."""


class Kind(StrEnum):
    """What a robot notes."""

    RECEIVED = "received"
    BEGUN = "begun"
    ENDED = "ended"
    ENTERED = "entered"
    LEFT = "left"


@dataclass(frozen=True, slots=True)
class Event:
    """One line of a robot's history."""

    at: float
    """Seconds of the robot's own clock."""
    robot: str
    kind: Kind
    what: str
    """The VDA 5050 order, the action or the node."""
    order: str = ""
    """The VDA 5050 order that an action belongs to."""


@dataclass(slots=True)
class History:
    """The events of all robots, in the order in which they were noted."""

    events: list[Event] = field(default_factory=list)

    def note(self, robot: str, kind: Kind, what: str, order: str = "") -> None:
        """Add an event that happens now."""
        self.events.append(Event(time.time(), robot, kind, what, order))

    def of(self, kind: Kind) -> Iterator[Event]:
        """Yield the events of one kind."""
        return (each for each in self.events if each.kind is kind)


def done_wrongly(history: History, store: Mapping[str, TransportOrderStatus]) -> list[str]:
    """Return what was not done exactly once although reported as done, or was done twice."""
    done: dict[str, list[Event]] = defaultdict(list)
    for each in history.of(Kind.ENDED):
        done[drive_order_of(each.order)].append(each)
    twice = [
        f"{name} was done {len(each)} times, by {[event.robot for event in each]}"
        for name, each in done.items()
        if len(each) > 1
    ]
    legs = {
        f"{name}-{leg}"
        for name, order in store.items()
        if order.state is TransportOrderState.FINISHED
        for leg in range(LEGS)
    }
    missing = [f"{leg} was told as done, and no robot has done it" for leg in sorted(legs - done.keys())]
    strange = [f"{leg} was done without an order" for leg in done if leg.rpartition("-")[0] not in store]
    return [*twice, *missing, *strange]


def begun_again(history: History) -> list[str]:
    """Return the VDA 5050 orders of which a robot has begun an action more than once."""
    counts = Counter((each.robot, each.order, each.what) for each in history.of(Kind.BEGUN))
    return [
        f"{robot} began {what} of {order} {n} times" for (robot, order, what), n in counts.items() if n > 1
    ]


def shared_places(history: History) -> list[str]:
    """Return each place where a robot came before another one had left it."""
    inside: dict[str, dict[str, float]] = defaultdict(dict)
    found = []
    for each in sorted((*history.of(Kind.ENTERED), *history.of(Kind.LEFT)), key=lambda event: event.at):
        here = inside[each.what]
        if each.kind is Kind.LEFT:
            here.pop(each.robot, None)
            continue
        found += [
            f"{each.robot} came to {each.what} {each.at - since:.3f} s after {other}, which is still there"
            for other, since in here.items()
            if other != each.robot
        ]
        here[each.robot] = each.at
    return found


def lost(answered: Iterable[str], store: Mapping[str, TransportOrderStatus]) -> list[str]:
    """Return the orders accepted for a host that are missing or have no end or reason."""
    gone = [f"{name} was answered, and is not in the store" for name in answered if name not in store]
    endless = [f"{each.name} has no end: {each.reason}" for each in store.values() if not each.state.final]
    silent = [
        f"{each.name} is {each.state} without a reason"
        for each in store.values()
        if each.state.final and each.state is not TransportOrderState.FINISHED and not each.reason
    ]
    return [*gone, *endless, *silent]


def told_back(statuses: Iterable[Inbound]) -> list[str]:
    """Return the statuses that a host received after newer ones; none comes from a replaced order service."""
    newest: dict[str, tuple[int, int, TransportOrderState]] = {}
    found = []
    for message in statuses:
        if not message.payload:
            continue
        status = TransportOrderStatus.model_validate_json(message.payload)
        now = epoch_of(message.payload), status.version, status.state
        before = newest.get(status.name)
        if before is not None and _is_back(before, now):
            found.append(f"{status.name} was told as {now} after {before}")
        newest[status.name] = now
    return found


def _is_back(before: tuple[int, int, TransportOrderState], now: tuple[int, int, TransportOrderState]) -> bool:
    older = now[0] < before[0] or now[1] < before[1]
    return older or (before[2].final and now[2] is not before[2])
