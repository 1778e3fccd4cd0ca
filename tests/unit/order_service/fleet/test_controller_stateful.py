"""Fleet control against an honest robot over a wire that loses, duplicates and swaps messages.

Each VDA order has exactly one end, an operation is done at most once, reports are true, and nothing is sent
that the rules forbid.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

import hypothesis.strategies as st
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outputs import (
    FleetOutput,
    NodePassed,
    OperationStarted,
    PublishInstantActions,
    PublishOrder,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.state import OperatingMode, State
from support.fleet import Bench, hand_over, make_vda_order

AWAY = {LinkStatus.OFFLINE, LinkStatus.CONNECTION_BROKEN, LinkStatus.HIBERNATING, LinkStatus.UNKNOWN}
OF_MISSIONS = (
    VdaOrderAccepted,
    NodePassed,
    OperationStarted,
    VdaOrderFinished,
    VdaOrderFailed,
    VdaOrderCancelled,
)
ENDS = (VdaOrderFinished, VdaOrderFailed, VdaOrderCancelled)
SETTINGS = FleetSettings(sendings=2, standstill_patience=5, instant_action_limit=60)
"""So little patience that the ends of it are met often."""

RARELY = st.sampled_from([False, False, False, True])


class Conversation(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench(SETTINGS)
        self.bench.take = self.take  # type: ignore[method-assign] # each output is checked as it comes
        self.states: list[State] = []
        self.missions: dict[str, VdaOrder] = {}
        self.ended: dict[str, FleetOutput] = {}
        self.accepted: set[str] = set()
        self.completed: set[str] = set()
        self.cancelled: set[str] = set()
        self.adopted: set[str] = set()
        self.broker = False
        self.arrived = (datetime.min.replace(tzinfo=UTC), -1)
        """Timestamp and headerId of the newest state that the order service has had."""
        self.robot_connected = True
        self.robot_forgot = False
        self.instants: dict[str, Any] = {}
        self.open_cancels: set[str] = set()
        """Those on their way, as long as nothing speaks for their being over."""
        self.set_broker(True)
        self.bench.connection(ConnectionState.ONLINE)
        self.the_robot_reports()
        self.everything_arrives()

    # what is checked of each output

    def take(self, outputs: Iterable[FleetOutput]) -> tuple[FleetOutput, ...]:
        outputs = tuple(outputs)
        for output in outputs:
            self.check(output)
            if isinstance(output, PublishOrder | PublishInstantActions):
                self.bench.wire.append(output)
        return outputs

    def check(self, output: FleetOutput) -> None:
        if isinstance(output, PublishOrder):
            self.check_order(output)
        elif isinstance(output, PublishInstantActions):
            self.check_instants(output)
        elif isinstance(output, OF_MISSIONS):
            self.check_news(output)

    def check_sending(self, *, harmless: bool = False) -> State | None:
        view = self.bench.view()
        assert self.broker, "sent into a broken link of our own"
        assert view.link not in AWAY, "sent to a robot that is away"
        assert harmless or view.state is None or view.state.operating_mode.takes_orders
        return view.state

    def check_order(self, output: PublishOrder) -> None:
        state = self.check_sending()
        name = output.vda_order.order_id
        assert state is not None
        assert not state.node_states, "sent to a robot that drives for an order"
        own = [each for each in state.action_states if each.action_id not in self.instants]
        assert all(each.action_status.ended for each in own), "sent to a robot that acts for an order"
        assert not self.open_cancels, "sent though a cancel may yet hit it"
        assert output.vda_order == self.missions[name], "what is sent again is the same"
        assert name not in self.ended, "sent after its end"
        assert name not in self.cancelled, "sent after its cancel"
        assert name not in self.accepted, "sent though the robot has it"

    def check_instants(self, output: PublishInstantActions) -> None:
        self.check_sending(harmless=all(each.action_type == "stateRequest" for each in output.actions))
        for action in output.actions:
            if action.action_type != "stateRequest":
                self.open_cancels.add(action.action_id)
            assert self.instants.setdefault(action.action_id, action) == action, "an id was used twice"

    def check_news(self, output: Any) -> None:
        name = output.order_id
        assert name in self.missions
        assert name not in self.ended, f"{output} after {self.ended.get(name)}"
        if isinstance(output, VdaOrderAccepted):
            assert name in self.bench.robot.accepted
            self.accepted.add(name)
        if isinstance(output, VdaOrderFinished):
            assert name in self.completed, "told as finished, but the robot has not done it"
        if isinstance(output, VdaOrderFailed):
            assert self.robot_forgot or "no longer has" not in str(output.reason), (
                "told as lost, but it was not"
            )
        if isinstance(output, VdaOrderCancelled):
            assert name in self.cancelled
            on_the_wire = {
                each.vda_order.order_id for each in self.bench.wire if isinstance(each, PublishOrder)
            }
            known = on_the_wire - self.adopted
            assert name not in known, "told as cancelled, but the robot may still get it"
        if isinstance(output, ENDS):
            self.ended[name] = output

    # what the order service does

    @property
    def open_vda_order(self) -> str | None:
        return next((name for name in self.missions if name not in self.ended), None)

    @precondition(lambda self: self.open_vda_order is None)
    @rule(way=st.integers(1, 3), operation=st.booleans())
    def start(self, way: int, operation: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        name = f"m{len(self.missions)}"
        x = self.bench.robot.position[0]
        points = [f"{x + step}" for step in range(way)]
        self.missions[name] = make_vda_order(name, *points, operation="pick" if operation else None, x=x)
        self.bench.start(self.missions[name])

    @precondition(lambda self: self.open_vda_order is not None)
    @rule()
    def cancel(self) -> None:
        self.cancelled.add(self.open_vda_order or "")
        self.bench.cancel()

    @rule(happens=RARELY)
    def restart_of_the_order_service(self, happens: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        if not happens:
            return
        bench = self.bench
        self.open_cancels.clear()
        # A broker gives a new subscriber nothing from before what the old one has had.
        self.states = [each for each in self.states if (each.timestamp, each.header_id) > self.arrived]
        numbers = len(self.instants)
        ids = (f"r{numbers}-{number}" for number in range(1000))
        bench.fleet = FleetController(SETTINGS, new_id=lambda: next(ids))
        vda_order = self.open_vda_order
        if vda_order is not None:
            known = vda_order in self.accepted
            self.adopted.add(vda_order)
            self.accepted.discard(vda_order)
            self.take(bench.control.adopt_order(self.missions[vda_order], bench.now, accepted=known))
            if vda_order in self.cancelled:
                bench.cancel()
        bench.set_broker(connected=self.broker)
        told = ConnectionState.ONLINE if self.robot_connected else ConnectionState.CONNECTION_BROKEN
        bench.connection(told)

    # what time and the wire do

    @rule(seconds=st.sampled_from([0.25, 1.0, 4.0, 20.0]))
    def time_passes(self, seconds: float) -> None:
        self.bench.now += seconds
        self.open_cancels.clear()  # some may have been given up
        self.bench.tick()

    @precondition(lambda self: self.bench.wire)
    @rule(fate=st.sampled_from(["deliver", "deliver", "double", "lose"]))
    def the_wire_to_the_robot(self, fate: str) -> None:
        output = self.bench.wire.pop(0)
        if self.robot_connected and fate != "lose":
            for _ in range(2 if fate == "double" else 1):
                hand_over(output, self.bench.robot)
            self.note_completed()
            self.the_robot_reports()

    @rule()
    def the_robot_reports(self) -> None:
        if self.robot_connected and self.broker:
            self.states.append(self.bench.robot.state(self.bench.now))

    @precondition(lambda self: self.states)
    @rule(fate=st.sampled_from(["deliver", "double", "swap", "swap", "lose"]))
    def the_wire_from_the_robot(self, fate: str) -> None:
        if fate == "swap" and len(self.states) > 1:
            self.states[0], self.states[1] = self.states[1], self.states[0]
        state = self.states.pop(0)
        for _ in range({"double": 2, "lose": 0}.get(fate, 1)):
            self.the_state_arrives(state)

    @rule()
    def everything_arrives(self) -> None:
        for state in self.states:
            self.the_state_arrives(state)
        self.states.clear()

    def the_state_arrives(self, state: State) -> None:
        self.arrived = max(self.arrived, (state.timestamp, state.header_id))
        self.open_cancels -= {each.action_id for each in state.action_states if each.action_status.ended}
        self.take(self.bench.fleet.on_state(self.bench.robot.key, state, self.bench.now))

    @rule(happens=RARELY)
    def the_robots_link_breaks(self, happens: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        if happens and self.robot_connected:
            self.robot_connected = False
            self.states.clear()
            self.bench.wire.clear()
            self.bench.connection(ConnectionState.CONNECTION_BROKEN)

    @rule()
    def the_robot_connects(self) -> None:
        if not self.robot_connected:
            self.robot_connected = True
            self.bench.connection(ConnectionState.ONLINE)
            self.the_robot_reports()

    @rule(connected=st.sampled_from([True, True, True, False]))
    def our_link_comes_or_goes(self, connected: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        self.set_broker(connected)

    def set_broker(self, connected: bool) -> None:  # noqa: FBT001
        if connected is self.broker:
            return
        self.broker = connected
        if not connected:
            self.bench.wire.clear()
            self.states.clear()
        self.bench.set_broker(connected=connected)

    # what the robot does

    @rule()
    def the_robot_goes_on(self) -> None:
        self.bench.robot.step()
        self.note_completed()
        self.the_robot_reports()

    @rule(mode=st.sampled_from([OperatingMode.AUTOMATIC] * 3 + [OperatingMode.MANUAL]))
    def somebody_turns_the_key(self, mode: OperatingMode) -> None:
        self.bench.robot.set_mode(mode)
        self.the_robot_reports()

    @rule(fail=RARELY)
    def actions_fail_from_now_on(self, fail: bool) -> None:  # noqa: FBT001
        self.bench.robot.actions_fail = fail

    @rule(blocked=RARELY)
    def ways_are_blocked(self, blocked: bool) -> None:  # noqa: FBT001
        ahead = {each.node_id for each in self.bench.robot.nodes}
        self.bench.robot.unreachable = ahead if blocked else set()

    @rule(journal=st.booleans(), happens=RARELY)
    def the_robot_starts_anew(self, journal: bool, happens: bool) -> None:  # noqa: FBT001
        if not happens:
            return
        self.the_robots_link_breaks(happens=True)
        self.open_cancels.clear()
        self.bench.now += 0.25
        self.bench.robot.restart(journal=journal)
        self.robot_forgot = self.robot_forgot or not journal

    def note_completed(self) -> None:
        robot = self.bench.robot
        vda_order = self.missions.get(robot.order_id)
        if vda_order is None or not robot.idle or robot.last_sequence_id != vda_order.last_sequence_id:
            return
        if all(status.name == "FINISHED" for status in robot.statuses.values()):
            self.completed.add(vda_order.order_id)

    # what always holds

    @invariant()
    def nothing_is_done_twice(self) -> None:
        executed = self.bench.robot.executed
        assert self.robot_forgot or len(executed) == len(set(executed))

    def teardown(self) -> None:
        """Remove all faults: everything ends and the robot is at standstill."""
        robot = self.bench.robot
        robot.set_mode(OperatingMode.AUTOMATIC)
        robot.actions_fail, robot.unreachable, robot.paused = False, set(), False
        robot.errors.clear()
        self.set_broker(True)
        self.the_robot_connects()
        for _ in range(200):
            self.bench.now += 0.5
            while self.bench.wire:
                hand_over(self.bench.wire.pop(0), robot)
            self.the_robot_goes_on()
            self.everything_arrives()
            self.open_cancels.clear()  # some may be given up by the tick, as in time_passes
            self.bench.tick()
        assert self.ended.keys() == self.missions.keys(), f"no end of {self.open_vda_order}"
        assert robot.idle
        assert self.bench.view().availability.can_take_order, self.bench.view().availability.reason


Conversation.TestCase.settings = settings(max_examples=75, stateful_step_count=60, deadline=None)
TestConversation = Conversation.TestCase
