"""Orders per second with no vehicle named, in a closed loop: a new order for each one that ends."""

from __future__ import annotations

import http.client
import json
import queue
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from bench.grid import Lot
from bench.lanes import Hall
from bench.robots import InstantRobots
from bench.wire import Wire

HOSTS = 8
"""Connections over which orders are created."""
WAIT_SECONDS = 600.0
ENDED = b'"state":"FINISHED"'


class Hosts:
    """Creates orders over several connections, as fast as they are answered."""

    def __init__(self, url: str) -> None:
        self._bodies: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._address = urlsplit(url)
        self.refused: list[str] = []
        self._threads = [threading.Thread(target=self._create, name=f"host {each}") for each in range(HOSTS)]
        for each in self._threads:
            each.start()

    def create(self, body: dict[str, Any]) -> None:
        """Create an order as soon as a connection is free."""
        self._bodies.put(body)

    def wait_answered(self) -> None:
        """Wait until all orders are answered."""
        self._bodies.join()

    def close(self) -> None:
        """Wait until all orders are answered, and disconnect."""
        for _ in self._threads:
            self._bodies.put(None)
        for each in self._threads:
            each.join()

    def _create(self) -> None:
        connection = http.client.HTTPConnection(
            self._address.hostname or "", self._address.port, timeout=WAIT_SECONDS
        )
        while (body := self._bodies.get()) is not None:
            answer, text = _answered(connection, json.dumps(body).encode())
            if answer.status != http.client.CREATED:
                self.refused.append(text.decode())
            self._bodies.task_done()
        connection.close()


def _answered(connection: http.client.HTTPConnection, body: bytes) -> tuple[http.client.HTTPResponse, bytes]:
    """Send an order; connect again if the server has closed the idle connection."""
    for last in (False, True):
        try:
            connection.request("POST", "/v1/transportOrders", body, {"Content-Type": "application/json"})
            answer = connection.getresponse()
            return answer, answer.read()
        except ConnectionError:
            connection.close()
            if last:
                raise
    raise AssertionError


class Ends:
    """The orders whose end is published over MQTT, once each."""

    def __init__(self, port: int) -> None:
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._topics: set[str] = set()
        self._wire = Wire(port, "bench-ends", ("nena/v1/transportOrders/+/status",), self._told)

    def next(self) -> None:
        """Wait for the next end."""
        self._ended.get(timeout=WAIT_SECONDS)

    def close(self) -> None:
        """Disconnect."""
        self._wire.close()

    def _told(self, topic: str, payload: bytes, _moment: float) -> None:
        if ENDED in payload and topic not in self._topics:
            self._topics.add(topic)
            self._ended.put(topic)


def closed_loop(
    hall: Hall, robots: InstantRobots, *, waiting: int, warm_up: int, orders: int
) -> dict[str, float]:
    """Measure the ends of ``orders``, after ``warm_up`` ends, while ``waiting`` orders wait.

    All robots of the hall always have an order. The robots stand while the waiting orders are created.
    """
    ends, hosts, lot = Ends(hall.port), Hosts(hall.url), Lot()
    robots.hold()
    for _ in range(waiting + hall.robots):
        hosts.create(lot.order())
    hosts.wait_answered()
    robots.go_on()
    for _ in range(warm_up):
        ends.next()
        hosts.create(lot.order())
    before, begin = hall.cpu(), time.perf_counter()
    for _ in range(orders):
        ends.next()
        hosts.create(lot.order())
    seconds, cpu = time.perf_counter() - begin, hall.cpu() - before
    hosts.close()
    ends.close()
    return {
        "orders": orders,
        "waiting": waiting,
        "refused": len(hosts.refused),
        "per_second": round(orders / seconds, 1),
        "cpu_ms_per_order": round(cpu / orders * 1e3, 2),
        "per_second_of_one_core": round(orders / cpu, 1),
        "share_of_a_core": round(cpu / seconds, 2),
    }
