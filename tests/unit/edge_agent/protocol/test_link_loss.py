"""A robot that has lost its broker stops or drives on, by setting."""

from __future__ import annotations

from typing import Any

from nena_edge_agent.protocol.capabilities import DriveStrategy, LinkLossPolicy
from nena_edge_agent.protocol.events import Halt, LinkReport, Started, TimePassed
from support.robot_core import Bench, at, order

LOST, BACK = LinkReport(connected=False), LinkReport(connected=True)


def under_way(policy: LinkLossPolicy, **capabilities: Any) -> Bench:
    """Give a robot on its way to the first of two nodes."""
    bench = Bench(link_loss=policy, link_loss_patience=10.0, **capabilities)
    bench.do(BACK)
    bench.send(order("n0", "n1", "n2"))
    return bench


def lose(bench: Bench, seconds: float) -> None:
    bench.do(LOST)
    bench.now += seconds
    bench.do(TimePassed())


def test_an_assertive_robot_drives_its_base_to_the_end() -> None:
    bench = under_way(LinkLossPolicy.ASSERTIVE)
    lose(bench, 3600.0)
    bench.arrive()
    bench.arrive()
    assert bench.nodes == []
    assert not bench.effects_of(Halt)
    assert not bench.waits()


def test_a_preventive_robot_stops_after_its_time_and_goes_on_when_the_broker_is_back() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE)
    lose(bench, 9.9)
    assert bench.waits()
    assert not bench.effects_of(Halt)
    bench.now += 0.2
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 1
    bench.halted()
    assert not bench.state.driving

    bench.do(BACK)

    assert [goal.pose for goal in bench.goals] == [bench.goal.pose] * 2
    assert bench.nodes == ["n1", "n2"]


def test_a_short_break_is_nothing() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE)
    lose(bench, 9.0)
    bench.do(BACK)
    bench.now += 60.0
    bench.do(TimePassed())
    assert not bench.effects_of(Halt)


def test_at_the_next_node_it_waits() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_NEXT_NODE)
    lose(bench, 20.0)
    assert not bench.effects_of(Halt)
    bench.arrive()
    assert (bench.nodes, len(bench.goals)) == (["n2"], 1)
    bench.do(BACK)
    assert len(bench.goals) == 2


def test_the_next_node_is_not_passed() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_NEXT_NODE, strategy=DriveStrategy.PASS_THROUGH)
    lose(bench, 20.0)
    bench.do(at(9.9))
    assert (bench.nodes, len(bench.goals)) == (["n1", "n2"], 1)


def test_a_robot_that_has_never_had_its_broker_waits_too() -> None:
    memory = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE).core.memory()
    bench = Bench(memory=memory, link_loss=LinkLossPolicy.PREVENTIVE_AT_ONCE, link_loss_patience=10.0)
    assert len(bench.goals) == 1
    bench.now += 11.0
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 1


def test_started_begins_the_time() -> None:
    bench = Bench(ready=False, link_loss=LinkLossPolicy.PREVENTIVE_AT_ONCE)
    assert not bench.waits()
    bench.do(Started())
    assert bench.waits()
