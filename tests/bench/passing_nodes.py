"""(u) CPU per state of 400 robots that pass a node each second, orders to and fro included.

Each robot drives on a road of its own. Bare paho that only parses the JSON is the yardstick.
"""

from __future__ import annotations

import asyncio
import os
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from bench.bare_subscriber import bare_subscriber
from bench.event_loop import LONGEST_HOLD_MS, loop_probe
from bench.figures import within
from bench.lanes import MAP_ID, Hall, robot, serving, vehicle
from bench.pace import Pace
from bench.process import cpu_of_each
from bench.rates import Hosts
from bench.retained import unlike_rest
from bench.robots import InstantRobots, Start, at_node, released_of
from nena_shared.plant import PlantModel, Point
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.v2_1 import CODEC
from support.pausing import pass_time
from support.plants import path

ROBOTS = int(os.environ.get("NENA_BENCH_PASSING", "400"))
POINTS = 20
"""Points of a road."""
APART_M = 2
WARM_UP_SECONDS = 10
BATCH = 20
SETTLE_SECONDS = 2.0


async def measure(folder: Path, _samples: int, seconds: float) -> dict[str, Any]:
    """Return CPU per state of order service and yardstick, their ratio, and the targets."""
    async with serving(folder, roads(ROBOTS), ROBOTS) as hall:
        figures = await asyncio.to_thread(_measured, hall, round(3 * seconds))
    return {
        "targets": {
            "cpu_per_state_ratio": within(figures["cpu_us_per_state"]["ratio"], 3.0),
            "event_loop_ms": within(figures["event_loop"]["longest_ms"], LONGEST_HOLD_MS),
            "statuses_unlike_rest": within(figures["unlike_rest"]["all"], 0),
        },
        **figures,
    }


def _measured(hall: Hall, seconds: int) -> dict[str, Any]:
    hosts = Hosts(hall.url)
    robots = PassingRobots(hall, hosts)
    hall.wait_for_robots()
    robots.begin()
    robots.drive(WARM_UP_SECONDS)
    with bare_subscriber(hall.port) as bare:  # without the probe, whose requests cost CPU, too
        processes = {"order_service": hall.pid, "bare_subscriber": bare.pid}
        before, passed, begin = cpu_of_each(processes), robots.passed, time.perf_counter()
        robots.drive(seconds)
        pass_time(SETTLE_SECONDS)
        elapsed = time.perf_counter() - begin
        cpu = {name: after - before[name] for name, after in cpu_of_each(processes).items()}
    states, passed = seconds * hall.robots, robots.passed - passed
    with loop_probe(hall.url) as probe:
        robots.drive(seconds)
        loop = probe.figures()
    cost = {name: round(each / states * 1e6, 1) for name, each in cpu.items()}
    hosts.close()
    robots.close()  # so that the statuses come to rest
    return {
        "robots": hall.robots,
        "states": states,
        "nodes_passed_per_state": round(passed / states, 2),
        "refused": len(hosts.refused),
        "cpu_us_per_state": {**cost, "ratio": round(cost["order_service"] / cost["bare_subscriber"], 2)},
        "share_of_a_core": round(cpu["order_service"] / elapsed, 2),
        "event_loop": loop,
        "unlike_rest": unlike_rest(hall),
    }


class PassingRobots(InstantRobots):
    """Robots that pass at most one node of their base each second; at the end they get the next order."""

    def __init__(self, hall: Hall, hosts: Hosts) -> None:
        self._serials = [robot(number) for number in range(hall.robots)]
        self._hosts = hosts
        self._orders: dict[str, Order] = {}
        self._at: dict[str, int] = {}
        """Index of the node of its order at which each robot is."""
        self._turns = dict.fromkeys(self._serials, 0)
        self.passed = 0
        super().__init__(hall.port, tuple(map(_start_of, range(hall.robots))))

    def begin(self, first: int = 0, step: int = 1) -> None:
        """Create the first order of each robot; of each ``step``-th one from number ``first`` on."""
        for serial in self._serials[first::step]:
            self._next_order(serial)

    def drive(self, seconds: int) -> None:
        """Let each robot pass a node and report its state, each second."""
        pace = Pace(len(self._serials))
        for count in range(seconds * len(self._serials)):
            self._step(self._serials[count % len(self._serials)])
            if count % BATCH == 0:
                pace.keep(count)

    def _step(self, serial: str) -> None:
        with self._lock:
            order = self._orders.get(serial)
            ended = False
            if order:
                at = self._at[serial]
                if at < released_of(order):
                    at = self._at[serial] = at + 1
                    self.passed += 1
                ended = at == len(order.nodes) - 1
                self._states[serial] = at_node(self._states[serial], order, at)
                if ended:
                    del self._orders[serial]
            self.say_state(serial)
        if ended:
            self._next_order(serial)

    def _next_order(self, serial: str) -> None:
        self._turns[serial] += 1
        goal = f"{serial}-{POINTS - 1 if self._turns[serial] % 2 else 0}"
        self._hosts.create({"destinations": [{"locationName": goal}], "intendedVehicle": serial})

    def _on_order(self, topic: str, payload: bytes, _moment: float) -> None:
        serial = topic.split("/")[-2]
        order = CODEC.decode(Order, payload)
        with self._lock:
            known, before = self._states[serial], self._orders.get(serial)
            if known.order_id != order.order_id:
                at = 0
            elif before is None:
                return  # sent again after its end
            else:
                order, at = _updated(before, order), self._at[serial]
            self._orders[serial], self._at[serial] = order, at
            self._states[serial] = at_node(known, order, at)
            self.say_state(serial)


def _updated(order: Order, update: Order) -> Order:
    """Return an order with its update, which begins at the last node of the base (section 6.1.2)."""
    first = update.nodes[0].sequence_id
    return update.model_copy(
        update={
            "nodes": (*(each for each in order.nodes if each.sequence_id < first), *update.nodes),
            "edges": (*(each for each in order.edges if each.sequence_id < first), *update.edges),
        }
    )


def _start_of(number: int) -> Start:
    return Start(robot(number), f"{robot(number)}-0", 0.0, float(number * APART_M), MAP_ID)


def roads(robots: int) -> PlantModel:
    """Make a plant with a two-way road for each robot."""
    ends = [(number, index) for number in range(robots) for index in range(POINTS)]
    steps = [(robot(number), *pair) for number in range(robots) for pair in pairwise(range(POINTS))]
    return PlantModel(
        name=f"{robots} roads",
        points=tuple(
            Point(name=f"{robot(number)}-{index}", x_mm=index * APART_M * 1000, y_mm=number * APART_M * 1000)
            for number, index in ends
        ),
        paths=tuple(
            path(f"{name}-{one} {name}-{other}", APART_M * 1000)
            for name, low, high in steps
            for one, other in ((low, high), (high, low))
        ),
        vehicles=tuple(map(vehicle, range(robots))),
    )
