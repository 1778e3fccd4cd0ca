"""Messages between order service and robots, checked by the standard alone."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from nena_shared.mqtt import Inbound


@dataclass
class Conversation:
    """Reads a conversation, and finds robots that could be where another one is.

    A robot may be anywhere on its base, from the node that it reported last; until the next state, earlier
    bases count as well. If the order was sent before the conversation began, the robot's states count.
    """

    on: dict[str, set[str]] = field(default_factory=dict)
    orders: dict[str, tuple[str, list[tuple[int, str]]]] = field(default_factory=dict)
    """The order of each robot, and its base: sequence ids and resources."""
    clashes: list[str] = field(default_factory=list)

    def read(self, messages: Iterable[Inbound]) -> None:
        for message in messages:
            *_, robot, kind = message.topic.split("/")
            if kind == "order":
                self._order(robot, json.loads(message.payload))
            elif kind == "state":
                self._state(robot, json.loads(message.payload))

    def _order(self, robot: str, order: dict[str, object]) -> None:
        parts = [*order["nodes"], *order["edges"]]  # type: ignore[misc] # as the standard has it
        base = sorted((part["sequenceId"], _resource(part)) for part in parts if part["released"])
        name = str(order["orderId"])
        before = self.orders.get(robot)
        known = before[1] if before and before[0] == name else []
        self.orders[robot] = name, sorted({*known, *base})
        self.on[robot] = self.on.get(robot, set()) | {resource for _, resource in base}
        self._look(robot)

    def _state(self, robot: str, state: dict[str, Any]) -> None:
        name, base = self.orders.get(robot, ("", []))
        if robot not in self.orders:
            self.on[robot] = _base_of(state)
        elif (
            state["orderId"] == name
            and base
            and (state["nodeStates"] or state["lastNodeSequenceId"] == base[-1][0])
        ):
            last = int(str(state["lastNodeSequenceId"]))
            self.on[robot] = {resource for sequence, resource in base if sequence >= last}
        self._look(robot)

    def _look(self, robot: str) -> None:
        for other, resources in self.on.items():
            shared = self.on[robot] & resources
            if other != robot and shared:
                self.clashes.append(f"{robot} and {other} at {sorted(shared)}")


def _resource(part: dict[str, str]) -> str:
    return part["nodeId"] if "nodeId" in part else part["edgeId"].removesuffix(":backward")


def _base_of(state: dict[str, Any]) -> set[str]:
    released = (part for part in (*state["nodeStates"], *state["edgeStates"]) if part["released"])
    return ({state["lastNodeId"]} | set(map(_resource, released))) - {""}
