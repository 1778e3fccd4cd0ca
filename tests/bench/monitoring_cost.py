"""What metrics, black box and traces cost a program, in one process that does each in some rounds only.

``PYTHONPATH=tests python -m bench.monitoring_cost order_service`` (or ``aggregator``, ``agent``) prints the
CPU time of rounds without any of them, and for each part the difference to the rounds before and after, with
a 95 % confidence interval. Rounds with all parts tell how much of the CPU time is spent within their
functions. Separate processes would differ by 6 % for other reasons, such as the addresses of their objects.
"""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import mean, stdev
from time import monotonic, process_time, thread_time
from typing import IO, Any, Protocol, TypeVar
from unittest import mock

from bench.helper import helper
from bench.lanes import serving, write_plant
from bench.passing_nodes import roads
from nena_edge_agent.agent import AgentStatistics, RobotAgent
from nena_edge_agent.black_box.box import RobotBlackBox
from nena_edge_agent.tracing import RobotTracer
from nena_order_service.api.decisions import DecisionRecorder
from nena_order_service.api.tracing import OrderTracer
from nena_order_service.fleet.statistics import FleetStatistics
from nena_order_service.settings import OrderServiceSettings
from nena_shared import log
from nena_shared.histogram import Histogram
from nena_shared.mqtt import MqttLink
from nena_shared.settings import LogSettings
from nena_status_aggregator.__main__ import serve as serve_aggregator
from nena_status_aggregator.settings import AggregatorSettings
from support.broker import Broker, MqttPeer, free_port
from support.edge_agent import FleetControl, agent_settings, running_agent
from support.order_service_fleet import running
from support.pausing import time_passes
from support.robot_core import order
from support.waiting import until

ROBOTS = int(os.environ.get("NENA_BENCH_MONITORED", "100"))
"""Each passes a node and reports each second."""
SECONDS = 1.0
"""Length of a round: each robot reports once."""
BLOCKS = int(os.environ.get("NENA_BENCH_BLOCKS", "40"))
"""Number of rounds with each part."""
SCRAPE_INTERVAL = 15.0
"""Seconds between scrapes in ``deploy/prometheus/prometheus.yml``."""
SCRAPES = "scrapes"
ALL = "all"
NAME = "cost"
T = TypeVar("T", RobotAgent, MqttLink)
SURE = 1.96
"""Standard errors of a 95 % confidence interval."""


class Switch(Protocol):
    """Turns a part on or off."""

    def __call__(self, *, on: bool) -> None:
        """Turn it on or off."""


class Methods:
    """A switch for methods of a class, which do nothing while off; measures them if asked to."""

    def __init__(self, kind: type, *names: str) -> None:
        self._kind = kind
        self._own = {name: getattr(kind, name) for name in names}
        self.seconds = 0.0
        """CPU time within them while they were measured, without that of measuring."""

    def __call__(self, *, on: bool) -> None:
        """Turn them on or off."""
        self._set(lambda method: method if on else _do_nothing)

    def measure(self) -> None:
        """Turn them on, and measure them."""
        self._set(self._measured)

    def _set(self, of: Callable[[Callable[..., None]], Callable[..., None]]) -> None:
        for name, method in self._own.items():
            setattr(self._kind, name, of(method))

    def _measured(self, method: Callable[..., None]) -> Callable[..., None]:
        def call(*arguments: Any, **named: Any) -> None:
            begin = thread_time()
            method(*arguments, **named)
            self.seconds += thread_time() - begin - READING

        return call


def _do_nothing(*_: object, **__: object) -> None:
    pass


def _time_of_reading() -> float:
    """Return what reading the clock takes, s: as much as a short method."""
    begin = thread_time()
    for _ in range(READINGS):
        thread_time()
    return (thread_time() - begin) / READINGS


READINGS = 10_000
READING = _time_of_reading()


