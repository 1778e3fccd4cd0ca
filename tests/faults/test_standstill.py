"""How long the robot stands whose order is in work, after a cut of each link and a restart of each part.

``make faults`` writes the figures into docs/recovery.md.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import count, cycle
from pathlib import Path

import httpx
import pytest

from faults.extent import WHOLE
from faults.moves import longest_standstill, read_moves, watched_agent
from faults.standstill import BEYOND, FILE, Standstill
from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.settings import MqttSettings
from support.aggregator_process import AggregatorProcess
from support.brokers import BROKERS, RealBroker
from support.mqtt_line import MqttLine, Way, mqtt_line
from support.order_service_fleet import Fleet, RobotOptions, order_in
from support.pausing import time_passes
from support.programs import OrderServiceProgram, Program
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(900)]

ENDS = ("Packing stand", "Parking bay")
"""The ends of a way of 22 m with seven points."""
CUT, SILENCE = 7.0, 10.0
"""Seconds: the first is longer than pauses of 0.2 s that double until 6 s, the second than two keep-alive
intervals."""
KEEP_ALIVE = 4
MOVED = 1.0
"""Metres that the robot has driven when the fault comes."""
LIMIT = 90.0
"""Timeout of each step, seconds."""


@dataclass
class Hall:
    """A site with one robot, each of whose links can be cut, and whose programs can be restarted."""

    fleet: Fleet
    broker: RealBroker
    robot_line: MqttLine
    service_line: MqttLine
    service: OrderServiceProgram = field(init=False)
    client: httpx.AsyncClient = field(init=False)
    robot: Program = field(init=False)
    panel: AggregatorProcess = field(init=False)
    _numbers: Iterator[int] = field(default_factory=lambda: count(1), init=False)
    _ends: Iterator[str] = field(default_factory=lambda: cycle(ENDS), init=False)

    def __post_init__(self) -> None:
        normal = MqttSettings()
        self._pauses = [
            f"--mqtt.{name}={getattr(normal, name)}" for name in ("reconnect_min", "reconnect_max")
        ]

    @property
    def record(self) -> Path:
        return self.fleet.folder / "moves"

    async def start(self) -> None:
        """Start all programs, and wait until the robot is free."""
        self.start_panel()
        self.start_robot()
        await self.start_service("--engine.restart_patience=0")
        await awaited(self._state, lambda state: state == "IDLE", seconds=LIMIT, what="a free robot")

    async def start_service(self, *more: str) -> None:
        """Start the order service and wait until it answers."""
        plant = self.fleet.folder / "plant.json"
        found = json.loads(read(sample_plant_path().read_bytes()).model.to_json())
        # only a start with an empty store waits for the others, none of which exists
        assert len(found["vehicles"]) > 1
        plant.write_text(json.dumps(found))
        options = (f"--plant={plant}", *self.service_line.options, *self._pauses, *more)
        self.service = self.fleet.order_service(*options)
        self.client = await self.service.client()

    def start_robot(self) -> None:
        """Start the robot; it goes on where it was."""
        robot = RobotOptions(x=1.0, y=7.0, speed=4.0)
        file = self.fleet.folder / "robot-01.toml"
        file.write_text(self.fleet.agent_file(**robot))
        options = ["--config", str(file), *self.robot_line.options, *self._pauses]
        options.append(f"--mqtt.keep_alive={KEEP_ALIVE}")
        log = self.fleet.folder / "robot-01.log"
        self.robot = self.fleet.stack.enter_context(watched_agent(self.record, *options, log=log))

    def start_panel(self) -> None:
        """Start the aggregator."""
        names = [f"--interface_name={self.fleet.interface}", f"--interface_name_v3={self.fleet.interface}"]
        options = [*names, f"--topic_prefix={self.fleet.prefix}", "--http.port=0", *self.broker.options]
        self.panel = self.fleet.stack.enter_context(AggregatorProcess(*options))

    async def is_driving(self) -> str:
        """Create an order to the other end, wait until the robot drives, and return the order's name."""
        name = f"T-{next(self._numbers)}"
        before = len(read_moves(self.record))
        body = {"name": name, "destinations": [{"locationName": next(self._ends)}]}
        answer = await self.client.post("/v1/transportOrders", json=body)
        assert answer.status_code == 201, answer.text

        async def driven() -> float:
            xs = [x for _, x, _ in read_moves(self.record)[max(0, before - 1) :]]
            return max(xs) - min(xs)

        await awaited(driven, lambda found: found > MOVED, seconds=LIMIT, what="the robot drives")
        return name

    async def _state(self) -> str:
        return str((await self.client.get("/v1/vehicles/Robot-01")).json().get("state"))


