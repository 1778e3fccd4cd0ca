"""(v) 1,000 loopback robots in one process, from its start to ONLINE on the wire, beside bare connections."""

from __future__ import annotations

import asyncio
import json
import os
import queue
import socket
import struct
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from bench.figures import within
from bench.process import cpu_of, rss_mb_of
from bench.robots import SCHEME
from bench.wire import Wire
from nena_demo import stack
from nena_demo.processes import Processes, console_script, free_port, start_broker
from nena_shared.vda5050.topics import Topic
from support.pausing import pass_time, time_passes

ROBOTS = int(os.environ.get("NENA_BENCH_LOOPBACK", "1000"))
WAIT_SECONDS = 120.0
LOOK_EVERY = 0.005
"""Seconds."""


async def measure(folder: Path, _samples: int, seconds: float) -> dict[str, Any]:
    """Start the robots, count those that are ONLINE, and measure memory and CPU at rest."""
    async with Processes(folder) as processes:
        port = free_port()
        await start_broker(processes, port, "mosquitto")
        bare = await asyncio.to_thread(_bare_connections, port)
        online: queue.SimpleQueue[float] = queue.SimpleQueue()

        def told(_topic: str, payload: bytes, moment: float) -> None:
            if json.loads(payload)["connectionState"] == "ONLINE":
                online.put(moment)

        wire = Wire(port, "bench-online", (SCHEME.for_all(Topic.CONNECTION),), told)
        begin = time.perf_counter()
        child = await processes.start(
            "edge-agent-loopback",
            [
                console_script("nena-edge-agent"),
                *("--driver", "loopback", "--loopback.count", str(ROBOTS)),
            ],
            environment=stack.environment(folder, port),
        )
        connected, last = await asyncio.to_thread(_count, online)
        pid = child.process.pid
        before = cpu_of(pid)
        await time_passes(seconds)
        at_rest = (cpu_of(pid) - before) / seconds
        rss = rss_mb_of(pid)
        wire.close()
        processes.check()
    return {
        "targets": {
            "online": within(ROBOTS - connected, 0),
            "seconds_to_online": within(round(last - begin, 2), 5.0),
            "rss_mb": within(rss, 150.0),
        },
        "robots": ROBOTS,
        "online": connected,
        "seconds_to_online": round(last - begin, 2),
        "bare_connections_seconds": round(bare, 3),
        "ratio": round((last - begin) / bare, 1),
        "share_of_a_core_at_rest": round(at_rest, 3),
        "rss_mb": rss,
    }


def _count(online: queue.SimpleQueue[float]) -> tuple[int, float]:
    """Return how many robots are ONLINE in time, and when the last one was."""
    count, last, end = 0, time.perf_counter(), time.perf_counter() + WAIT_SECONDS
    while count < ROBOTS and time.perf_counter() < end:
        try:
            last = online.get(timeout=1.0)
        except queue.Empty:
            continue
        count += 1
    return count, last


def _bare_connections(port: int) -> float:
    """Return how long as many bare connections take, each with one retained message, s."""
    arrivals: list[float] = []
    wire = Wire(port, "bench-bare", ("bench/+/connection",), lambda _t, _p, moment: arrivals.append(moment))
    begin = time.perf_counter()
    with ExitStack() as open_ones:
        for number in range(ROBOTS):
            connection = socket.create_connection(("127.0.0.1", port), timeout=WAIT_SECONDS)
            open_ones.enter_context(connection)
            connection.sendall(_connect(f"bare-{number}"))
            connection.recv(4)  # CONNACK
            connection.sendall(_publish(f"bench/{number}/connection", b"x" * 200))
        while len(arrivals) < ROBOTS and time.perf_counter() - begin < WAIT_SECONDS:
            pass_time(LOOK_EVERY)
    wire.close()
    return arrivals[-1] - begin


def _text(text: str) -> bytes:
    return struct.pack("!H", len(text)) + text.encode()


def _packet(kind: int, body: bytes) -> bytes:
    """Frame an MQTT 3.1.1 packet of less than 16 kB."""
    high, low = divmod(len(body), 128)
    return bytes([kind, low | 128, high] if high else [kind, low]) + body


def _connect(client: str) -> bytes:
    return _packet(0x10, _text("MQTT") + bytes([4, 2, 0, 60]) + _text(client))


def _publish(topic: str, payload: bytes) -> bytes:
    return _packet(0x30, _text(topic) + payload)