@dataclass
class Bench:
    """A running program and what can be switched in it."""

    metrics_url: str
    commands: IO[str]
    """Standard input of the load."""
    parts: Mapping[str, Switch] = field(default_factory=dict)
    work: Callable[[], float] = monotonic
    """Returns a measure of the work done so far, as CPU time is compared for equal work."""

    def scrape(self, *, on: bool) -> None:
        """Scrape the program, once."""
        if on:
            self.commands.write(f"{self.metrics_url}\n")
            self.commands.flush()

    async def measure(self) -> None:
        """Print the CPU time without the parts, and what each of them adds."""
        parts: dict[str, Switch] = {SCRAPES: self.scrape, **self.parts}
        measured = {name: each for name, each in self.parts.items() if isinstance(each, Methods)}
        for switch in parts.values():
            switch(on=False)
        whole, rounds = 0.0, [("", await self._round())]
        for _ in range(BLOCKS):
            for name, switch in parts.items():
                switch(on=True)
                rounds.append((name, await self._round()))
                switch(on=False)
                rounds.append(("", await self._round()))
            for each in measured.values():
                each.measure()
            begin = process_time()
            rounds.append((ALL, await self._round()))
            whole += process_time() - begin
            for each in measured.values():
                each(on=False)
            rounds.append(("", await self._round()))
        _print(rounds, list(parts))
        for name, each in measured.items():
            sys.stdout.write(f"within the functions of {name}: {100 * each.seconds / whole:.2f} %\n")

    async def _round(self) -> float:
        """Return the CPU time of a round per piece of work, s."""
        before, done = process_time(), self.work()
        await time_passes(SECONDS)
        return (process_time() - before) / max(self.work() - done, 1)


def _print(rounds: list[tuple[str, float]], parts: list[str]) -> None:
    bare = [cpu for name, cpu in rounds if not name]
    without = mean(bare)
    sys.stdout.write(f"without: {1000 * without:.2f} ms of CPU per message or second, {len(bare)} rounds\n")
    for part in parts:
        found = [
            cpu - (rounds[number - 1][1] + rounds[number + 1][1]) / 2
            for number, (name, cpu) in enumerate(rounds)
            if name == part
        ]
        less = SECONDS / SCRAPE_INTERVAL if part == SCRAPES else 1.0
        percent = 100 * less / without
        added, sure = mean(found), SURE * stdev(found) / len(found) ** 0.5
        text = f"{part}: {percent * added:+.2f} % +- {percent * sure:.2f}, {len(found)} rounds"
        sys.stdout.write(f"{text}\n")


@asynccontextmanager
async def load(broker_port: int, url: str, robots: int, collector_port: int) -> AsyncIterator[IO[str]]:
    """Run the load until the block ends; yield its standard input."""
    with ExitStack() as stack:
        made = helper("bench.monitoring_load", str(broker_port), url, str(robots), str(collector_port))
        process = await asyncio.to_thread(stack.enter_context, made)
        assert process.stdin
        yield process.stdin
        await asyncio.to_thread(stack.close)


@contextmanager
def kept(kind: type[T]) -> Iterator[list[T]]:
    """Collect the objects of a class that run."""
    found: list[T] = []
    run = kind.run

    async def run_kept(own: T, *arguments: Any) -> None:
        found.append(own)
        await run(own, *arguments)

    with mock.patch.object(kind, "run", run_kept):
        yield found


def received_on(links: list[MqttLink]) -> Callable[[], float]:
    """Return a function that counts the messages received so far."""
    return lambda: sum(each.state.received for each in links)


