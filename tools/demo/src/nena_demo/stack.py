"""The whole system on one machine: broker, order service, aggregator, and robots with their edge agents."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from nena_demo.plants import sample_plant_path
from nena_demo.processes import Processes, console_script, free_port, start_broker
from nena_shared.settings import MqttSettings

READY_SECONDS = 300.0
"""Time for a busy machine; a process that ends is noticed at once."""

MAP_ID = "sample-hall"

HIGHEST_SAFE_DOMAIN = 101
"""Above it, ROS ports overlap with Linux's ephemeral ports."""


class NotReadyError(Exception):
    """A service did not become ready in time."""

    def __init__(self, url: str) -> None:
        super().__init__(f"{url}/readyz did not answer 'ready' within {READY_SECONDS:.0f} s")
        self.url = url


@dataclass(frozen=True, slots=True)
class DemoRobot:
    """A ROS robot of the demo: its initial pose in the plant (m, rad) and its ROS namespace."""

    serial_number: str
    namespace: str
    x: float
    y: float
    theta: float


ROBOTS = (
    DemoRobot("robot-01", "r1", x=1.0, y=7.0, theta=0.0),
    DemoRobot("robot-02", "r2", x=23.0, y=7.0, theta=3.14159),
)
"""They start at the points `Parking bay` and `Packing stand` of the sample plant."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the demo."""

    broker: str = "auto"
    time_factor: float = 5.0
    domain_id: int = field(default_factory=lambda: 1 + secrets.randbelow(HIGHEST_SAFE_DOMAIN))
    separate_domains: bool = False
    """Whether the second robot uses the next ROS domain instead of sharing the first one's."""
    panel_port: int = 0
    rest_port: int = 0
    robots: int = 10
    """Number of loopback robots of the guided tour."""

    def domain_of(self, index: int) -> int:
        """Return the ROS domain of a robot, counted from 0."""
        return self.domain_id + (index if self.separate_domains else 0)


@dataclass(frozen=True, slots=True)
class RosFleet:
    """The ROS robots of a hall, and the map on which they are."""

    robots: tuple[DemoRobot, ...]
    map_id: str
    corners: tuple[float, float, float, float]
    """Smallest and largest x, smallest and largest y of the map, m."""
    speed: float = 1.0
    """m/s"""


SAMPLE_FLEET = RosFleet(ROBOTS, MAP_ID, (-1.0, 25.0, -1.0, 15.0))


@dataclass(frozen=True, slots=True)
class Stack:
    """The running system and its URLs."""

    processes: Processes
    mqtt: MqttSettings
    rest_url: str
    panel_url: str


async def start(processes: Processes, options: Options) -> Stack:
    """Start everything and wait until each service is ready.

    Raises:
        ChildFailedError: one of them ended.
        NotReadyError: one of them is not ready in time.
    """
    stack = await start_services(processes, options)
    variables = environment(processes.folder, stack.mqtt.port)
    await start_robots(processes, options, variables, SAMPLE_FLEET)
    return stack


async def start_services(processes: Processes, options: Options) -> Stack:
    """Start broker, order service and aggregator; raises as :func:`start`."""
    broker_port = free_port()
    rest_port, panel_port = options.rest_port or free_port(), options.panel_port or free_port()
    await start_broker(processes, broker_port, options.broker)
    variables = environment(processes.folder, broker_port)
    order_service = [
        console_script("nena-order-service"),
        "--plant",
        str(sample_plant_path()),
        "--http.port",
        str(rest_port),
        "--store.url",
        f"sqlite:///{processes.folder / 'orders.sqlite3'}",
    ]
    aggregator = [
        console_script("nena-status-aggregator"),
        "--http.port",
        str(panel_port),
        "--history.url",
        f"sqlite:///{processes.folder / 'history.sqlite3'}",
        "--order_service.url",
        f"http://127.0.0.1:{rest_port}",
    ]
    await processes.start("order-service", order_service, environment=variables)
    await processes.start("status-aggregator", aggregator, environment=variables)
    stack = Stack(
        processes,
        MqttSettings(port=broker_port),
        f"http://127.0.0.1:{rest_port}",
        f"http://127.0.0.1:{panel_port}",
    )
    await wait_until_ready(processes, stack.rest_url, stack.panel_url)
    return stack


async def start_robots(
    processes: Processes, options: Options, variables: Mapping[str, str], fleet: RosFleet
) -> None:
    """Start the simulator and an edge agent for each of its robots."""
    simulator = processes.folder / "robot-simulator.toml"
    simulator.write_text(_simulator_file(options, fleet), encoding="utf-8")
    command = [console_script("nena-robot-simulator"), "--config", str(simulator)]
    await processes.start("robot-simulator", command, environment=variables)
    for index, robot in enumerate(fleet.robots):
        name = f"edge-agent-{robot.serial_number}"
        configuration = processes.folder / f"{name}.toml"
        domain_id = options.domain_of(index)
        configuration.write_text(
            _agent_file(robot, fleet.map_id, processes.folder, domain_id), encoding="utf-8"
        )
        command = [console_script("nena-edge-agent"), "--config", str(configuration)]
        await processes.start(name, command, environment=variables)


def environment(folder: Path, broker_port: int) -> dict[str, str]:
    """Return environment variables: the broker's address, and ROS discovery on this machine only."""
    return {
        "NENA_MQTT__HOST": "127.0.0.1",
        "NENA_MQTT__PORT": str(broker_port),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(folder / "ros"),
    }


def _simulator_file(options: Options, fleet: RosFleet) -> str:
    robots = "".join(
        f"""
[[robots]]
name = "{robot.serial_number}"
namespace = "{robot.namespace}"
domain_id = {options.domain_of(index)}
start = {{ x = {robot.x}, y = {robot.y}, yaw = {robot.theta} }}
drive = {{ speed = {fleet.speed} }}
"""
        for index, robot in enumerate(fleet.robots)
    )
    left, right, bottom, top = fleet.corners
    return f"""\
time_factor = {options.time_factor}
map = {{ min_x = {left}, min_y = {bottom}, max_x = {right}, max_y = {top} }}
{robots}"""


def _agent_file(robot: DemoRobot, map_id: str, folder: Path, domain_id: int) -> str:
    return f"""\
manufacturer = "NeNa"
serial_number = "{robot.serial_number}"
map_id = "{map_id}"
driver = "nav2"
journal = {{ folder = "{folder / "journal"}" }}
drive = {{ strategy = "pass_through", deviation_xy = 0.5 }}

[ros]
namespace = "{robot.namespace}"
domain_id = {domain_id}
"""


async def wait_until_ready(processes: Processes, *urls: str) -> None:
    """Poll /readyz of each HTTP service until it is ready; raise if a child has ended."""
    loop = asyncio.get_running_loop()
    end = loop.time() + READY_SECONDS
    async with httpx.AsyncClient(timeout=5.0) as client:
        for url in urls:
            while not await _is_ready(client, url):
                processes.check()
                if loop.time() > end:
                    raise NotReadyError(url)
                await asyncio.sleep(0.1)


async def _is_ready(client: httpx.AsyncClient, url: str) -> bool:
    try:
        return (await client.get(f"{url}/readyz")).status_code == httpx.codes.OK
    except httpx.HTTPError:
        return False
