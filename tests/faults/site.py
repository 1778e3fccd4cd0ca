"""A whole site in processes of its own: broker, order service, aggregator, ten robots, two of them on ROS."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import httpx

from faults.hall import MAP_ID, start_of, write_hall
from support.broker import Broker, MqttPeer, free_port
from support.order_service_fleet import awaited
from support.programs import Program

LOOPBACK = 8
ON_ROS = 2
SPEED = 6.0
"""m/s of the loopback robots: hours of a site in minutes."""
TIME_FACTOR = 6.0
"""How much faster than the clock the simulated robots on ROS move."""
READY_WITHIN = 90.0

AGENT = """
version = "2.1.0"
interface_name = "{interface}"
map_id = "{map_id}"
serial_number = "{serial}"
[interval]
state_maximum = 5.0
[mqtt]
port = {port}
reconnect_min = 0.1
reconnect_max = 1.0
[journal]
folder = "{folder}/journal"
[[operations]]
action_type = "pick"
seconds = 0.2
load = "take"
[[operations]]
action_type = "drop"
seconds = 0.2
load = "give"
"""

LOOPBACK_PART = """
[loopback]
speed = {speed}
turn_rate = 50.0
pose_interval = 0.1
drain = 0.0
{starts}
"""

SIMULATOR = """
time_factor = {factor}
map = {{ min_x = -3.0, min_y = -3.0, max_x = 25.0, max_y = 14.0 }}
[[robots]]
name = "ros-1"
namespace = "r1"
domain_id = {domain}
start = {{ x = {a[0]}, y = {a[1]}, yaw = 0.0 }}
[[robots]]
name = "ros-2"
namespace = "r2"
domain_id = {domain}
start = {{ x = {b[0]}, y = {b[1]}, yaw = 0.0 }}
"""


class Site:
    """What the faults happen to. Each part can be killed and started again; its data stays."""

    def __init__(
        self,
        folder: Path,
        *,
        on_ros: bool = False,
        store_url: str = "",
        persistence: bool = True,
        domain: int = 77,
    ) -> None:
        self.folder = folder
        self.interface = "uagv"
        self.stack = ExitStack()
        data = folder / "broker"
        data.mkdir()
        kept = f"persistence true\npersistence_location {data}/\nautosave_interval 1\n"
        self.broker = Broker(more=kept if persistence else "")
        self.stack.callback(self.broker.close)
        self.wire = self.stack.enter_context(MqttPeer(self.broker, f"{self.interface}/#", "nena/v1/#"))
        self._domain = domain
        self._on_ros = on_ros
        self._ports = {"order-service": free_port(), "aggregator": free_port()}
        self._store = store_url or f"sqlite:///{folder}/orders.db"
        serials = [f"loop-{number}" for number in range(1, LOOPBACK + 1)]
        serials += [f"ros-{number}" for number in range(1, ON_ROS + 1)] if on_ros else []
        self.serials = tuple(serials)
        self.plant = write_hall(folder, dict.fromkeys(serials, "2.1.0"))
        self.orders = httpx.AsyncClient(
            base_url=f"http://127.0.0.1:{self._ports['order-service']}", timeout=15
        )
        self.programs: dict[str, Program] = {}
        self.wire_broke = False
        """Whether the broker was away: our own watch of it has holes then."""
        self.may_fail = 0
        """How many orders the fault may end, with a reason."""

    async def start(self) -> None:
        """Start everything, and wait until every robot could take an order."""
        self.start_order_service()
        self.start_aggregator()
        self.start_loopback()
        if self._on_ros:
            self._start_ros()
        await self.all_robots_ready()

    async def all_robots_ready(self) -> None:
        """Wait until every robot is there."""

        async def look() -> dict[str, str]:
            for name, program in self.programs.items():
                assert program.process.poll() is None, f"{name} has ended:\n{program.log[-3000:]}"
            try:
                found = (await self.orders.get("/v1/vehicles")).json()["vehicles"]
            except (httpx.HTTPError, KeyError, ValueError):
                return {}
            return {each["name"]: each["connection"] for each in found}

        await awaited(
            look,
            lambda found: all(found.get(each) == "ONLINE" for each in self.serials),
            seconds=READY_WITHIN,
            what="every robot is ONLINE",
        )

    def start_order_service(self) -> Program:
        """Start the order service on its store."""
        return self._program(
            "order-service",
            "nena-order-service",
            *("--plant", self.plant, "--store.url", self._store),
            *("--http.port", self._ports["order-service"], "--http.burst", 100_000),
            *("--mqtt.port", self.broker.port, "--mqtt.reconnect_max", 1.0),
        )

    def start_aggregator(self) -> Program:
        """Start the status aggregator on its history."""
        return self._program(
            "aggregator",
            "nena-status-aggregator",
            *(
                "--http.port",
                self._ports["aggregator"],
                "--history.url",
                f"sqlite:///{self.folder}/history.db",
            ),
            *("--mqtt.port", self.broker.port, "--mqtt.reconnect_max", 1.0),
        )

    def start_loopback(self) -> Program:
        """Start the robots without ROS, all in one program."""
        starts = "".join(
            f"[[loopback.starts]]\nx = {x}\ny = {y}\n" for x, y in map(start_of, range(LOOPBACK))
        )
        more = f'driver = "loopback"\n{self._agent("loop")}{LOOPBACK_PART.format(speed=SPEED, starts=starts)}'
        more = more.replace("[loopback]\n", f"[loopback]\ncount = {LOOPBACK}\n")
        return self._program("loopback", "nena-edge-agent", "--config", self._file("loopback.toml", more))

    def _start_ros(self) -> None:
        a, b = start_of(LOOPBACK), start_of(LOOPBACK + 1)
        text = SIMULATOR.format(factor=TIME_FACTOR, domain=self._domain, a=a, b=b)
        self._program("simulator", "nena-robot-simulator", "--config", self._file("simulator.toml", text))
        for number in range(1, ON_ROS + 1):
            self.start_ros_agent(number)

    def start_ros_agent(self, number: int) -> Program:
        """Start the agent of a robot on ROS."""
        serial = f"ros-{number}"
        text = f'{self._agent(serial)}[ros]\nnamespace = "r{number}"\ndomain_id = {self._domain}\n'
        return self._program(serial, "nena-edge-agent", "--config", self._file(f"{serial}.toml", text))

    @property
    def aggregator_url(self) -> str:
        """Where the aggregator is."""
        return f"http://127.0.0.1:{self._ports['aggregator']}"

    async def close(self) -> None:
        """End everything."""
        await self.orders.aclose()
        self.stack.close()

    def _agent(self, serial: str) -> str:
        return AGENT.format(
            interface=self.interface, map_id=MAP_ID, serial=serial, port=self.broker.port, folder=self.folder
        )

    def _file(self, name: str, text: str) -> Path:
        (self.folder / name).write_text(text)
        return self.folder / name

    def _program(self, name: str, script: str, *arguments: object) -> Program:
        program = Program(script, *arguments, log=self.folder / f"{name}.log")
        self.programs[name] = self.stack.enter_context(program)
        return program
