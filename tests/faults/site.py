"""A whole site in separate processes: broker, order service, aggregator, ten robots, two of them on ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from faults.footprint import Footprint
from faults.hall import MAP_ID, start_of, write_hall
from support.broker import Broker, MqttPeer, free_port
from support.network import Line
from support.programs import Program
from support.ros import own_domain_id
from support.waiting import awaited

LOOPBACK = 8
ON_ROS = 2
SPEED = 6.0
"""m/s of the loopback robots: hours of a site in minutes."""
TIME_FACTOR = 6.0
"""How much faster than the clock the simulated robots on ROS move."""
READY_WITHIN = 180.0
KEEP_ALIVE, SHORT_KEEP_ALIVE = 15, 4
"""Seconds; the shorter one behind a line that is cut."""

AGENT = """
version = "2.1.0"
interface_name = "{interface}"
map_id = "{map_id}"
serial_number = "{serial}"
[interval]
state_maximum = 5.0
[mqtt]
host = "{host}"
port = {port}
keep_alive = {keep_alive}
reconnect_min = 0.1
reconnect_max = 1.0
[journal]
folder = "{journal}"
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


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What a site is made of."""

    loopback: int = LOOPBACK
    """Robots without ROS."""
    on_ros: bool = False
    """Whether the two robots on ROS are there."""
    store_url: str = ""
    """Of the orders, if not a file in ``data``."""
    persistence: bool = True
    """Whether the broker keeps what it had over a kill."""
    singles: int = 0
    """So many more robots are in the plant model; :meth:`Site.start_single` starts them."""
    line: Line | None = None
    """Behind which all robots are."""
    data: Path | None = None
    """Folder of stores and journals, if it is another one."""
    robots_in: Mapping[str, str] = field(default_factory=dict)
    """Environment of the robots' programs."""
    services_in: Mapping[str, str] = field(default_factory=dict)
    """Environment of order service and aggregator."""

    @property
    def serials(self) -> tuple[str, ...]:
        """Robots that are there."""
        loopback = (f"loop-{number}" for number in range(1, self.loopback + 1))
        return (*loopback, *(f"ros-{number}" for number in range(1, ON_ROS + 1) if self.on_ros))

    @property
    def singles_planned(self) -> tuple[str, ...]:
        """Robots that may come later: "single-1" and so on."""
        return tuple(f"single-{number}" for number in range(1, self.singles + 1))


