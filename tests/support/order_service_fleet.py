"""A separate fleet for each test: topics, a store, loopback robots and the order service."""

from __future__ import annotations

import asyncio
import ssl
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypedDict, TypeVar, Unpack

import httpx

from nena_demo.plants import sample_plant_path
from nena_order_service.app import serve
from nena_order_service.extension import installed
from nena_order_service.settings import OrderServiceSettings
from nena_shared.settings import settings_with
from support.broker import BrokerAddress, MqttPeer, free_port
from support.executions import executions
from support.programs import OrderServiceProgram, Program
from support.waiting import PATIENCE, awaited

T = TypeVar("T")

RESTART_PATIENCE = 2.0
"""Seconds that orders wait for a vehicle of the plant that a test does not start."""

END_KEPT = 0.2
"""Seconds that the end of an order stays retained: tests see it cleared."""

AGENT_FILE = """
driver = "loopback"
version = "{version}"
interface_name = "{interface}"
map_id = "sample-hall"
serial_number = "{serial}"
[mqtt]
port = {port}
reconnect_min = 0.05
reconnect_max = 0.2
[journal]
folder = "{folder}"
[loopback]
count = {count}
x = {x}
y = {y}
speed = {speed}
turn_rate = 100.0
pose_interval = 0.05
[[operations]]
action_type = "pick"
seconds = 0.1
load = "take"
[[operations]]
action_type = "drop"
seconds = 0.1
load = "give"
"""


class RobotOptions(TypedDict, total=False):
    """What tests choose of a loopback robot: place in m, speed in m/s, number of robots, version."""

    x: float
    y: float
    speed: float
    count: int
    version: str


AT_SOUTH_1 = RobotOptions(x=3.0, y=2.0, speed=40.0, count=1, version="2.1.0")


@dataclass
class Fleet:
    """One fleet on the shared broker: its topics, its store, its programs."""

    broker: BrokerAddress
    interface: str
    folder: Path
    store_url: str = ""
    """Empty: a file in the folder."""
    stack: ExitStack = field(default_factory=ExitStack)
    peers: list[MqttPeer] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Name the file of the store."""
        self.store_url = self.store_url or f"sqlite:///{self.folder}/orders.db"

    @property
    def prefix(self) -> str:
        return f"{self.interface}/hosts"

    def arguments(self) -> list[object]:
        return [
            *("--plant", sample_plant_path()),
            *("--store.url", self.store_url),
            *self.broker.options,
            *("--mqtt.reconnect_max", 0.2),
            *("--interface_name", self.interface),
            *("--interface_name_v3", self.interface),
            *("--topic_prefix", self.prefix),
            *("--end_kept", END_KEPT),
            *("--engine.restart_patience", RESTART_PATIENCE),
            "--no-engine.speed_limits",  # these robots are faster than the plant, for short tests
        ]

    def settings(self, *, speed_limits: bool = False, **more: Any) -> OrderServiceSettings:
        """Return the settings of an order service in this process.

        ``speed_limits``: whether robots get the speeds of the plant, at which they drive for a minute; it has
        no effect if ``engine`` sets it.
        """
        made = settings_with(OrderServiceSettings, installed()).model_validate(
            {
                "plant": sample_plant_path(),
                "store": {"url": self.store_url},
                "mqtt": self.broker.settings,
                "interface_name": self.interface,
                "interface_name_v3": self.interface,
                "topic_prefix": self.prefix,
                "end_kept": END_KEPT,
                "http": {"port": free_port()},
                **more,
            }
        )
        own = {"speed_limits": speed_limits, "restart_patience": RESTART_PATIENCE}
        chosen = {name: getattr(made.engine, name) for name in made.engine.model_fields_set}
        return made.model_copy(update={"engine": made.engine.model_copy(update=own | chosen)})

    def agent(self, serial: str = "robot-01", **options: Unpack[RobotOptions]) -> Program:
        """Start a loopback robot, by default on the point `South 1`."""
        return self.agent_of(self.agent_file(serial, **options), serial)

    def agent_file(self, serial: str = "robot-01", **options: Unpack[RobotOptions]) -> str:
        """Return the settings of such a robot, for a test that changes some of them."""
        return AGENT_FILE.format(
            interface=self.interface,
            serial=serial,
            port=self.broker.port,
            folder=self.folder / "journal",
            **{**AT_SOUTH_1, **options},
        )

    def agent_of(self, content: str, serial: str = "robot-01", *options: str) -> Program:
        """Start a robot with these settings, in TOML, and options."""
        file = self.folder / f"{serial}.toml"
        file.write_text(content)
        options = (*self.broker.options, *options)
        agent = Program("nena-edge-agent", "--config", file, *options, log=self.folder / f"{serial}.log")
        return self.stack.enter_context(agent)

    def order_service(
        self,
        *more: object,
        name: str = "order-service",
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> OrderServiceProgram:
        """Start the order service in a separate process, which logs under ``name``."""
        log = self.folder / f"{name}.log"
        program = OrderServiceProgram(*self.arguments(), *more, log=log, environment=environment)
        return self.stack.enter_context(program)

    def peer(self, *topic_filters: str) -> MqttPeer:
        """Connect a client that records all messages below the fleet's topics."""
        peer = self.stack.enter_context(MqttPeer(self.broker, *(topic_filters or (f"{self.interface}/#",))))
        self.peers.append(peer)
        return peer


