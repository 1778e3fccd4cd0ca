"""A loopback robot on its test bench: the real program, its simulation control, and its states."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any
from uuid import uuid4

from nena_shared.vda5050.action import Action, ActionState, BlockingType
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import MobileRobotPosition, State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_for
from support.broker import Broker, MqttPeer
from support.edge_agent import MANUFACTURER, SERIAL, AgentProcess, FleetControl
from support.published import robots_problems
from support.robot_core import order
from support.waiting import until

OPERATIONS = (
    {"action_type": "pick", "seconds": 0.05, "load": "take"},
    {"action_type": "drop", "seconds": 0.05, "load": "give"},
    {"action_type": "startCharging", "seconds": 0.05, "charging": True},
)
TRY_AGAIN = 1.0
"""Seconds."""
TRIES = 60


class BenchRobot:
    """One robot, seen by fleet control and by its simulation control."""

    def __init__(self, peer: MqttPeer, interface_name: str, *, serial: str = SERIAL, version: str) -> None:
        self._peer = peer
        self.version = version
        self._codec = codec_for(version)
        self._place = f"{interface_name}/loopback/{MANUFACTURER}/{serial}"
        self._numbers = count(1)
        self.fleet = FleetControl(peer, interface_name, serial, version)

    async def command(self, name: str, **fields: Any) -> dict[str, Any]:
        """Send a command until it is answered, and return the answer; earlier states are dropped."""
        return await self.send({"command": name, "id": f"c{next(self._numbers)}"} | fields)

    async def send(self, command: dict[str, Any]) -> dict[str, Any]:
        """As :meth:`command`, for a whole message that holds an ``id``."""
        self._peer.clear()
        for attempt in range(TRIES):
            self._peer.publish(f"{self._place}/control", json.dumps(command))
            try:
                return await until(
                    lambda: next((each for each in self.answers if each.get("id") == command["id"]), None),
                    timeout=TRY_AGAIN,
                    what="an answer of the control door",
                )
            except AssertionError:
                if attempt == TRIES - 1:
                    raise
        raise AssertionError

    def publish(self, payload: bytes) -> None:
        """Send any message to the simulation control."""
        self._peer.publish(f"{self._place}/control", payload)

    async def answered(self, number: int) -> None:
        """Wait until so many answers came since the last command."""
        await until(lambda: len(self.answers) >= number, what=f"answer {number} of the control door")

    @property
    def answers(self) -> list[dict[str, Any]]:
        return [json.loads(each) for each in self._peer.payloads(f"{self._place}/answer")]

    @property
    def states(self) -> list[State]:
        payloads = self._peer.payloads(self.fleet.topic(Topic.STATE))
        return [self._codec.decode(State, each) for each in payloads]

    async def state(self, accept: Callable[[State], Any], *, last: bool = True) -> State:
        """Wait until ``accept`` is true for the last state, or any one since the last command."""
        return await until(
            lambda: next(
                (each for each in (self.states[-1:] if last else self.states) if accept(each)), None
            ),
            what=lambda: f"a state of {self.fleet.robot}; the last one is {self.fleet.states[-1:]}; this",
        )

    async def begin(self, *node_ids: str, **fields: Any) -> Order:
        """Put the robot on the first node, send it a new order along ``node_ids`` and wait for its echo."""
        first = 10.0 * int(node_ids[0][1:])
        await self.command("pose", x=first, y=0)
        await self.state(lambda state: place(state).x == first)
        sent = order(*node_ids, order_id=f"o{id(self)}-{next(self._numbers)}", **fields)
        self.fleet.send(sent)
        await self.state(lambda state: state.order_id == sent.order_id)
        return sent

    async def finish(self, node_id: str) -> State:
        """Drive the robot fast to the end of its order, at ``node_id``, and return its state there."""
        await self.command("speed", speed=500)
        done = await self.state(lambda state: idle(state) and state.last_node_id == node_id)
        await self.command("speed", speed=10)
        return done

    async def cancel(self) -> None:
        """Cancel the order and wait until the robot is idle."""
        action_id = f"cancel-{next(self._numbers)}"
        self.fleet.instant(
            Action(action_type="cancelOrder", action_id=action_id, blocking_type=BlockingType.NONE)
        )
        await self.state(idle)


def idle(state: State) -> bool:
    return not state.node_states and all(each.action_status.ended for each in state.action_states)


def errors(state: State) -> list[str]:
    """Return the types of the errors as 3.0 spells them; 2.x robots spell them in camel case."""
    types = (each.error_type for each in state.errors)
    return [each if each.isupper() else re.sub("([A-Z])", r"_\1", each).upper() for each in types]


def place(state: State) -> MobileRobotPosition:
    """Return where the robot is."""
    assert state.mobile_robot_position is not None
    return state.mobile_robot_position


def action_state(state: State, action_id: str) -> ActionState | None:
    return next((each for each in state.action_states if each.action_id == action_id), None)


@contextmanager
def shared_robot(broker: Broker, folder: Path, version: str) -> Iterator[BenchRobot]:
    """Run a robot shared by the tests of a module; all of its messages must fit their schemas."""
    interface_name = f"test-{uuid4().hex[:12]}"
    with (
        MqttPeer(broker, f"{interface_name}/#") as peer,
        bench_process(broker, interface_name, folder, version),
    ):
        yield BenchRobot(peer, interface_name, version=version)
    assert robots_problems(peer.history) == []


@contextmanager
def bench_process(
    broker: Broker, interface_name: str, folder: Path, version: str, *options: str
) -> Iterator[AgentProcess]:
    """Run the program with one loopback robot on the bench: 10 m/s, and a state each 0.3 s."""
    quick = ("--loopback.speed", "10", "--loopback.turn_rate", "50", "--loopback.pose_interval", "0.02")
    bench = (
        "--loopback.control",
        "--loopback.rehearsal",
        "--loopback.charge_rate",
        "20",
        "--interval.state_maximum",
        "0.3",
    )
    operations = ("--operations", json.dumps(OPERATIONS))
    with AgentProcess(
        broker, interface_name, folder, *quick, *bench, *operations, "--version", version, *options
    ) as process:
        yield process
