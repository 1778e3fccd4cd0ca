"""Cost of states of a large fleet under way at the order service, and the delay of its statuses."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from bench.bare_subscriber import bare_subscriber
from bench.figures import milliseconds
from bench.lanes import Hall, order_of, robot
from bench.pace import Pace
from bench.process import cpu_of_each
from bench.robots import SCHEME, DrivingRobots
from bench.wire import Wire
from nena_shared.vda5050.topics import RobotKey, Topic
from support.pausing import pass_time

RATE = 1.0
"""States a second of each robot."""
MARKED = 40
"""One state in so many says another charge of the battery, which is told at once."""
BATCH = 20
WAIT_SECONDS = 300.0
SETTLE_SECONDS = 3.0
CHARGES = tuple(range(40, 80))


def measure(hall: Hall, robots: DrivingRobots, seconds: float) -> dict[str, Any]:
    """Make every robot drive for an order and report at 1 Hz for ``seconds``."""
    _give_orders(hall, robots)
    said = {number: robots.messages(robot(number)) for number in range(hall.robots)}
    with bare_subscriber(hall.port) as bare, _marks(hall.port) as marks:
        sender = _Sender(hall, said, marks)
        sender.send(hall.robots)
        pass_time(SETTLE_SECONDS)
        processes = {"order_service": hall.pid, "bare_subscriber": bare.pid}
        before, start = cpu_of_each(processes), time.perf_counter()
        states = round(hall.robots * RATE * seconds)
        sender.send(states)
        pass_time(SETTLE_SECONDS)
        elapsed = time.perf_counter() - start
        cpu = {name: after - before[name] for name, after in cpu_of_each(processes).items()}
        ages = marks.ages()
        sender.close()
    cost = {name: round(each / states * 1e6, 1) for name, each in cpu.items()}
    return {
        "robots": hall.robots,
        "state_bytes": len(said[0]),
        "cpu_us_per_state": {**cost, "ratio": round(cost["order_service"] / cost["bare_subscriber"], 2)},
        "share_of_a_core": round(cpu["order_service"] / elapsed, 2),
        "robots_of_one_core": round(1e6 / cost["order_service"]),
        "state_age": {**milliseconds(ages), "marked": sender.marked},
        "rss_mb": hall.rss_mb(),
    }


def _give_orders(hall: Hall, robots: DrivingRobots) -> None:
    """Create an order for every robot, and wait until all have accepted theirs."""
    with httpx.Client(base_url=hall.url, timeout=WAIT_SECONDS) as client:
        for number in range(hall.robots):
            robots.say_state(robot(number))  # or it would count as silent by now
            client.post("/v1/transportOrders", json=order_of(number, hall.robots)).raise_for_status()
    for _ in range(hall.robots):
        robots.orders.get(timeout=WAIT_SECONDS)
    pass_time(SETTLE_SECONDS)


class _Marks:
    """Times when battery charges were sent, and when they were published."""

    def __init__(self) -> None:
        self.said: dict[tuple[str, int], float] = {}
        self._told: queue.SimpleQueue[float] = queue.SimpleQueue()

    def told(self, topic: str, payload: bytes, moment: float) -> None:
        """Handle the status of a vehicle."""
        at = payload.find(b'"energyLevel":')
        if at >= 0:
            charge = int(float(payload[at + 14 : payload.index(b",", at)]))
            said = self.said.pop((topic.split("/")[-2], charge), None)
            if said is not None:
                self._told.put(moment - said)

    def ages(self) -> list[float]:
        """Return the seconds from each state to its status."""
        return [self._told.get() for _ in range(self._told.qsize())]


@contextmanager
def _marks(port: int) -> Iterator[_Marks]:
    marks = _Marks()
    wire = Wire(port, "bench-watch", ("nena/v1/vehicles/+/status",), marks.told)
    yield marks
    wire.close()


class _Sender:
    """Publishes states of all robots in turn: each time with the next header id, and a little farther on."""

    def __init__(self, hall: Hall, said: dict[int, bytes], marks: _Marks) -> None:
        self._wire = Wire(hall.port, "bench-states", ())
        self._hall = hall
        self._said = said
        self._marks = marks
        self._sent = 0
        self.marked = 0

    def send(self, number: int) -> None:
        """Publish so many at the rate."""
        pace = Pace(self._hall.robots * RATE)
        for count in range(number):
            self._publish(count >= self._hall.robots and self._sent % MARKED == 0)
            if count % BATCH == 0:
                pace.keep(count)

    def close(self) -> None:
        """Disconnect."""
        self._wire.close()

    def _publish(self, marked: bool) -> None:  # noqa: FBT001 - this one's own
        number, turn = self._sent % self._hall.robots, 10 + self._sent // self._hall.robots
        serial = robot(number)
        payload = self._said[number]
        head = payload.index(b",")
        payload = b'{"headerId":%d' % turn + payload[head:]
        payload = payload.replace(b'"x":0.0,"y"', b'"x":%.2f,"y"' % (turn % 100 / 20), 1)
        if marked:
            charge = CHARGES[self._sent // MARKED % len(CHARGES)]
            payload = payload.replace(b'"batteryCharge":80.0', b'"batteryCharge":%d.0' % charge)
            self._marks.said[serial, charge] = time.perf_counter()
            self.marked += 1
        self._wire.publish(SCHEME.of(RobotKey("NeNa", serial), Topic.STATE), payload)
        self._sent += 1
