"""Spans of a robot's orders, goals and actions."""

from __future__ import annotations

from nena_edge_agent.driver.port import DriveFailed, DriveFailure, GoalReport, GoalTable
from nena_edge_agent.extensions.tracing.robot_tracer import RobotTracer
from nena_edge_agent.protocol.events import Effect, Event, OrderReceived, Started
from nena_shared.extensions.tracing import EVENTS_LIMIT, Span, order_name_of, trace_id_of, vda_order_span_id
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.robot_core import Bench, action, hard, order, restarted

EPOCH = 1_700_000_000
ORDER_ID = "T-1-0"


class Traced:
    """A robot core with a tracer that hears what it handles."""

    def __init__(self, bench: Bench | None = None) -> None:
        self.spans: list[Span] = []
        self.clock = ManualClock()
        self.bench = bench or Bench()
        self.tracer = RobotTracer(RobotKey("ACME", "1"), self.clock, self.spans.append)
        handle = self.bench.core.handle

        def handled(event: Event, now: float) -> tuple[Effect, ...]:
            effects = handle(event, now)
            self.tracer.handle_event(event, effects, self.bench.core.robot)
            self.clock.advance(1.0)
            return effects

        self.bench.core.handle = handled  # type: ignore[method-assign]

    def one(self, name: str) -> Span:
        (span,) = (each for each in self.spans if each.name == name)
        return span


def ours(made: Order) -> Order:
    """Return an order as NeNa's order service sends it."""
    return made.model_copy(update={"nena_epoch": EPOCH})


def test_goals_and_actions_are_children_of_the_order_in_the_transport_orders_trace() -> None:
    traced = Traced()
    bench = traced.bench
    bench.send(ours(order("n0", "n1", order_id=ORDER_ID, node_actions={"n1": [hard("a", "work")]})))
    own = GoalReport("g-1", external=False, status="EXECUTING")
    bench.do(GoalTable((own,)))
    bench.arrive()
    bench.runs("a")
    bench.finishes("a")

    assert [each.name for each in traced.spans] == ["goal", "action work", "robot order"]
    whole, goal, work = (traced.one(each) for each in ("robot order", "goal", "action work"))
    assert {each.trace_id for each in traced.spans} == {trace_id_of("T-1")}
    assert whole.parent_id == vda_order_span_id(ORDER_ID)
    assert (goal.parent_id, work.parent_id) == (whole.span_id, whole.span_id)
    assert [each.name for each in goal.events] == ["nav2.goalAccepted"]
    assert goal.attributes["nena.outcome"] == "arrived"
    assert goal.attributes["vda5050.node_id"] == "n1"
    assert work.attributes["nena.outcome"] == "FINISHED"
    assert whole.attributes["nena.outcome"] == "finished"
    assert whole.begin == goal.begin < goal.end <= work.begin < work.end == whole.end


def test_an_order_of_another_fleet_control_is_a_trace_of_its_own() -> None:
    traced = Traced()
    for order_id in ("order-1", "order-2"):
        traced.bench.send(order("n0", order_id=order_id))
    first, second = traced.spans
    assert (first.trace_id, second.trace_id) == (trace_id_of("order-1"), trace_id_of("order-2"))
    assert order_name_of("order-1") == order_name_of("order-2")
    assert first.parent_id is None


def test_failures_are_shown_with_their_reason() -> None:
    traced = Traced()
    bench = traced.bench
    bench.send(order("n0", "n1", node_actions={"n0": [action("a")]}))
    bench.runs("a")
    bench.fails("a")
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "no path"))
    assert traced.one("action work").error == "broken"
    assert (traced.one("goal").error, traced.one("goal").attributes["nena.outcome"]) == ("no path", "ABORTED")


def test_a_cancelled_order_ends_its_goal() -> None:
    traced = Traced()
    bench = traced.bench
    bench.send(order("n0", "n1"))
    bench.instant(action("c", action_type="cancelOrder"))
    bench.halted()
    assert [(each.name, each.attributes["nena.outcome"]) for each in traced.spans] == [
        ("goal", "halted"),
        ("robot order", "cancelled"),
    ]


def test_updates_are_events_of_the_order_up_to_a_limit() -> None:
    traced = Traced()
    bench = traced.bench
    bench.send(order("n0", "n1"))
    for update in range(1, EVENTS_LIMIT + 10):
        sequence = 2 * update
        bench.send(order(f"n{update}", f"n{update + 1}", update=update, first=sequence))
    traced.tracer.close()
    whole = traced.one("robot order")
    assert {each.name for each in whole.events} == {"vda5050.orderUpdateAccepted"}
    assert len(whole.events) == EVENTS_LIMIT
    assert whole.attributes["nena.outcome"] == "interrupted"


def test_a_restored_order_continues_in_its_trace_and_repeats_nothing() -> None:
    bench = Bench()
    actions = {"n0": [hard("a", "work")], "n1": [hard("b", "work")]}
    bench.send(ours(order("n0", "n1", order_id=ORDER_ID, node_actions=actions)))
    bench.runs("a")
    bench.finishes("a")
    traced = Traced(restarted(bench))
    traced.bench.do(Started())
    traced.tracer.close()

    whole = traced.one("robot order")
    assert (whole.trace_id, whole.parent_id) == (trace_id_of("T-1"), vda_order_span_id(ORDER_ID))
    assert whole.attributes["nena.restored"] is True
    assert not [each for each in traced.spans if each.name == "action work"]


def test_a_finished_order_is_not_traced_again_after_a_restart() -> None:
    bench = Bench()
    bench.send(order("n0"))
    traced = Traced(restarted(bench))
    traced.bench.do(Started())
    traced.bench.do(OrderReceived(replace_id(order("n0"), "o2")))
    assert [each.attributes["vda5050.order_id"] for each in traced.spans] == ["o2"]


def replace_id(made: Order, order_id: str) -> Order:
    return made.model_copy(update={"order_id": order_id, "header_id": made.header_id + 1})
