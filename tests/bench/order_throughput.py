"""Orders completed per second by robots that finish at once, each sent once; with traffic control."""

from __future__ import annotations

import http.client
import json
import threading
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

from bench.lanes import Hall, order_of
from bench.robots import InstantRobots
from bench.wire import Wire

HOSTS = 8
"""Connections over which orders are given."""
WAIT_SECONDS = 300.0


def measure(hall: Hall, robots: InstantRobots, orders: int) -> dict[str, Any]:
    """Create ``orders`` over REST as fast as they are answered, and wait for the end of each."""
    ends = _Ends(hall.port, orders)
    numbers = iter(range(orders))
    lock = threading.Lock()
    refused: list[str] = []
    before, start = hall.cpu(), time.perf_counter()
    hosts = [
        threading.Thread(target=_give, args=(hall, _shared(numbers, lock), refused), name=f"host {number}")
        for number in range(HOSTS)
    ]
    for each in hosts:
        each.start()
    for each in hosts:
        each.join()
    finished = ends.wait()
    seconds, cpu = time.perf_counter() - start, hall.cpu() - before
    ends.close()
    sent = _sent(robots)
    return {
        "orders": orders,
        "refused": len(refused),
        "finished": finished,
        "per_second": round(finished / seconds, 1),
        "cpu_ms_per_order": round(cpu / orders * 1e3, 2),
        "per_second_of_one_core": round(orders / cpu, 1),
        "share_of_a_core": round(cpu / seconds, 2),
        "sent_more_than_once": sum(times > 1 for times in sent.values()),
        "sent": sum(sent.values()),
    }


def _shared(numbers: Iterator[int], lock: threading.Lock) -> Iterator[int]:
    while True:
        with lock:
            number = next(numbers, None)
        if number is None:
            return
        yield number


def _give(hall: Hall, numbers: Iterator[int], refused: list[str]) -> None:
    address = urlsplit(hall.url)
    connection = http.client.HTTPConnection(address.hostname or "", address.port, timeout=WAIT_SECONDS)
    for number in numbers:
        body = json.dumps(order_of(number, hall.robots)).encode()
        connection.request("POST", "/v1/transportOrders", body, {"Content-Type": "application/json"})
        answer = connection.getresponse()
        text = answer.read()
        if answer.status != http.client.CREATED:
            refused.append(text.decode())
    connection.close()


def _sent(robots: InstantRobots) -> Counter[str]:
    orders: Counter[str] = Counter()
    while not robots.orders.empty():
        orders[robots.orders.get()[1]] += 1
    return orders


class _Ends:
    """Counts the orders whose successful end is published over MQTT."""

    def __init__(self, port: int, wanted: int) -> None:
        self._wanted = wanted
        self._topics: set[str] = set()
        self._all = threading.Event()
        self._wire = Wire(port, "bench-host", ("nena/v1/transportOrders/+/status",), self._told)

    def wait(self) -> int:
        self._all.wait(WAIT_SECONDS)
        return len(self._topics)

    def close(self) -> None:
        self._wire.close()

    def _told(self, topic: str, payload: bytes, _moment: float) -> None:
        if b'"state":"FINISHED"' in payload:
            self._topics.add(topic)
            if len(self._topics) >= self._wanted:
                self._all.set()
