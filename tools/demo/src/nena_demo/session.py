"""A run of the demo: start everything, do the main job, check the result, stop everything."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

import httpx
from prometheus_client.parser import text_string_to_metric_families

from nena_demo import host, stack
from nena_demo.host import Host, JobFailedError
from nena_demo.processes import Processes
from nena_demo.stack import DemoRobot, Options, Stack
from nena_shared.tasks import end


def check_fleet(
    fleet: Mapping[str, Any], expected: Mapping[str, str], robots: Sequence[DemoRobot]
) -> Iterator[str]:
    """Compare ``/api/v1/fleet`` with the orders' states and the robots; yield differences."""
    shown = {order["name"]: order["state"] for order in fleet["orders"]}
    for name, state in expected.items():
        if shown.get(name) != state:
            yield f"order {name} is shown as {shown.get(name)}, not {state}"
    conditions = {robot["serialNumber"]: robot for robot in fleet["robots"]}
    for robot in robots:
        seen = conditions.get(robot.serial_number)
        if seen is None:
            yield f"robot {robot.serial_number} is not shown"
        elif seen["condition"] != "IDLE":
            yield f"robot {robot.serial_number} is {seen['condition']}: {seen['reason']}"


def check_metrics(text: str, expected: Mapping[str, str], robots: Sequence[DemoRobot]) -> Iterator[str]:
    """Compare ``/metrics`` with the orders' states and the robots; yield differences."""
    samples = {
        (sample.name, sample.labels.get("state", ""), sample.labels.get("serial_number", "")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    for state in set(expected.values()):
        wanted = sum(1 for each in expected.values() if each == state)
        counted = samples.get(("nena_transport_orders_ended_total", state, ""), 0)
        if counted != wanted:
            yield f"nena_transport_orders_ended_total counts {counted:.0f} {state} orders, not {wanted}"
    if samples.get(("nena_mqtt_connected", "", "")) != 1:
        yield "nena_mqtt_connected is not 1"
    for robot in robots:
        if not any(
            name == "nena_robot_state_age_seconds" and serial == robot.serial_number
            for name, _, serial in samples
        ):
            yield f"nena_robot_state_age_seconds has no sample for {robot.serial_number}"


class ProgressPrinter:
    """Print progress: one line per event, with the seconds since the start."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._start = time.monotonic()

    def line(self, text: str) -> None:
        """Print a line with the seconds since the start."""
        self._out.write(f"[{time.monotonic() - self._start:7.2f} s] {text}\n")
        self._out.flush()

    def change(self, kind: str, name: str, state: str, reason: str) -> None:
        """Print the new state of an order or a vehicle."""
        self.line(f"{kind:7} {name:22} {state:18} {reason}")


AGGREGATOR_SECONDS = 15.0
"""Maximum delay of the aggregator behind the order service, seconds."""


class DemoSession:
    """Start the stack, do the job and check it; leaving the context ends everything."""

    def __init__(self, folder: Path, options: Options, progress: ProgressPrinter) -> None:
        self._options = options
        self._progress = progress
        self._cleanup = contextlib.AsyncExitStack()
        self._processes = Processes(folder)
        self._stack: Stack
        self._host: Host

    async def __aenter__(self) -> Self:
        """Start every process and connect the host."""
        try:
            await self._cleanup.enter_async_context(self._processes)
            self._progress.line(
                "starting broker, order service, status aggregator, simulator and two edge agents"
            )
            self._stack = await stack.start(self._processes, self._options)
            self._progress.line(f"order service at {self._stack.rest_url}/docs")
            self._progress.line(f"control panel at {self._stack.panel_url}/")
            self._host = Host(self._stack.mqtt, self._stack.rest_url, self._progress.change)
            self._cleanup.push_async_callback(self._host.rest.aclose)
            link = asyncio.create_task(self._host.link.run(), name="host link")
            self._cleanup.push_async_callback(end, link)
        except BaseException:
            # Python does not call __aexit__ if __aenter__ raises; the children would live on.
            await self._cleanup.aclose()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End everything."""
        await self._cleanup.aclose()

    async def do_main_job(self) -> None:
        """Run the two orders to their end.

        Raises:
            JobFailedError: an order stalled or failed.
            ChildFailedError: a process ended.
        """
        await self._run_watched(host.wait_for_robots(self._host, len(stack.ROBOTS)))
        await self._run_watched(host.run(self._host))
        self._progress.line("both transport orders are FINISHED")

    async def check_end_state(self) -> None:
        """Compare fleet state and metrics of the aggregator with the orders.

        Raises:
            JobFailedError: they differ.
        """
        expected = {name: order.state for name, order in self._host.orders.items()}
        async with httpx.AsyncClient(base_url=self._stack.panel_url, timeout=5.0) as client:
            problems = await _find_differences(client, expected)
            end = asyncio.get_running_loop().time() + AGGREGATOR_SECONDS
            while problems and asyncio.get_running_loop().time() < end:
                await asyncio.sleep(0.2)
                problems = await _find_differences(client, expected)
        if problems:
            raise JobFailedError("the aggregator shows a different state: " + "; ".join(problems))
        self._progress.line("fleet state and metrics are correct")

    async def _run_watched(self, work: Awaitable[object]) -> None:
        """Run ``work`` while monitoring the processes."""
        task = asyncio.ensure_future(work)
        try:
            while not task.done():
                self._processes.check()
                await asyncio.wait({task}, timeout=0.5)
            await task
        finally:
            task.cancel()


async def _find_differences(client: httpx.AsyncClient, expected: Mapping[str, str]) -> tuple[str, ...]:
    fleet, metrics = await client.get("/api/v1/fleet"), await client.get("/metrics")
    return (
        *check_fleet(fleet.json(), expected, stack.ROBOTS),
        *check_metrics(metrics.text, expected, stack.ROBOTS),
    )
