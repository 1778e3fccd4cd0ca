"""The core against a small oracle, over random orders, updates, cancels, pauses, failures and restarts.

The oracle is independent of the core: it keeps the base as a list that only grows, and follows the states. No
node is skipped, none behind the base is entered, no action is lost or run twice, none that must stand starts
while the robot moves, no stop is finished before it stands, nothing is accepted that must be refused, and in
the end the robot is idle.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    GoalReport,
    GoalTable,
    HaltFailed,
    NavigationReport,
    PoseReport,
)
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import (
    ActionReport,
    CancelAction,
    Drive,
    Effect,
    OperatingModeSwitched,
    OrderReceived,
    PauseAction,
    ResumeAction,
    StartAction,
    Started,
    TimePassed,
)
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.order import Node, Order
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from support.examples import EXAMPLES
from support.expressible import EXPRESSIBLE
from support.robot_core import Bench, action, at, order
from support.robot_oracle import FLEET_CONTROLS_IN, Oracle

pytestmark = pytest.mark.simulation

BLOCKING = st.sampled_from([each.value for each in BlockingType])
KINDS = st.sampled_from(["work", "press", "lamp"])
ENDED = ("FINISHED", "FAILED")
ACTIVE = ("INITIALIZING", "RUNNING", "PAUSED", "RETRIABLE")
STANDING = ("SOFT", "HARD")
SPEED = 0.5
"""Metres per second of a robot that moves."""
FOREIGN = GoalTable((GoalReport("F", external=True, status="EXECUTING"),))
DURABLE = (
    *("order_id", "order_update_id", "last_node_id", "last_node_sequence_id", "paused"),
    *("node_states", "edge_states", "action_states", "loads"),
)
THERE = NavigationReport(available=True, reason="")


def place(node_id: str) -> float:
    """Return the x in m of a node, as placed by ``order``."""
    return 10.0 * int(node_id[1:])


class RobotMachine(RuleBasedStateMachine):
    strategy = DriveStrategy.STOP_AT_NODES
    version = "2.1.0"

    def __init__(self) -> None:
        super().__init__()
        self.robot_rules = RULES[self.version]
        self.bench = Bench(strategy=self.strategy, rules=self.robot_rules)
        self.oracle = Oracle(self.robot_rules)
        self.count = 0
        self.starts: Counter[str] = Counter()
        self.ended: set[str] = set()
        self.x = 0.0
        self.localized = True
        self.speed = 0.0
        self.foreign = False
        self.instants: dict[str, Action] = {}
        self.stopped: set[str] = set()
        """Stops that have been answered."""

    # What fleet control does

    @rule(data=st.data(), length=st.integers(1, 4), new=st.booleans())
    def order_comes(self, data: st.DataObject, length: int, new: bool) -> None:  # noqa: FBT001
        if new or not self.oracle.base:
            last = self.oracle.base[self.oracle.reached][0] if self.oracle.base else "n0"
            start = data.draw(st.sampled_from([last, last, "n0", "n4"]))
            update = data.draw(st.sampled_from([0, 0, 0, 1]))
            self.judged(self.draw_order(data, length, f"o{self.next_number()}", update, (start, 0)))
        else:
            name, number = self.oracle.base[-1]
            shift = data.draw(st.sampled_from([0, 0, 0, 2]))
            update = max(0, self.oracle.update + data.draw(st.sampled_from([1, 1, 2, 0, -1])))
            self.judged(self.draw_order(data, length, self.oracle.order_id, update, (name, number + shift)))

    @rule(kind=st.sampled_from(["cancelOrder", "startPause", "stopPause", "stateRequest"]))
    def instant_action_comes(self, kind: str) -> None:
        action_id, busy = f"i{self.next_number()}", not self.bench.idle
        taken = self.oracle.takes(kind)
        if kind == "cancelOrder" and busy and taken:
            self.oracle.cancelled = True
        self.follow(self.bench.instant(action(action_id, "NONE", kind)))
        if not taken or (kind == "cancelOrder" and not busy):
            assert self.bench.status(action_id) == "FAILED"

    @rule(blocking=BLOCKING)
    def instant_work_comes(self, blocking: str) -> None:
        work = action(f"i{self.next_number()}", blocking, "press")
        self.instants[work.action_id] = work
        self.follow(self.bench.instant(work))

    # What the world does

    @rule(data=st.data(), back=st.booleans())
    def person_switches_the_mode(self, data: st.DataObject, back: bool) -> None:  # noqa: FBT001
        modes = sorted(EXPRESSIBLE[self.version].operating_modes)
        mode = OperatingMode.AUTOMATIC if back else data.draw(st.sampled_from(modes))
        self.switch(mode)

    @precondition(lambda self: self.driving)
    @rule(rolls=st.booleans())
    def arrives(self, *, rolls: bool = False) -> None:
        goal = self.bench.goal
        self.speed = SPEED if rolls else 0.0
        self.follow(self.bench.do(self.pose(place_x=goal.pose.x)))
        self.follow(self.bench.do(Arrived(goal.generation)))

    @precondition(lambda self: self.driving)
    @rule()
    def comes_near(self) -> None:
        self.follow(self.bench.do(self.pose(place_x=self.bench.goal.pose.x - 0.2)))

    @precondition(lambda self: self.driving)
    @rule()
    def drive_fails(self) -> None:
        generation = self.bench.goal.generation
        self.follow(self.bench.do(DriveFailed(generation, DriveFailure.ABORTED, "no way")))

    @precondition(lambda self: not self.driving and not self.foreign)
    @rule(pushed=st.booleans())
    def moves_or_rolls_out(self, *, pushed: bool) -> None:
        self.speed = SPEED if pushed else 0.0
        self.follow(self.bench.do(self.pose()))

    @rule(begins=st.booleans())
    def operator_drives(self, *, begins: bool) -> None:
        self.foreign = begins
        self.speed = SPEED if begins else self.speed
        self.follow(self.bench.do(FOREIGN if begins else GoalTable(), self.pose()))

    @precondition(lambda self: self.bench.core.robot.goal.halting)
    @rule()
    def does_not_stop(self) -> None:
        self.speed = SPEED
        self.follow(self.bench.do(self.pose(), HaltFailed("the odometry still shows 0.50 m/s")))

    @rule(seconds=st.sampled_from([1.0, 4.0, 11.0]))
    def time_passes(self, seconds: float) -> None:
        self.bench.now += seconds
        self.follow(self.bench.do(TimePassed()))

    @rule(back=st.integers(1, 3))
    def late_arrival(self, back: int) -> None:
        before = self.bench.state
        self.follow(self.bench.do(Arrived(self.bench.core.robot.goal.generation - back)))
        assert self.bench.state == before

    @precondition(lambda self: self.bench.core.robot.goal.halting)
    @rule()
    def stands_still(self) -> None:
        if not self.foreign:  # the driver does not stop another program's drive
            self.speed = 0.0
            self.follow(self.bench.do(self.pose()))
        self.follow(self.bench.halted())

    @rule(there=st.booleans())
    def navigation(self, there: bool) -> None:  # noqa: FBT001
        self.follow(self.bench.do(NavigationReport(available=there, reason="" if there else "gone")))

    @rule(localized=st.booleans())
    def localisation(self, localized: bool) -> None:  # noqa: FBT001
        self.localized = localized
        self.follow(self.bench.do(self.pose()))

    @rule(data=st.data(), good=st.booleans())
    def action_ends(self, data: st.DataObject, good: bool) -> None:  # noqa: FBT001
        running = self.actions_in("INITIALIZING", "RUNNING")
        if running:
            chosen = data.draw(st.sampled_from(running))
            self.follow(self.bench.finishes(chosen) if good else self.bench.fails(chosen))

    @rule(data=st.data(), again=st.booleans())
    def retry_comes(self, data: st.DataObject, again: bool) -> None:  # noqa: FBT001
        failed = self.actions_in("RETRIABLE")
        if failed and self.oracle.takes("retry") and not self.bench.core.robot.held:
            self.try_again(data.draw(st.sampled_from(failed)), again=again)

    @rule()
    def agent_is_killed(self) -> None:
        before = self.bench.state
        kept = self.bench.core.memory().model_dump_json(exclude_defaults=True)
        for each in self.actions_in(*ACTIVE):
            self.starts[each] = 0  # what ran may be begun again
        self.bench = Bench(
            memory=Memory.model_validate_json(kept),
            ready=False,
            strategy=self.strategy,
            rules=self.robot_rules,
        )
        after = self.bench.state
        assert all(getattr(after, name) == getattr(before, name) for name in DURABLE)
        foreign = FOREIGN if self.foreign else GoalTable()
        for event in (Started(), foreign, self.pose(), THERE):
            self.follow(self.bench.do(event))

    # Making orders, and saying what must become of them

    def next_number(self) -> int:
        self.count += 1
        return self.count

    def draw_order(
        self, data: st.DataObject, length: int, order_id: str, update: int, start: tuple[str, int]
    ) -> Order:
        """Make an order of random nodes; one that comes twice has no actions, as no actionId may repeat."""
        names = [start[0], *(f"n{data.draw(st.integers(1, 8))}" for _ in range(length - 1))]
        on_nodes = {name: self.draw_actions(data) for name in names if names.count(name) == 1}
        known = self.oracle.decision_node if order_id == self.oracle.order_id else None
        if known and names.count(names[0]) == 1:  # its actions are known already, and do not run again
            on_nodes[names[0]] = list(known.actions) if names[0] == known.node_id else []
        pairs = [f"{one}-{other}" for one, other in pairwise(names)]
        return order(
            *names,
            order_id=order_id,
            update=update,
            first=start[1],
            released=data.draw(st.integers(1, length)),
            node_actions=on_nodes,
            edge_actions={pair: self.draw_actions(data) for pair in pairs if pairs.count(pair) == 1},
        )

    def draw_actions(self, data: st.DataObject) -> list[Action]:
        number = data.draw(st.sampled_from([0, 0, 1, 2]))
        return [
            action(
                f"a{self.next_number()}",
                data.draw(BLOCKING),
                data.draw(KINDS),
                retriable=data.draw(st.sampled_from([None, True])),
            )
            for _ in range(number)
        ]

    def judged(self, made: Order) -> None:
        wanted, before = self.expected(made), self.bench.state
        effects = self.bench.send(made)
        after = self.bench.state
        if wanted == "taken":
            assert (after.order_id, after.order_update_id) == (made.order_id, made.order_update_id), (
                after.errors
            )
            self.oracle.take(made)
        else:
            assert after.model_copy(update={"errors": ()}) == before.model_copy(update={"errors": ()})
            assert after.errors if wanted == "refused" else after.errors == before.errors, (
                wanted,
                after.errors,
            )
        self.follow(effects)

    def expected(self, made: Order) -> str:
        progress, robot = self.bench.core.robot.progress, self.bench.core.robot
        busy = self.bench.state.node_states or self.actions_in("WAITING", *ACTIVE)
        return self.oracle.expected(
            made,
            busy=bool(busy),
            clearing=robot.clearing,
            stands=self.is_at_node(made.nodes[0]),
            forgotten=not progress.last_node_id,
        )

    def is_at_node(self, node: Node) -> bool:
        progress = self.bench.core.robot.progress
        reached = progress.on_last_node and progress.last_node_id == node.node_id
        return reached or (self.localized and abs(self.x - place(node.node_id)) <= 0.3)

    # Doing what the core wants

    def follow(self, effects: list[Effect]) -> None:
        """Answer as driver and plug-ins would, until the core wants nothing more."""
        self.answer(effects)
        self.ended |= set(self.actions_in(*ENDED))
        self.stops_are_answered_truthfully()

    def stops_are_answered_truthfully(self) -> None:
        for state in (*self.bench.state.instant_action_states, *self.bench.state.action_states):
            stop = state.action_type in ("cancelOrder", "startPause") and state.action_status.value in ENDED
            if stop and state.action_id not in self.stopped:
                self.stopped.add(state.action_id)
                stands = not self.speed or self.foreign or self.oracle.mode not in FLEET_CONTROLS_IN
                assert stands or state.action_status is not ActionStatus.FINISHED, state

    def answer(self, effects: list[Effect]) -> None:
        for effect in effects:
            match effect:
                case Drive(goal):
                    self.speed = SPEED
                    self.goes_to_the_next_node_of_the_base(goal)
                case StartAction(started):
                    self.may_start(started)
                    self.answer(self.bench.runs(started.action_id))
                case CancelAction(action_id):
                    self.report(action_id, ActionStatus.FAILED)
                case PauseAction(action_id):
                    self.report(action_id, ActionStatus.PAUSED)
                case ResumeAction(action_id):
                    self.report(action_id, ActionStatus.RUNNING)
                case _:
                    pass

    def try_again(self, action_id: str, *, again: bool) -> None:
        if again:
            self.starts[action_id] = 0
        kind = "retry" if again else "skipRetry"
        self.follow(self.bench.instant(action(f"i{self.next_number()}", "NONE", kind, actionId=action_id)))
        waits = self.oracle.base_actions[action_id].blocking_type in STANDING and not self.stands
        retried = "INITIALIZING" if waits else "RUNNING"
        assert self.bench.statuses()[action_id] == (retried if again else "FAILED")

    def report(self, action_id: str, status: ActionStatus) -> None:
        self.answer(self.bench.do(ActionReport(action_id, status)))

    def may_start(self, started: Action) -> None:
        action_id = started.action_id
        if started.blocking_type in STANDING:
            assert self.stands, f"{started} starts while the robot moves"
        self.starts[action_id] += 1
        assert self.starts[action_id] == 1
        assert action_id not in self.ended
        assert action_id not in self.oracle.horizon_actions

    def goes_to_the_next_node_of_the_base(self, goal: DriveGoal) -> None:
        if goal.generation == self.bench.core.robot.goal.generation and self.driving:
            state = self.bench.state
            last = self.oracle.base.index((state.last_node_id, state.last_node_sequence_id))
            assert goal.pose.x == place(self.oracle.base[last + 1][0])

    def pose(self, *, place_x: float | None = None) -> PoseReport:
        self.x = self.x if place_x is None else place_x
        return replace(at(self.x, localized=self.localized), vx=self.speed)

    def switch(self, mode: OperatingMode) -> None:
        self.oracle.switch(mode)
        self.follow(self.bench.do(OperatingModeSwitched(mode)))

    def actions_in(self, *statuses: str) -> list[str]:
        return [each for each, status in self.bench.statuses().items() if status in statuses]

    def instants_in(self, *statuses: str) -> list[str]:
        states = (*self.bench.state.instant_action_states, *self.bench.state.action_states)
        return [
            each.action_id
            for each in states
            if each.action_id in self.instants and each.action_status in statuses
        ]

    @property
    def stands(self) -> bool:
        halting = self.bench.core.robot.goal.halting
        return not (self.speed or halting or self.driving or self.foreign)

    @property
    def driving(self) -> bool:
        return self.bench.core.robot.goal.target is not None

    # What must always hold

    @invariant()
    def the_way_is_followed_in_its_order(self) -> None:
        oracle, state = self.oracle, self.bench.state
        if oracle.base and state.last_node_id:
            last = (state.last_node_id, state.last_node_sequence_id)
            oracle.reached = oracle.base.index(last, oracle.reached)

    @invariant()
    def what_is_left_is_the_base_that_was_released_and_the_horizon(self) -> None:
        oracle, state = self.oracle, self.bench.state
        left = [(node.node_id, node.sequence_id) for node in state.node_states]
        over = (oracle.cancelled or oracle.cleared) and not self.bench.core.robot.clearing
        assert left == ([] if over or not oracle.base else oracle.base[oracle.reached + 1 :] + oracle.horizon)
        assert len(state.edge_states) == len(left)

    @invariant()
    def no_action_is_lost(self) -> None:
        shown, oracle = self.bench.statuses(), self.oracle
        assert set(shown) == set(oracle.base_actions) | oracle.horizon_actions
        assert {shown[each] for each in oracle.horizon_actions} <= {"WAITING", "FAILED"}
        assert self.ended.isdisjoint(self.actions_in("WAITING", *ACTIVE))

    @invariant()
    def the_robot_stands_while_an_action_wants_it_to(self) -> None:
        actions = self.oracle.base_actions
        blocking = [each for each in self.actions_in(*ACTIVE) if actions[each].blocking_type in STANDING]
        instants = self.instants_in(*ACTIVE)
        blocking += [each for each in instants if self.instants[each].blocking_type in STANDING]
        assert not (blocking and self.driving)
        assert not (self.bench.state.paused and self.driving)

    # What must come of it in the end

    def teardown(self) -> None:
        """Remove every hindrance: the robot comes to the end of its base, and is idle without a horizon."""
        self.localized = True
        self.switch(OperatingMode.AUTOMATIC)
        self.operator_drives(begins=False)
        self.follow(self.bench.do(self.pose(), THERE))
        self.follow(self.bench.instant(action(f"i{self.next_number()}", "NONE", "stopPause")))
        for _ in range(300):
            if not self.goes_on():
                break
        failed = self.bench.core.robot.goal.failed_at is not None
        assert self.bench.idle or self.oracle.horizon or failed, self.bench.state
        ended_early = self.oracle.cancelled or self.oracle.cleared
        if not failed and not ended_early and self.oracle.base:
            assert self.bench.core.robot.progress.last_node_sequence_id == self.oracle.base[-1][1]

    def goes_on(self) -> bool:
        running = [*self.actions_in(*ACTIVE), *self.instants_in(*ACTIVE)]
        if self.bench.core.robot.goal.halting:
            self.stands_still()
        elif self.driving:
            self.arrives()
        elif failed := self.actions_in("RETRIABLE"):
            self.try_again(failed[0], again=False)
        elif running:
            self.follow(self.bench.finishes(running[0]))
        else:
            return False
        self.the_way_is_followed_in_its_order()
        self.what_is_left_is_the_base_that_was_released_and_the_horizon()
        self.no_action_is_lost()
        return True


def machine(of_version: str, of_strategy: DriveStrategy) -> type[RobotMachine]:
    """Make the machine of a version and a drive strategy."""

    class Machine(RobotMachine):
        version, strategy = of_version, of_strategy

    return Machine


@pytest.mark.clause("6.1.2", "6.1.3", "6.2.2", "6.6.1", "6.6.6", "6.6.7")
@pytest.mark.parametrize("strategy", DriveStrategy)
@pytest.mark.parametrize("version", RULES)
def test_the_core_keeps_its_invariants(version: str, strategy: DriveStrategy) -> None:
    examples = EXAMPLES // (len(RULES) * len(DriveStrategy)) + 1
    run_state_machine_as_test(
        machine(version, strategy), settings=settings(max_examples=examples, stateful_step_count=40)
    )


def test_an_order_in_the_journal_is_read_unchanged() -> None:
    bench = Bench()
    bench.do(OrderReceived(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD", size=[1, {}])]})))

    memory = bench.core.memory()

    assert Memory.model_validate_json(memory.model_dump_json(exclude_defaults=True)) == memory