async def cut(line: MqttLine) -> None:
    line.conduct.down = True
    await time_passes(CUT)
    line.conduct.down = False


async def silence(line: MqttLine) -> None:
    line.conduct.held = set(Way)
    await time_passes(SILENCE)
    line.conduct.held = set()


async def restart_service(hall: Hall, *, kill: bool) -> None:
    await hall.client.aclose()
    if kill:
        hall.service.kill()
    else:
        hall.service.process.terminate()
        await asyncio.to_thread(hall.service.process.wait, LIMIT)
    await hall.start_service()


async def restart_panel(hall: Hall) -> None:
    await asyncio.to_thread(hall.panel.end)
    hall.start_panel()
    await hall.panel.url()


async def restart_robot(hall: Hall) -> None:
    hall.robot.kill()
    known = len(read_moves(hall.record))
    hall.start_robot()

    async def look() -> bool:
        return len(read_moves(hall.record)) > known

    await awaited(look, bool, seconds=LIMIT, what="the robot's program runs")


async def restart_broker(hall: Hall, *, kill: bool) -> None:
    if kill:
        hall.broker.kill()
        await asyncio.to_thread(hall.broker.start)
    else:
        await asyncio.to_thread(hall.broker.restart)


FAULTS: dict[str, Callable[[Hall], Awaitable[None]]] = {
    "robot's link cut": lambda hall: cut(hall.robot_line),
    "order service's link cut": lambda hall: cut(hall.service_line),
    "broker killed": lambda hall: restart_broker(hall, kill=True),
    "order service killed": lambda hall: restart_service(hall, kill=True),
    "robot's link silent": lambda hall: silence(hall.robot_line),
    "order service's link silent": lambda hall: silence(hall.service_line),
    "broker restarted": lambda hall: restart_broker(hall, kill=False),
    "order service restarted": lambda hall: restart_service(hall, kill=False),
    "robot's agent killed": restart_robot,
    "aggregator restarted": restart_panel,
}
"""Each returns at the end of the outage."""
QUICK = 3
"""So many of them run with all other tests, in less than a minute; the rest takes minutes."""


@pytest.mark.parametrize("broker_name", BROKERS if WHOLE else ["Mosquitto"])
async def test_robot_drives_on_after_each_outage(
    broker_name: str, interface_name: str, tmp_path: Path
) -> None:
    found: list[Standstill] = []
    with BROKERS[broker_name]() as broker, ExitStack() as stack:
        fleet = Fleet(broker, interface_name, tmp_path, stack=stack)
        lines = stack.enter_context(mqtt_line(broker)), stack.enter_context(mqtt_line(broker))
        hall = Hall(fleet, broker, robot_line=lines[0], service_line=lines[1])
        await hall.start()
        for fault, inject in list(FAULTS.items())[: None if WHOLE else QUICK]:
            name = await hall.is_driving()
            start = time.monotonic()
            await inject(hall)
            end = time.monotonic()
            order = await order_in(hall.client, name, "FINISHED", "FAILED", seconds=LIMIT)
            assert order["state"] == "FINISHED", (fault, order["reason"])
            moves = read_moves(hall.record)
            stood = longest_standstill(moves, start), longest_standstill(moves, end)
            outage, stood_in_all, beyond = (round(each, 1) for each in (end - start, *stood))
            found.append(Standstill(broker_name, fault, outage, stood_in_all, beyond))
            found[-1].append_to(FILE)
        await hall.client.aclose()
    limit = BEYOND if WHOLE else 2 * BEYOND  # other tests run meanwhile
    assert not [each for each in found if each.beyond > limit]
