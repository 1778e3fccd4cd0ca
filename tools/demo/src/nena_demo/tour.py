"""The guided tour: a hall that works, and one key for each thing that may happen in it."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import quote

import httpx

from nena_demo import hall_stack
from nena_demo.feed import OrderFeed
from nena_demo.hall_stack import HallStack
from nena_demo.host import ROBOTS_SECONDS, Host, JobFailedError
from nena_demo.keys import pressed_keys
from nena_demo.plants.hall import BLOCKED_AISLE, MANUFACTURER
from nena_demo.processes import Processes
from nena_demo.session import ProgressPrinter
from nena_demo.stack import Options
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.mqtt import Outbound
from nena_shared.tasks import Supervisor, end

QUIT: Final = "q"
NOT_KNOWN: Final = "UNKNOWN"
STATUS_SECONDS: Final = 15.0
"""Interval between two lines about the hall."""
LOWEST_CHARGE: Final = 24
"""Percent; robots start between this and 100, so that one of them recharges at once."""


@dataclass(frozen=True, slots=True)
class Step:
    """A step of the tour, and what it does."""

    key: str
    text: str
    run: Callable[[], Awaitable[None]]


class Tour:
    """Reacts to the keys, and prints what they cause."""

    def __init__(
        self, processes: Processes, running: HallStack, progress: ProgressPrinter, host: Host | None = None
    ) -> None:
        self.host = host or Host(running.mqtt, running.rest_url, self.changed)
        self.feed = OrderFeed(self.host, running.hall)
        self._processes = processes
        self._running = running
        self._progress = progress
        self._blocked = False
        self._stopped: str | None = None
        self._connections: dict[str, str] = {}
        self._moved = False
        self.steps = (
            Step("b", "block an aisle: robots take other routes", self._block_aisle),
            Step("k", "kill the agent of a robot: it comes back, and its robot goes on", self._kill_agent),
            Step(
                "o",
                "stop the order service: robots finish what they have; nothing is lost",
                self._toggle_service,
            ),
            Step(
                "e",
                "press the emergency stop of a robot: the others drive around it or wait",
                self._toggle_emergency_stop,
            ),
            Step("p", "load peak: three orders for each robot at once", self._create_peak),
            Step("r", "replay: what has happened so far", self._show_replay),
        )

    def introduce(self) -> None:
        """Print the steps."""
        self._progress.line("Guided tour. Watch the panel, and press a key; b, o and e again to undo them:")
        for step in self.steps:
            self._progress.line(f"  {step.key}  {step.text}")
        self._progress.line(f"  {QUIT}  stop everything (or Ctrl-C)")

    async def press(self, key: str) -> None:
        """Run the step of ``key``; other keys print the steps."""
        step = next((each for each in self.steps if each.key == key), None)
        if step is None:
            self.introduce()
            return
        try:
            await step.run()
        except httpx.HTTPError as error:
            hint = "" if self._running.order_service.wanted else ". Press o to start it"
            self._progress.line(f"{key}: the request to the order service failed ({error}){hint}")

    def changed(self, kind: str, name: str, state: str, reason: str) -> None:
        """Count orders, and print what went wrong or is well again."""
        if kind == "order":
            self._order_changed(name, TransportOrderState(state), reason)
        else:
            self._vehicle_changed(self.host.vehicles[name])

    def status(self) -> str:
        """Return one line about robots and orders."""
        robots = Counter(_activity_of(vehicle) for vehicle in self.host.vehicles.values())
        finished = self.feed.ended[TransportOrderState.FINISHED]
        failed = self.feed.ended.total() - finished
        shown = ", ".join(f"{count} {what}" for what, count in sorted(robots.items()))
        return f"robots: {shown} | orders: {finished} finished, {failed} failed, {len(self.feed.open)} open"

    def spread_charges(self) -> None:
        """Set the batteries of the loopback robots, from nearly empty to full."""
        robots = self._running.loopback
        for index, robot in enumerate(robots):
            charge = LOWEST_CHARGE + (100 - LOWEST_CHARGE) * index // max(1, len(robots) - 1)
            self._send_command(robot, command="battery", stateOfCharge=charge)

    def _order_changed(self, name: str, state: TransportOrderState, reason: str) -> None:
        ours = name in self.feed.open
        self.feed.changed(name, state)
        if state.final:
            self.host.orders.pop(name, None)  # they keep coming
            if ours and state is not TransportOrderState.FINISHED:
                self._progress.line(f"order {name} {state}: {reason}")

    def _vehicle_changed(self, vehicle: VehicleStatus) -> None:
        before = self._connections.get(vehicle.name)
        if vehicle.connection == NOT_KNOWN:  # as after each start of the order service
            return
        self._connections[vehicle.name] = vehicle.connection
        if vehicle.state is VehicleState.EXECUTING and not self._moved:
            self._moved = True
            self._progress.line(f"robots move: {vehicle.name} has the first order")
        if vehicle.connection == "ONLINE" and before not in (None, "ONLINE"):
            order = vehicle.transport_order
            self._progress.line(f"{vehicle.name} is back" + (f", and goes on with {order}" if order else ""))
        elif before == "ONLINE" and vehicle.connection != "ONLINE":
            self._progress.line(f"{vehicle.name} is {vehicle.connection}: {vehicle.reason}")

    async def _block_aisle(self) -> None:
        wanted = not self._blocked
        path = f"/v1/paths/{quote(BLOCKED_AISLE, safe='')}/lock"
        answer = await self.host.rest.put(path, json={"locked": wanted})
        answer.raise_for_status()
        self._blocked = wanted
        if wanted:
            self._progress.line(f"blocked: {BLOCKED_AISLE}; new routes avoid it. Press b to open it")
        else:
            self._progress.line(f"open again: {BLOCKED_AISLE}")

    async def _kill_agent(self) -> None:
        robot, agent = self._running.agent_robot, self._running.agent
        if agent.process.returncode is None:
            self._progress.line(f"killing the agent of {robot} (SIGKILL)")
            await self._processes.kill(agent)

    async def _toggle_service(self) -> None:
        service = self._running.order_service
        if service.wanted:
            await self._processes.stop(service)
            self._progress.line("order service stopped; robots drive to the end of their base. Press o again")
        else:
            await self._processes.restart(service)
            self._progress.line("order service is started again; it continues every order from its store")

    async def _toggle_emergency_stop(self) -> None:
        if self._stopped is not None:
            self._send_command(self._stopped, command="acknowledgeEmergencyStop")
            self._progress.line(f"emergency stop of {self._stopped} released")
            self._stopped = None
            return
        robots = [self.host.vehicles[each] for each in self._running.loopback if each in self.host.vehicles]
        driving = [robot.name for robot in robots if robot.state is VehicleState.EXECUTING]
        self._stopped = (driving or list(self._running.loopback))[0]
        self._send_command(self._stopped, command="emergencyStop", stop="MANUAL")
        self._progress.line(f"emergency stop of {self._stopped} pressed. Press e to release it")

    async def _create_peak(self) -> None:
        created = await self.feed.peak()
        what = f"{created} orders created at once" if created else "the order service accepted none"
        self._progress.line(f"load peak: {what}")

    async def _show_replay(self) -> None:
        self._progress.line(f"replay: open {self._running.panel_url}/#/history and press Play")

    def _send_command(self, robot: str, **command: object) -> None:
        """Send a command to the simulation control of a loopback robot."""
        topic = f"uagv/loopback/{MANUFACTURER}/{robot}/control"
        self.host.link.publish(Outbound(topic, json.dumps(command).encode()))


def _activity_of(vehicle: VehicleStatus) -> str:
    if vehicle.connection != "ONLINE":
        return vehicle.connection.lower().replace("_", " ")
    return vehicle.state.lower()


async def run_tour(folder: Path, options: Options, progress: ProgressPrinter, source: int) -> None:
    """Run the hall until the key q, or cancelled; keys come from the file descriptor ``source``.

    Raises:
        ChildFailedError: a process ends again and again.
        JobFailedError: not all robots became ready.
        NotReadyError: a service is not ready in time.
    """
    async with AsyncExitStack() as cleanup:
        processes = await cleanup.enter_async_context(Processes(folder))
        if not hall_stack.ros_is_installed():
            progress.line("rclpy is not installed: the hall has only loopback robots, no ROS robots")
        progress.line("starting broker, order service, status aggregator, door and robots")
        running = await hall_stack.start(processes, options)
        tour = Tour(processes, running, progress)
        cleanup.push_async_callback(tour.host.rest.aclose)
        keys = cleanup.enter_context(pressed_keys(source))
        tasks = [
            asyncio.create_task(work, name=name)
            for name, work in (
                ("host link", tour.host.link.run()),
                ("processes", processes.keep_running(progress.line)),
                ("tour", guide(tour, running, progress, keys)),
            )
        ]
        cleanup.push_async_callback(end, *tasks)
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for each in ended:
            each.result()
        progress.line("stopping everything")


async def guide(tour: Tour, running: HallStack, progress: ProgressPrinter, keys: asyncio.Queue[str]) -> None:
    """Start the orders, and follow the keys until q."""
    async with Supervisor() as supervisor:
        await _wait_until(tour.host, lambda: any(map(_is_ready, tour.host.vehicles.values())))
        tour.spread_charges()
        supervisor.start("orders", tour.feed.run(), vital=False)
        robots = len(running.hall.starts)
        await _wait_until(tour.host, lambda: sum(map(_is_ready, tour.host.vehicles.values())) == robots)
        progress.line(f"all {robots} robots are ready")
        progress.line(f"control panel at {running.panel_url}/")
        progress.line(f"order service at {running.rest_url}/docs")
        tour.introduce()
        supervisor.start("status", _report_status(tour, progress), vital=False)
        while (key := await keys.get()) != QUIT:
            await tour.press(key)


async def _report_status(tour: Tour, progress: ProgressPrinter) -> None:
    while True:
        await asyncio.sleep(STATUS_SECONDS)
        progress.line(tour.status())


async def _wait_until(host: Host, condition: Callable[[], bool]) -> None:
    try:
        await host.wait_for(condition, ROBOTS_SECONDS)
    except TimeoutError as error:
        known = (
            f"{vehicle.name}: {vehicle.connection} {vehicle.reason}" for vehicle in host.vehicles.values()
        )
        message = f"not all robots became ready within {ROBOTS_SECONDS:.0f} s. " + "; ".join(known)
        raise JobFailedError(message) from error


def _is_ready(vehicle: VehicleStatus) -> bool:
    return vehicle.connection == "ONLINE" and vehicle.current_position is not None