class Site:
    """What the faults happen to. Each part can be killed and started again; its data stays."""

    def __init__(self, folder: Path, layout: Layout) -> None:
        """Prepare it, with configurations and logs in ``folder``; nothing but the broker runs yet."""
        self.folder = folder
        self._layout = layout
        self._data = layout.data or folder
        self._line = layout.line
        self.interface = "uagv"
        self.stack = ExitStack()
        self.broker = self._make_broker()
        self.wire = self.stack.enter_context(MqttPeer(self.broker, f"{self.interface}/#", "nena/v1/#"))
        self._domain = self.stack.enter_context(own_domain_id()) if layout.on_ros else 0
        self._ports = {"order-service": free_port(), "aggregator": free_port()}
        self._store = layout.store_url or f"sqlite:///{self._data}/orders.db"
        self.serials = layout.serials
        """Robots that are there."""
        self.vehicles = (*self.serials, *layout.singles_planned)
        """Those of the plant model."""
        self.plant = write_hall(folder, dict.fromkeys(self.vehicles, "2.1.0"))
        self.orders = httpx.AsyncClient(
            base_url=f"http://127.0.0.1:{self._ports['order-service']}", timeout=60
        )
        self.programs: dict[str, Program] = {}
        self.may_fail = 0
        """How many orders the fault may end, with a reason."""
        self.suspects: set[str] = set()
        """Vehicles all of whose orders may end so."""

    def _make_broker(self) -> Broker:
        kept = self.folder / "broker"
        kept.mkdir()
        keeping = f"persistence true\npersistence_location {kept}/\nautosave_interval 1\n"
        more = keeping if self._layout.persistence else ""
        broker = Broker(more=more, addresses=(self._line.near,) if self._line else ())
        self.stack.callback(broker.close)
        return broker

    async def start(self) -> None:
        """Start everything, and wait until every robot can accept an order."""
        self.start_order_service()
        self.start_aggregator()
        self.start_loopback()
        if self._layout.on_ros:
            self._start_ros()
        await self.all_robots_ready()

    async def all_robots_ready(self) -> None:
        """Wait until every robot is online."""
        await self.robots_are("ONLINE")

    async def robots_are(self, connection: str, *more: str) -> None:
        """Wait until the order service sees all robots, and ``more`` ones, with this connection."""
        wanted = {*self.serials, *more}

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
            lambda found: all(found.get(each) == connection for each in wanted),
            seconds=READY_WITHIN,
            what=f"every robot is {connection}",
        )

    def start_order_service(self) -> Program:
        """Start the order service on its store."""
        return self._program(
            "order-service",
            "nena-order-service",
            *("--plant", self.plant, "--store.url", self._store),
            *("--http.port", self._ports["order-service"], "--http.burst", 100_000),
            *("--mqtt.port", self.port_for("order-service"), "--mqtt.reconnect_max", 1.0),
        )

    def port_for(self, part: str) -> int:  # noqa: ARG002 - for sites with lines between
        """Return the port at which a part of the site finds the broker."""
        return self.broker.port

    def start_aggregator(self) -> Program:
        """Start the status aggregator on its history."""
        return self._program(
            "aggregator",
            "nena-status-aggregator",
            *(
                "--http.port",
                self._ports["aggregator"],
                "--history.url",
                f"sqlite:///{self._data}/history.db",
            ),
            *("--http.burst", 100_000),
            *("--mqtt.port", self.broker.port, "--mqtt.reconnect_max", 1.0),
        )

    def start_loopback(self) -> Program:
        """Start the robots without ROS, all in one program."""
        starts = "".join(
            f"[[loopback.starts]]\nx = {x}\ny = {y}\n" for x, y in map(start_of, range(self._layout.loopback))
        )
        more = f'driver = "loopback"\n{self._agent("loop")}{LOOPBACK_PART.format(speed=SPEED, starts=starts)}'
        more = more.replace("[loopback]\n", f"[loopback]\ncontrol = true\ncount = {self._layout.loopback}\n")
        return self._robot("loopback", more)

    def start_single(self, serial: str, *, at: tuple[float, float], machine: str) -> Program:
        """Start a robot without ROS in a separate program; each ``machine`` has its own journal."""
        start = f"[[loopback.starts]]\nx = {at[0]}\ny = {at[1]}\n"
        agent = self._agent(serial, journal=self._data / machine)
        text = f'driver = "loopback"\n{agent}{LOOPBACK_PART.format(speed=SPEED, starts=start)}'
        return self._robot(machine, text)

    def _start_ros(self) -> None:
        a, b = start_of(self._layout.loopback), start_of(self._layout.loopback + 1)
        text = SIMULATOR.format(factor=TIME_FACTOR, domain=self._domain, a=a, b=b)
        self._robot("simulator", text, script="nena-robot-simulator")
        for number in range(1, ON_ROS + 1):
            self.start_ros_agent(number)

    def start_ros_agent(self, number: int) -> Program:
        """Start the agent of a robot on ROS."""
        serial = f"ros-{number}"
        text = f'{self._agent(serial)}[ros]\nnamespace = "r{number}"\ndomain_id = {self._domain}\n'
        return self._robot(serial, text)

    def footprints(self) -> dict[str, Footprint]:
        """Return the resources of each program, including the broker."""
        running = {
            name: each.process.pid for name, each in self.programs.items() if each.process.poll() is None
        }
        return {name: Footprint.of(pid) for name, pid in {**running, "broker": self.broker.pid}.items()}

    @property
    def journals(self) -> list[Path]:
        """What robots keep of their work."""
        return list(self._data.rglob("*.journal"))

    @property
    def aggregator_url(self) -> str:
        """Where the aggregator is."""
        return f"http://127.0.0.1:{self._ports['aggregator']}"

    async def close(self) -> None:
        """End everything."""
        await self.orders.aclose()
        self.stack.close()

    def _agent(self, serial: str, journal: Path | None = None) -> str:
        return AGENT.format(
            interface=self.interface,
            map_id=MAP_ID,
            serial=serial,
            host=self._line.near if self._line else self.broker.host,
            port=self.port_for("loopback"),
            keep_alive=SHORT_KEEP_ALIVE if self._line else KEEP_ALIVE,
            journal=journal or self._data / "journal",
        )

    def _robot(self, name: str, text: str, script: str = "nena-edge-agent") -> Program:
        """Start a program where the robots are."""
        before = self._line.command if self._line else ()
        config = self._file(f"{name}.toml", text)
        return self._program(
            name, script, "--config", config, before=before, environment=self._layout.robots_in
        )

    def _file(self, name: str, text: str) -> Path:
        (self.folder / name).write_text(text)
        return self.folder / name

    def _program(
        self,
        name: str,
        script: str,
        *arguments: object,
        before: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ) -> Program:
        log = self.folder / f"{name}.log"
        environment = self._layout.services_in if environment is None else environment
        program = Program(script, *arguments, log=log, before=before, environment=environment)
        self.programs[name] = self.stack.enter_context(program)
        return program
