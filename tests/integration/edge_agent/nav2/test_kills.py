"""The agent's process, killed again and again while its robot drives: no order notices.

Broker, agent and robot are processes of their own; only the agent is killed, at moments that are counted in
its messages and drawn by chance.
"""

from __future__ import annotations

import asyncio
import json
import random
import uuid
from collections.abc import Iterable, Sequence
from itertools import count, pairwise
from typing import Any

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray

from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_for
from support.examples import KILLS
from support.nav2_agent import Bench, ready
from support.restarts.oracle import check_headers, check_states
from support.robot_core import action, order
from support.ros import LATCHED
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

OPERATIONS = [
    {"action_type": "pick", "seconds": 0.3, "load": "take"},
    {"action_type": "drop", "seconds": 0.3, "load": "give"},
]
OPTIONS = (
    *("--operations", json.dumps(OPERATIONS), "--interval.visualization", "0.1"),
    *("--drive.strategy", "pass_through", "--drive.external_goals", "fail"),
)
SPEED = 0.4
"""m/s, five times as fast by the simulator's clock: a drive lasts longer than the agent is away."""
MOST_STATES = 8
"""Of an agent, until it is killed."""
MOST_MORE = 15
"""Messages of any kind after the last of these: about a second and a half."""


class Witness:
    """Sends orders as fleet control does, and keeps all messages of the robot."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._codec = codec_for("2.1.0")
        self._taken = 0
        self.states: list[State] = []
        self.orders: list[Order] = []
        self.enough = False

    async def hears(self, *, states: int, more: int) -> None:
        """Wait for ``states`` new states, and for ``more`` messages after them."""
        history, topic, start = self._bench.mqtt.history, self._bench.fleet.topic(Topic.STATE), self.messages
        await until(
            lambda: sum(each.topic == topic for each in history[start:]) >= states,
            what=f"{states} states",
        )
        enough = self.messages + more
        await until(lambda: self.messages >= enough, what=f"{more} messages")

    @property
    def messages(self) -> int:
        """How many messages there were."""
        return len(self._bench.mqtt.history)

    @property
    def state(self) -> State:
        """The newest state."""
        topic = self._bench.fleet.topic(Topic.STATE)
        new = self._bench.mqtt.history[self._taken :]
        self._taken += len(new)
        self.states += [self._codec.decode(State, each.payload) for each in new if each.topic == topic]
        return self.states[-1]

    async def serve(self) -> None:
        """Send the robot one order after another, until stopped."""
        for number in count(1):
            if self.enough:
                return
            await self._do(_order(number))

    async def _do(self, message: Order) -> None:
        self.orders.append(message)
        while self.state.order_id != message.order_id:
            self._bench.fleet.send(message)
            await self._patiently(lambda: self.state.order_id == message.order_id)
        await until(lambda: self._is_over(message), what=f"the end of {message.order_id}")

    async def _patiently(self, condition: Any) -> None:
        try:
            await until(condition, timeout=2.0)
        except AssertionError:
            return  # the agent was not there to hear it

    def _is_over(self, message: Order) -> bool:
        state = self.state
        over = all(each.action_status.ended for each in state.action_states)
        return state.order_id == message.order_id and not state.node_states and over and not state.driving


@pytest.mark.timeout(300 + 60 * KILLS)
@pytest.mark.clause("6.6/restart", "7.2/headerId")
@pytest.mark.parametrize(
    ("actions", "kills"),
    [("--actions", KILLS - KILLS // 2), pytest.param("--no-actions", KILLS // 2, marks=pytest.mark.long)],
)
async def test_repeatedly_killed_agent_executes_its_orders(bench: Bench, actions: str, kills: int) -> None:
    """``actions``: whether goals go to Nav2 by its action or by topic."""
    arrays = bench.ros.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
    chance, witness = random.Random(kills), Witness(bench)
    under_way: set[uuid.UUID] = set()
    simulator = bench.simulator(actions, "--log.form", "json", drive={"speed": SPEED})
    with simulator as robot, bench.agent_process(*OPTIONS) as agent:
        await bench.fleet.state(ready)
        bench.fault("stuck", active=False)  # makes the publisher, so that the next one takes no time
        orders = asyncio.create_task(witness.serve())
        for _ in range(kills):
            await witness.hears(states=chance.randint(1, MOST_STATES), more=chance.randint(0, MOST_MORE))
            held = not under_way  # one drive at least lasts until the agent has been back for a while
            if held:
                await until(lambda: driven_to(arrays.messages[-1:]), what="a goal that is driven to")
                bench.fault("stuck", recovery_after=1000.0)
            agent.kill()
            under_way |= driven_to(arrays.messages[-1:])
            agent.restart()
            if held:
                await witness.hears(states=1, more=MOST_MORE)
                bench.fault("stuck", active=False)
        witness.enough = True
        await orders

    check_states(witness.states)
    said = [(each.topic, each.payload) for each in bench.mqtt.history if _is_the_robots(bench, each.topic)]
    check_headers((topic, payload) for topic, payload in said if b"CONNECTIONBROKEN" not in payload)
    for message in witness.orders:
        last = [state for state in witness.states if state.order_id == message.order_id][-1]
        assert {each.action_status.value for each in last.action_states} == {"FINISHED"}
        assert all(each.error_level is ErrorLevel.WARNING for each in last.errors)
    assert turns(bench.places) == len(witness.orders) - 1, "the robot has driven back"
    ends = {bytes(e.goal_info.goal_id.uuid): e.status for a in arrays.messages for e in a.status_list}
    assert len(ends) >= sum(len(each.nodes) - 1 for each in witness.orders)
    # One that Nav2 says to have reached may be given again: at a hand-over it says so of a goal undriven, and
    # the pose of a robot that has arrived comes late to a busy machine.
    reached = {
        uuid.UUID(bytes=each) for each, status in ends.items() if status == GoalStatus.STATUS_SUCCEEDED
    }
    assert not given_again(robot.lines) & (under_way - reached), "goals under way are not taken up again"


def driven_to(arrays: Iterable[GoalStatusArray]) -> set[uuid.UUID]:
    """Return the goals that Nav2 drives to."""
    entries = [entry for array in arrays for entry in array.status_list]
    driven = [entry for entry in entries if entry.status == GoalStatus.STATUS_EXECUTING]
    return {uuid.UUID(bytes=bytes(entry.goal_info.goal_id.uuid)) for entry in driven}


def given_again(log: Iterable[str]) -> set[uuid.UUID]:
    """Return the goals that were followed by one to the same place, by the simulator's log."""
    goals = [json.loads(line) for line in log if '"event": "goal"' in line]
    places = [(uuid.UUID(each["goal"]), (each["x"], each["y"])) for each in goals]
    return {goal for (goal, place), (_, following) in pairwise(places) if place == following}


def turns(places: Sequence[float]) -> int:
    """Count how often the robot, which drives along x, has turned back by a metre or more."""
    count, furthest, forward = 0, places[0], True
    for x in places:
        ahead = x - furthest if forward else furthest - x
        if ahead > 0:
            furthest = x
        elif ahead < -1.0:
            count, furthest, forward = count + 1, x, not forward
    return count


def _order(number: int) -> Order:
    """Make the way there, or the way back."""
    names = ["n0", "n1", "n2", "n3"][:: 1 if number % 2 else -1]
    kind = "pick" if number % 2 else "drop"
    actions = {
        "n1": [action(f"load {number}", "HARD", kind)],
        names[-1]: [action(f"wait {number}", "SOFT", "wait", duration=0.3)],
    }
    return order(*names, order_id=f"o{number}", node_actions=actions)


def _is_the_robots(bench: Bench, topic: str) -> bool:
    kinds = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
    return topic in {bench.fleet.topic(each) for each in kinds}
