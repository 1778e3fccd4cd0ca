"""(e) What the pure cores cost, beside what reading the same message as plain JSON costs.

Microseconds of CPU in this process: the least of several rounds, which is what the code needs when nothing
else wants the processor.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from time import process_time

from bench.figures import Figures
from nena_edge_agent.driver.port import Arrived, PoseReport
from nena_edge_agent.protocol.events import OrderReceived
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.records import read_record
from nena_shared.vda5050.state import State
from nena_shared.vda5050.versions import CODECS, RULES
from support.robot_core import HEADER, Bench, action, order

ROUNDS = 7
TIMES = 200
NODES = 50


def measure() -> dict[str, Figures]:
    """Measure each version's codec and core with an order of 50 nodes and ten actions."""
    return {version: _of_version(version) for version in CODECS}


def _of_version(version: str) -> Figures:
    codec = CODECS[version]
    sent = _long_order()
    state = _state_under_way(version)
    order_bytes, state_bytes = codec.encode(sent), codec.encode(state)
    return {
        "order_bytes": len(order_bytes),
        "state_bytes": len(state_bytes),
        "order_accepted_us": _accepting(version, sent),
        "state_built_us": _building(version, sent),
        "state_read_us": _least(lambda: codec.decode(State, state_bytes)),
        "state_read_in_brief_us": _least(lambda: read_record(State, codec, state_bytes)),
        "state_written_us": _least(lambda: codec.encode(state)),
        "order_read_us": _least(lambda: codec.decode(Order, order_bytes)),
        "yardstick_json_loads_state_us": _least(lambda: json.loads(state_bytes)),
        "yardstick_json_loads_order_us": _least(lambda: json.loads(order_bytes)),
    }


def _long_order() -> Order:
    names = [f"n{number}" for number in range(NODES)]
    work = {name: [action(f"a-{name}", "HARD")] for name in names[5::5]}
    return order(*names, node_actions=work)


def _state_under_way(version: str) -> State:
    """Return a state of some 4 KB: an order of which a part is left."""
    bench = Bench(rules=RULES[version])
    names = [f"n{number}" for number in range(21)]
    bench.send(order(*names, node_actions={name: [action(f"a-{name}", "HARD")] for name in names[5::5]}))
    return bench.state


def _accepting(version: str, sent: Order) -> float:
    """Make as many idle robots accept the order; return the time."""

    def accepted() -> float:
        benches = [Bench(rules=RULES[version]) for _ in range(TIMES)]
        begin = process_time()
        for bench in benches:
            bench.core.handle(OrderReceived(sent), 1.0)
        return (process_time() - begin) / TIMES

    return min(accepted() for _ in range(ROUNDS)) * 1e6


def _building(version: str, sent: Order) -> float:
    """Drive a robot along its order, and build a state at each node; return the time."""

    def built() -> float:
        bench, spent, states = Bench(rules=RULES[version]), 0.0, 0
        bench.send(sent)
        for _ in range(1, NODES):
            goal = bench.goal
            bench.do(PoseReport(goal.pose, localized=True))
            begin = process_time()
            effects = bench.core.handle(Arrived(goal.generation), bench.now)
            bench.core.state(HEADER)
            spent, states = spent + process_time() - begin, states + 1
            bench.effects.extend(effects)
            _work(bench)
        return spent / states

    return min(built() for _ in range(ROUNDS)) * 1e6


def _work(bench: Bench) -> None:
    for each in tuple(bench.core.robot.actions):
        if each.active:
            bench.runs(each.action.action_id)
            bench.finishes(each.action.action_id)


def _least(once: Callable[[], object]) -> float:
    least = float("inf")
    for _ in range(ROUNDS):
        begin = process_time()
        for _ in range(TIMES):
            once()
        least = min(least, (process_time() - begin) / TIMES)
    return least * 1e6
