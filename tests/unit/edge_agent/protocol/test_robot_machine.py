"""The core against a small oracle, over random orders, updates, cancels, pauses, failures and restarts.

The oracle knows nothing of how the core works: it keeps the base as a list that only grows, and follows the
states. No node is skipped, none behind the base is entered, no action is lost or run twice, nothing is taken
that must be refused, and in the end the robot is idle.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    NavigationReport,
    PoseReport,
)
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.effects import (
    CancelAction,
    Drive,
    Effect,
    PauseAction,
    ResumeAction,
    StartAction,
)
from nena_edge_agent.protocol.events import ActionReport, OrderReceived, Started
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.order import Edge, Node, Order
from support.robot_core import Bench, action, at, order

BLOCKING = st.sampled_from([each.value for each in BlockingType])
KINDS = st.sampled_from(["work", "press", "lamp"])
ENDED = ("FINISHED", "FAILED")
ACTIVE = ("INITIALIZING", "RUNNING", "PAUSED")
STANDING = ("SOFT", "HARD")
DURABLE = (
    *("order_id", "order_update_id", "last_node_id", "last_node_sequence_id", "paused"),
    *("node_states", "edge_states", "action_states", "loads"),
)
THERE = NavigationReport(available=True, reason="")


def place(node_id: str) -> float:
    """Give the x in m of a node, as ``order`` lays it."""
    return 10.0 * int(node_id[1:])


@dataclass
class Oracle:
    """What must be true of the held order: its way as (nodeId, sequenceId), and its actions."""

    order_id: str = ""
    update: int = 0
    base: list[tuple[str, int]] = field(default_factory=list)
    horizon: list[tuple[str, int]] = field(default_factory=list)
    reached: int = 0
    cancelled: bool = False
    base_actions: dict[str, Action] = field(default_factory=dict)
    horizon_actions: set[str] = field(default_factory=set)

    def take(self, order: Order) -> None:
        way = [(node.node_id, node.sequence_id) for node in order.nodes]
        released = [node.released for node in order.nodes].count(True)
        if order.order_id != self.order_id:
            self.base, self.reached, self.cancelled = [way[0]], 0, False
            self.base_actions = {each.action_id: each for each in order.nodes[0].actions}
        self.order_id, self.update = order.order_id, order.order_update_id
        self.base += way[1:released]
        self.horizon = way[released:]
        self.horizon_actions = set()
        parts: tuple[Node | Edge, ...] = (*order.nodes[1:], *order.edges)
        for part in parts:
            for each in part.actions:
                if part.released:
                    self.base_actions[each.action_id] = each
                else:
                    self.horizon_actions.add(each.action_id)


class RobotMachine(RuleBasedStateMachine):
    strategy = DriveStrategy.STOP_AT_NODES

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench(strategy=self.strategy)
        self.oracle = Oracle()
        self.count = 0
        self.starts: Counter[str] = Counter()
        self.ended: set[str] = set()
        self.x = 0.0
        self.localized = True

    # What fleet control does

    @rule(data=st.data(), length=st.integers(1, 4), new=st.booleans())
    def order_comes(self, data: st.DataObject, length: int, new: bool) -> None:  # noqa: FBT001
        if new or not self.oracle.base:
            last = self.oracle.base[self.oracle.reached][0] if self.oracle.base else "n0"
            start = data.draw(st.sampled_from([last, last, "n0", "n4"]))
            self.judged(self.draw_order(data, length, f"o{self.next_number()}", 0, (start, 0)))
        else:
            name, number = self.oracle.base[-1]
            shift = data.draw(st.sampled_from([0, 0, 0, 2]))
            update = max(0, self.oracle.update + data.draw(st.sampled_from([1, 1, 2, 0, -1])))
            self.judged(self.draw_order(data, length, self.oracle.order_id, update, (name, number + shift)))

    @rule(kind=st.sampled_from(["cancelOrder", "startPause", "stopPause", "stateRequest"]))
    def instant_action_comes(self, kind: str) -> None:
        action_id, busy = f"i{self.next_number()}", not self.bench.idle
        if kind == "cancelOrder" and busy:
            self.oracle.cancelled = True
        self.follow(self.bench.instant(action(action_id, "NONE", kind)))
        if kind == "cancelOrder" and not busy:
            assert self.bench.status(action_id) == "FAILED"

    # What the world does

    @precondition(lambda self: self.driving)
    @rule()
    def arrives(self) -> None:
        goal = self.bench.goal
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

    @rule(back=st.integers(1, 3))
    def late_arrival(self, back: int) -> None:
        before = self.bench.state
        self.follow(self.bench.do(Arrived(self.bench.core.parts.goal.generation - back)))
        assert self.bench.state == before

    @precondition(lambda self: self.bench.core.parts.goal.halting)
    @rule()
    def stands_still(self) -> None:
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

    @rule()
    def agent_is_killed(self) -> None:
        before = self.bench.state
        kept = self.bench.core.memory().model_dump_json(exclude_defaults=True)
        for each in self.actions_in(*ACTIVE):
            self.starts[each] = 0  # what ran may be begun anew
        self.bench = Bench(memory=Memory.model_validate_json(kept), ready=False, strategy=self.strategy)
        after = self.bench.state
        assert all(getattr(after, name) == getattr(before, name) for name in DURABLE)
        for event in (Started(), self.pose(), THERE):
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
        if order_id == self.oracle.order_id:
            on_nodes.pop(names[0], None)
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
            action(f"a{self.next_number()}", data.draw(BLOCKING), data.draw(KINDS)) for _ in range(number)
        ]

    def judged(self, made: Order) -> None:
        wanted, before = self.expected(made), self.bench.state
        effects = self.bench.send(made)
        after = self.bench.state
        if wanted == "taken":
            assert (after.order_id, after.order_update_id) == (made.order_id, made.order_update_id), after
            self.oracle.take(made)
        else:
            assert after.model_copy(update={"errors": ()}) == before.model_copy(update={"errors": ()})
            assert after.errors if wanted == "refused" else after.errors == before.errors
        self.follow(effects)

    def expected(self, made: Order) -> str:
        oracle, first = self.oracle, made.nodes[0]
        if made.order_id != oracle.order_id:
            busy = self.bench.state.node_states or self.actions_in("WAITING", *ACTIVE)
            clearing = self.bench.core.parts.clearing
            return "refused" if busy or clearing or not self.stands_on(first) else "taken"
        if made.order_update_id < oracle.update or oracle.cancelled:
            return "refused"
        if made.order_update_id == oracle.update:
            return "dropped"
        return "taken" if (first.node_id, first.sequence_id) == oracle.base[-1] else "refused"

    def stands_on(self, node: Node) -> bool:
        progress = self.bench.core.parts.progress
        reached = progress.on_last_node and progress.last_node_id == node.node_id
        return reached or (self.localized and abs(self.x - place(node.node_id)) <= 0.3)

    # Doing what the core wants

    def follow(self, effects: list[Effect]) -> None:
        """Answer as driver and plug-ins would, until the core wants nothing more."""
        self.answer(effects)
        self.ended |= set(self.actions_in(*ENDED))

    def answer(self, effects: list[Effect]) -> None:
        for effect in effects:
            match effect:
                case Drive(goal):
                    self.goes_to_the_next_node_of_the_base(goal)
                case StartAction(started):
                    self.may_start(started.action_id)
                    self.answer(self.bench.runs(started.action_id))
                case CancelAction(action_id):
                    self.report(action_id, ActionStatus.FAILED)
                case PauseAction(action_id):
                    self.report(action_id, ActionStatus.PAUSED)
                case ResumeAction(action_id):
                    self.report(action_id, ActionStatus.RUNNING)
                case _:
                    pass

    def report(self, action_id: str, status: ActionStatus) -> None:
        self.answer(self.bench.do(ActionReport(action_id, status)))

    def may_start(self, action_id: str) -> None:
        self.starts[action_id] += 1
        assert self.starts[action_id] == 1
        assert action_id not in self.ended
        assert action_id not in self.oracle.horizon_actions

    def goes_to_the_next_node_of_the_base(self, goal: DriveGoal) -> None:
        if goal.generation == self.bench.core.parts.goal.generation and self.driving:
            state = self.bench.state
            last = self.oracle.base.index((state.last_node_id, state.last_node_sequence_id))
            assert goal.pose.x == place(self.oracle.base[last + 1][0])

    def pose(self, *, place_x: float | None = None) -> PoseReport:
        self.x = self.x if place_x is None else place_x
        return at(self.x, localized=self.localized)

    def actions_in(self, *statuses: str) -> list[str]:
        return [each for each, status in self.bench.statuses().items() if status in statuses]

    @property
    def driving(self) -> bool:
        return self.bench.core.parts.goal.target is not None

    # What must always hold

    @invariant()
    def the_way_is_followed_in_its_order(self) -> None:
        oracle, state = self.oracle, self.bench.state
        if oracle.base:
            last = (state.last_node_id, state.last_node_sequence_id)
            oracle.reached = oracle.base.index(last, oracle.reached)

    @invariant()
    def what_is_left_is_the_base_that_was_released_and_the_horizon(self) -> None:
        oracle, state = self.oracle, self.bench.state
        left = [(node.node_id, node.sequence_id) for node in state.node_states]
        over = oracle.cancelled and not self.bench.core.parts.clearing
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
        assert not (blocking and self.driving)
        assert not (self.bench.state.paused and self.driving)

    # What must come of it in the end

    def teardown(self) -> None:
        """Remove every hindrance: the robot comes to the end of its base, and is idle without a horizon."""
        self.localized = True
        self.follow(self.bench.do(self.pose(), THERE))
        self.follow(self.bench.instant(action(f"i{self.next_number()}", "NONE", "stopPause")))
        for _ in range(300):
            if not self.goes_on():
                break
        failed = self.bench.core.parts.goal.failed_at is not None
        assert self.bench.idle or self.oracle.horizon or failed, self.bench.state
        if not failed and not self.oracle.cancelled and self.oracle.base:
            assert self.bench.core.parts.progress.last_node_sequence_id == self.oracle.base[-1][1]

    def goes_on(self) -> bool:
        running = self.actions_in(*ACTIVE)
        if self.bench.core.parts.goal.halting:
            self.stands_still()
        elif self.driving:
            self.arrives()
        elif running:
            self.follow(self.bench.finishes(running[0]))
        else:
            return False
        self.the_way_is_followed_in_its_order()
        self.what_is_left_is_the_base_that_was_released_and_the_horizon()
        self.no_action_is_lost()
        return True


class PassingMachine(RobotMachine):
    strategy = DriveStrategy.PASS_THROUGH


MANY = settings(max_examples=100, stateful_step_count=40, deadline=None)
TestStopAtNodes = RobotMachine.TestCase
TestStopAtNodes.settings = MANY
TestPassThrough = PassingMachine.TestCase
TestPassThrough.settings = MANY


def test_an_order_may_be_journalled_and_read_again_as_it_was() -> None:
    bench = Bench()
    bench.do(OrderReceived(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD", size=[1, {}])]})))

    memory = bench.core.memory()

    assert Memory.model_validate_json(memory.model_dump_json(exclude_defaults=True)) == memory