@asynccontextmanager
async def running(
    settings: OrderServiceSettings, *, trust: ssl.SSLContext | None = None
) -> AsyncIterator[httpx.AsyncClient]:
    """Run the order service in this process until the block ends; with ``trust`` it is reached by TLS."""
    stop = asyncio.Event()
    task = asyncio.create_task(serve(settings, stop))
    url = f"{'https' if trust else 'http'}://127.0.0.1:{settings.http.port}"
    try:
        async with httpx.AsyncClient(base_url=url, timeout=PATIENCE, verify=trust or True) as client:
            await _answering(client, task)
            yield client
    finally:
        stop.set()
        await task


async def _answering(client: httpx.AsyncClient, task: asyncio.Task[None]) -> None:
    """Wait until the service answers; its own failure comes out here."""

    async def look() -> bool:
        if task.done():
            await task
        try:
            await client.get("/healthz")
        except httpx.TransportError:
            return False
        return True

    await awaited(look, bool, seconds=PATIENCE, what="the order service answers")


async def listening(client: httpx.AsyncClient) -> None:
    """Wait until the order service hears what is published."""

    async def status() -> int:
        return (await client.get("/readyz")).status_code

    await awaited(status, lambda told: told == 200, seconds=PATIENCE, what="the broker is connected")


async def order_in(
    client: httpx.AsyncClient, name: str, *states: str, seconds: float = PATIENCE
) -> dict[str, Any]:
    """Wait until an order is in one of ``states``, and return it."""

    async def look() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get(f"/v1/transportOrders/{name}")).json()
        return found

    return await awaited(
        look, lambda order: order.get("state") in states, seconds=seconds, what=f"{name} in {states}"
    )


async def vehicle_idle(client: httpx.AsyncClient, name: str = "Robot-01") -> dict[str, Any]:
    """Wait until a vehicle is online and can accept an order."""

    async def look() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get(f"/v1/vehicles/{name}")).json()
        return found

    return await awaited(
        look, lambda vehicle: vehicle.get("state") == "IDLE", seconds=PATIENCE, what=f"{name} is idle"
    )


async def role(client: httpx.AsyncClient) -> str:
    """Return the role of an order service; empty while it does not answer."""
    try:
        return str((await client.get("/readyz")).json()["role"])
    except httpx.TransportError:
        return ""


async def every_order_ended(client: httpx.AsyncClient, seconds: float = 200) -> list[dict[str, Any]]:
    """Wait until no order is active, and return all orders."""

    async def look() -> list[dict[str, Any]]:
        found = await client.get("/v1/transportOrders", params={"limit": 1000})
        orders: list[dict[str, Any]] = found.json()["transportOrders"]
        return orders

    return await awaited(
        look,
        lambda orders: all(order["finished"] for order in orders),
        seconds=seconds,
        what="every order is at its end",
        every=0.1,
    )


def actions_done(wire: MqttPeer, fleet: Fleet) -> Counter[str]:
    """Count, over the whole conversation, how often a load was taken up or set down for each drive order."""
    wire.catch_up()
    states = wire.received(f"{fleet.interface}/v2/+/+/state")
    return Counter(each.drive_order for each in executions(states))