@asynccontextmanager
async def order_service(folder: Path, broker: Broker) -> AsyncIterator[Bench]:
    """Run the order service with robots on roads of their own."""
    collector = free_port()
    settings = OrderServiceSettings.model_validate(
        {
            "plant": write_plant(folder, roads(ROBOTS)),
            "store": {"url": f"sqlite:///{folder}/orders.db"},
            "mqtt": broker.settings,
            "http": {"port": free_port(), "burst": 1_000_000},
            "black_box": {"enabled": True},
            "upload": {"folder": folder / "outgoing"},
            "tracing": {"endpoint": f"http://127.0.0.1:{collector}/v1/traces"},
        }
    )
    async with AsyncExitStack() as stack:
        with kept(MqttLink) as links:
            client = await stack.enter_async_context(running(settings))
        url = str(client.base_url).rstrip("/")
        async with load(broker.port, url, ROBOTS, collector) as commands:
            yield Bench(
                f"{url}/metrics",
                commands,
                {
                    "durations": Methods(Histogram, "observe"),
                    "counting": Methods(FleetStatistics, "begun", "published", "happened"),
                    "black box": Methods(
                        DecisionRecorder, "order_changed", "vehicle_changed", "published", "happened"
                    ),
                    "traces": Methods(OrderTracer, "order_changed", "begun", "published", "happened"),
                },
                received_on(links),
            )


@asynccontextmanager
async def aggregator(folder: Path) -> AsyncIterator[Bench]:
    """Run the aggregator beside the same order service."""
    async with serving(folder, roads(ROBOTS), ROBOTS) as hall:
        settings = AggregatorSettings.model_validate(
            {
                "mqtt": {"port": hall.port},
                "http": {"port": free_port()},
                "history": {"url": f"sqlite:///{folder}/history.db"},
                "recordings": {"folder": folder / "recordings"},
            }
        )
        stop = asyncio.Event()
        with kept(MqttLink) as links:
            task = asyncio.create_task(serve_aggregator(settings, stop))
            await until(lambda: links)
        async with load(hall.port, hall.url, ROBOTS, free_port()) as commands:
            url = f"http://127.0.0.1:{settings.http.port}/metrics"
            yield Bench(url, commands, {"durations": Methods(Histogram, "observe")}, received_on(links))
        stop.set()
        await task


@asynccontextmanager
async def agent(folder: Path, broker: Broker) -> AsyncIterator[Bench]:
    """Run an agent that drives, with twenty poses and visualization messages per second."""
    collector = free_port()
    settings = agent_settings(
        broker,
        NAME,
        folder / "journal",
        black_box={"enabled": True},
        upload={"folder": folder / "outgoing"},
        tracing={"endpoint": f"http://127.0.0.1:{collector}/v1/traces"},
        metrics={"port": free_port()},
        loopback={"speed": 0.02, "pose_interval": 0.05},
        interval={"visualization": 0.05, "state_minimum": 0.02},
    )
    with kept(RobotAgent) as agents:
        async with running_agent(settings):
            with MqttPeer(broker, f"{NAME}/#") as peer:
                fleet = FleetControl(peer, NAME)
                await fleet.state()
                fleet.send(order("n0", "n9", order_id="o-1"))
                await fleet.state(lambda state: state["driving"])
            (own,) = agents
            async with load(broker.port, "", 0, collector) as commands:
                yield Bench(
                    f"http://127.0.0.1:{settings.metrics.port}/metrics", commands, parts_of_agent(own)
                )


def parts_of_agent(agent: RobotAgent) -> dict[str, Switch]:
    """Return the switches of an agent; its observers are looked up at each call from now on."""
    agent._observers = [partial(_note, each) for each in agent._observers]
    return {
        "durations": Methods(Histogram, "observe"),
        "counting": Methods(AgentStatistics, "note"),
        "black box": Methods(RobotBlackBox, "record", "note"),
        "traces": Methods(RobotTracer, "note"),
    }


def _note(observer: Any, *found: Any) -> None:
    observer.__self__.note(*found)


async def main(program: str, folder: Path) -> None:
    """Measure a program."""
    async with AsyncExitStack() as stack:
        if program == "aggregator":
            bench = await stack.enter_async_context(aggregator(folder))
        else:
            broker = Broker()
            stack.callback(broker.close)
            made = {"order_service": order_service, "agent": agent}[program]
            bench = await stack.enter_async_context(made(folder, broker))
        await bench.measure()


if __name__ == "__main__":
    log.configure(LogSettings())  # as the programs do
    with tempfile.TemporaryDirectory() as place:
        asyncio.run(main(sys.argv[1], Path(place)))
