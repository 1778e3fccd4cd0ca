"""(a) REST request sent, answered and committed, to order on the wire; beside a bare MQTT echo."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from typing import Any

import httpx

from bench.figures import Figures, milliseconds
from bench.robots import InstantRobots
from bench.wire import Wire

WAIT_SECONDS = 10.0
POINTS = ("Middle 1", "Middle 2", "Middle 3", "Middle 4", "South 3", "North 3")


def to_demo_robot(number: int) -> dict[str, Any]:
    """Make the order of this number, for a robot of the demo."""
    return {
        "destinations": [{"locationName": POINTS[number % len(POINTS)]}],
        "intendedVehicle": f"Robot-0{number % 2 + 1}",
    }


def measure(
    rest_url: str,
    broker_port: int,
    robots: InstantRobots,
    samples: int,
    order: Callable[[int], dict[str, Any]] = to_demo_robot,
) -> dict[str, Figures]:
    """Create one order after the other for robots that finish at once, with an echo over the broker after
    each.
    """
    answered, on_wire, echoed = [], [], []
    echo = _Echo(broker_port)
    with httpx.Client(base_url=rest_url, timeout=WAIT_SECONDS) as client:
        for number in range(samples):
            body = order(number)
            start = time.perf_counter()
            answer = client.post("/v1/transportOrders", json=body)
            answered.append(time.perf_counter() - start)
            answer.raise_for_status()
            name = answer.json()["name"]
            on_wire.append(_sent(robots, name) - start)
            _wait_until_final(client, name)
            echoed.append(echo.round_trip())
    echo.close()
    return {
        "request_to_answer": milliseconds(answered),
        "request_to_order_on_wire": milliseconds(on_wire),
        "bare_mqtt_echo": milliseconds(echoed),
    }


def _sent(robots: InstantRobots, name: str) -> float:
    """Return when the order was on the wire; robots that only make room for others get orders too."""
    while True:
        _, order_id, moment = robots.orders.get(timeout=WAIT_SECONDS)
        if order_id.startswith(f"{name}-"):
            return moment


def _wait_until_final(client: httpx.Client, name: str) -> None:
    end = time.perf_counter() + WAIT_SECONDS
    while time.perf_counter() < end:
        order = client.get(f"/v1/transportOrders/{name}").json()
        if order["state"] == "FINISHED":
            return
    message = f"{name} did not finish: {order['state']}, {order['reason']}"
    raise TimeoutError(message)


class _Echo:
    """One message to itself over the broker, with bare paho."""

    def __init__(self, port: int) -> None:
        self._arrivals: queue.SimpleQueue[float] = queue.SimpleQueue()
        self._wire = Wire(
            port, "bench-echo", ("bench/echo",), lambda _t, _p, moment: self._arrivals.put(moment)
        )

    def round_trip(self) -> float:
        start = time.perf_counter()
        self._wire.publish("bench/echo", b"x" * 2000)
        return self._arrivals.get(timeout=WAIT_SECONDS) - start

    def close(self) -> None:
        self._wire.close()
