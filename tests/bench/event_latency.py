"""State on the wire until its event is at a client: 200 robots, 10 clients."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack

import httpx

from bench.figures import Figures, milliseconds
from bench.state_cost import payload
from bench.wire import Wire
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

ROBOTS = 200
CLIENTS = 10
RATE = 200.0
"""States per second: each robot sends one."""

SETTLE_SECONDS = 2.0
SCHEME = TopicScheme("uagv")

Sent = dict[tuple[str, float], float]
"""When a state was published, by robot and its x."""


async def measure(port: int, url: str, seconds: float) -> Figures:
    """Publish for ``seconds`` while clients follow; give the latencies of all events at all clients."""
    wire = Wire(port, "bench-latency", ())
    for number in range(ROBOTS):
        _publish(wire, number, 0)
    sent: Sent = {}
    samples: list[float] = []
    async with httpx.AsyncClient(timeout=None) as http, AsyncExitStack() as streams:  # noqa: S113 - streams
        readers = []
        for _ in range(CLIENTS):
            stream = http.stream("GET", f"{url}/api/v1/events")
            response = await streams.enter_async_context(stream)
            readers.append(asyncio.create_task(_read(response, sent, samples), name="bench reader"))
        await asyncio.sleep(SETTLE_SECONDS)
        await _publish_states(wire, sent, seconds)
        await asyncio.sleep(SETTLE_SECONDS)
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
    wire.close()
    return milliseconds(samples)


async def _publish_states(wire: Wire, sent: Sent, seconds: float) -> None:
    start = time.perf_counter()
    for count in range(int(seconds * RATE)):
        number, header_id = count % ROBOTS, 1 + count // ROBOTS
        sent[(f"Bench/bench-{number:03d}", (header_id % 100) / 10)] = time.perf_counter()
        _publish(wire, number, header_id)
        await asyncio.sleep(max(0.0, start + count / RATE - time.perf_counter()))


async def _read(response: httpx.Response, sent: Sent, samples: list[float]) -> None:
    event = ""
    async for line in response.aiter_lines():
        if line.startswith("event: "):
            event = line.removeprefix("event: ")
        elif line.startswith("data: ") and event == "delta":
            now = time.perf_counter()
            samples.extend(now - moment for moment in _moments(line, sent))


def _moments(line: str, sent: Sent) -> Iterator[float]:
    for robot in json.loads(line.removeprefix("data: ")).get("robots", ()):
        if (position := robot.get("position")) and (moment := sent.get((robot["id"], position["x"]))):
            yield moment


def _publish(wire: Wire, number: int, header_id: int) -> None:
    robot = RobotKey("Bench", f"bench-{number:03d}")
    wire.publish(SCHEME.of(robot, Topic.STATE), payload(number, header_id))
