"""Orders and states at the order service and the aggregator, with robots outside of them."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx

from bench import lanes
from bench.programs import WAIT_SECONDS, Figures, Pace, Site, Version, percentiles, running_site, yardstick
from bench.programs import cpu_of as cpu_of_process
from bench.robots import Robots
from bench.wire import Echo, Wire
from support.pausing import pass_time
from support.waiting import wait_until

ROBOTS = 300
LATENCIES = 200
ORDERS = 2000
STATE_SECONDS = 30.0
"""Each robot sends a state a second for so long."""
SETTLE_SECONDS = 3.0
CLIENTS = 5
"""Panels that follow the aggregator's events."""


@contextmanager
def _site(version: Version, *, driving: bool) -> Iterator[tuple[Site, str, Robots]]:
    with running_site(version) as site:
        url = site.start_order_service(lanes.lanes(ROBOTS))
        robots = Robots(site.broker_port, ROBOTS, driving=driving)
        try:
            lanes.wait_for_robots(url, ROBOTS)
            for number in range(ROBOTS):  # so that the order service need not request them
                robots.send_state(number)
            pass_time(SETTLE_SECONDS)
            yield site, url, robots
        finally:
            robots.close()


def measure_orders(version: Version) -> Figures:
    """Return latency, CPU and memory of orders that end at once, with 300 robots."""
    with _site(version, driving=False) as (site, url, robots):
        figures = _latencies(site, url, robots)
        ends = _Ends(site.broker_port)
        host = lanes.Host(url)
        cpu, begin = site.cpu()["order-service"], time.perf_counter()
        for number in range(LATENCIES, LATENCIES + ORDERS):
            host.create(lanes.order(number, ROBOTS))
        host.close()
        wait_until(lambda: ends.count >= ORDERS, timeout=WAIT_SECONDS, what="the end of every order")
        seconds = time.perf_counter() - begin
        figures |= {
            "cpu_per_order_ms": (site.cpu()["order-service"] - cpu) / ORDERS * 1e3,
            "orders_per_second": ORDERS / seconds,
            "refused": float(len(host.refused)),
            "memory_mb": site.memory()["order-service"],
        }
        ends.close()
        return figures


def _latencies(site: Site, url: str, robots: Robots) -> Figures:
    """Create one order after the other, each followed by an echo over the broker."""
    answered, sent, echoed = [], [], []
    echo = Echo(site.broker_port)
    with httpx.Client(base_url=url, timeout=WAIT_SECONDS) as client:
        for number in range(LATENCIES):
            start = time.perf_counter()
            answer = client.post("/v1/transportOrders", json=lanes.order(number, ROBOTS)).raise_for_status()
            answered.append(time.perf_counter() - start)
            name = answer.json()["name"]
            sent.append(_moment_of(robots, name) - start)
            _wait_for_end(client, name)
            echoed.append(echo.round_trip())
    echo.close()
    return {
        **percentiles("request_to_answer", answered),
        **percentiles("request_to_wire", sent),
        **percentiles("bare_echo", echoed),
    }


def _moment_of(robots: Robots, name: str) -> float:
    while True:
        order_id, moment = robots.orders.get(timeout=WAIT_SECONDS)
        if order_id.startswith(f"{name}-"):
            return moment


def _wait_for_end(client: httpx.Client, name: str) -> None:
    url = f"/v1/transportOrders/{name}"
    wait_until(
        lambda: client.get(url).json()["state"] == "FINISHED", timeout=WAIT_SECONDS, what=f"{name} ends"
    )


class _Ends:
    """Counts the orders whose end is published."""

    def __init__(self, port: int) -> None:
        self._topics: set[str] = set()
        self._wire = Wire(port, "bench-ends", ("nena/v1/transportOrders/+/status",), self._note)

    @property
    def count(self) -> int:
        return len(self._topics)

    def close(self) -> None:
        self._wire.close()

    def _note(self, topic: str, payload: bytes, _moment: float) -> None:
        if b'"state":"FINISHED"' in payload:
            self._topics.add(topic)


def measure_states(version: Version) -> Figures:
    """Return CPU per state, and the delay from state to panel, with 300 robots under way."""
    with _site(version, driving=True) as (site, url, robots):
        panel = site.start_aggregator(url)
        host = lanes.Host(url)
        for number in range(ROBOTS):
            host.create(lanes.order(number, ROBOTS))
        host.close()
        for _ in range(ROBOTS):
            robots.orders.get(timeout=WAIT_SECONDS)
        followers = [_Follower(panel) for _ in range(CLIENTS)]
        with yardstick("bench.wire", str(site.broker_port)) as bare:
            pass_time(SETTLE_SECONDS)
            cpu, bare_cpu = site.cpu(), cpu_of_process(bare)
            pace, states = Pace(ROBOTS), round(ROBOTS * STATE_SECONDS)
            for number in range(states):
                pass_time(pace.seconds_until(number))
                x = round(number / ROBOTS / 10, 3)
                position = {"x": x, "y": float(number % ROBOTS * lanes.APART_M), "theta": 0.0}
                for follower in followers:
                    follower.sent[f"NeNa/{lanes.robot(number % ROBOTS)}", x] = time.perf_counter()
                robots.send_state(
                    number, agvPosition={**position, "mapId": lanes.MAP_ID, "positionInitialized": True}
                )
            pass_time(SETTLE_SECONDS)
            after = site.cpu()
            bare_cost = (cpu_of_process(bare) - bare_cpu) / states * 1e6
        memory = site.memory()
        figures = percentiles("state_to_panel", [each for one in followers for each in one.delays])
        for follower in followers:
            follower.close()
    for name in ("order-service", "status-aggregator"):
        figures[f"{name}_cpu_per_state_us"] = (after[name] - cpu[name]) / states * 1e6
        figures[f"{name}_memory_mb"] = memory[name]
    return {**figures, "bare_subscriber_cpu_per_state_us": bare_cost}


class _Follower:
    """A client of the aggregator's events, which notes when the position of each state arrives."""

    def __init__(self, panel: str) -> None:
        self.sent: dict[tuple[str, float], float] = {}
        """When a state was sent, by robot and x."""
        self.delays: list[float] = []
        self._client = httpx.Client(base_url=panel, timeout=None)  # noqa: S113 - a stream has no end
        self._thread = threading.Thread(target=self._follow, name="bench panel", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop following."""
        self._client.close()

    def _follow(self) -> None:
        try:
            with self._client.stream("GET", "/api/v1/events") as response:
                for line in response.iter_lines():
                    if line.startswith("data: "):
                        self._note(json.loads(line.removeprefix("data: ")), time.perf_counter())
        except (httpx.HTTPError, httpx.StreamError, OSError):
            return

    def _note(self, event: dict[str, object], moment: float) -> None:
        robots = event.get("robots")
        for robot in robots if isinstance(robots, list) else ():
            position = robot.get("position") or {}
            if position and (sent := self.sent.pop((robot["id"], position["x"]), None)):
                self.delays.append(moment - sent)
