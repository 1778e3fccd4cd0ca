"""The processes of the guided tour: services, a door, loopback robots, and with ROS two ROS robots."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Final

from nena_demo import stack
from nena_demo.plants.hall import GATE, MANUFACTURER, MAP_ID, SPEED_MM_S, Hall, make_hall
from nena_demo.processes import Child, Processes, console_script, free_port, start_broker
from nena_demo.stack import DemoRobot, Options, RosFleet
from nena_shared.settings import MqttSettings

LOOPBACK_SERIAL: Final = "AMR"
ROS_SERIALS: Final = ("ROS-1", "ROS-2")
SPEED: Final = SPEED_MM_S / 1000
"""m/s"""
DOOR_SECONDS: Final = 2.0
BATTERY: Final = "drain = 4.0\ncharge_rate = 2.0"
"""A robot needs to recharge after some twenty minutes, for about half a minute."""


@dataclass(frozen=True, slots=True)
class HallStack:
    """The running hall."""

    hall: Hall
    mqtt: MqttSettings
    rest_url: str
    panel_url: str
    order_service: Child
    agent: Child
    """The agent that runs one loopback robot alone, ``agent_robot``."""
    agent_robot: str
    loopback: tuple[str, ...]
    """The serial numbers of all loopback robots."""


def ros_is_installed() -> bool:
    """Return whether ROS robots can run here."""
    return find_spec("rclpy") is not None


async def start(processes: Processes, options: Options) -> HallStack:
    """Start everything at once, and wait until both services are ready.

    Raises:
        ChildFailedError: one of them ended.
        NotReadyError: one of them is not ready in time.
    """
    loopback = tuple(f"{LOOPBACK_SERIAL}-{number + 1}" for number in range(options.robots))
    ros = ROS_SERIALS if ros_is_installed() else ()
    hall = make_hall((loopback[-1], *loopback[:-1], *ros))  # the first place is next to goods in
    mqtt = MqttSettings(port=free_port())
    await start_broker(processes, mqtt.port, options.broker)
    variables = stack.environment(processes.folder, mqtt.port)
    rest_port, panel_port = options.rest_port or free_port(), options.panel_port or free_port()
    rest_url, panel_url = f"http://127.0.0.1:{rest_port}", f"http://127.0.0.1:{panel_port}"
    order_service = await _start_program(
        processes, "order-service", _order_service_file(processes, hall, rest_port), variables
    )
    await _start_program(
        processes, "status-aggregator", _aggregator_file(processes, panel_port, rest_url), variables
    )
    agent = await _start_loopback(processes, hall, options.robots, variables)
    door = (console_script("nena-demo-peripheral"), GATE, "--port", str(mqtt.port))
    await processes.start("door", (*door, "--seconds", str(DOOR_SECONDS)), environment=variables)
    if ros:
        await stack.start_robots(processes, options, variables, _ros_fleet(hall, ros))
    await stack.wait_until_ready(processes, rest_url, panel_url)
    return HallStack(hall, mqtt, rest_url, panel_url, order_service, agent, loopback[-1], loopback)


async def _start_program(
    processes: Processes, name: str, settings: str, variables: Mapping[str, str]
) -> Child:
    file = processes.folder / f"{name}.toml"
    file.write_text(settings, encoding="utf-8")
    program = "edge-agent" if name.startswith("edge-agent") else name
    command = (console_script(f"nena-{program}"), "--config", str(file))
    return await processes.start(name, command, environment=variables)


async def _start_loopback(
    processes: Processes, hall: Hall, robots: int, variables: Mapping[str, str]
) -> Child:
    """Start the agents of the loopback robots; return that of the last one, which runs alone."""
    if robots > 1:
        fleet = _loopback_file(processes, hall, LOOPBACK_SERIAL, range(1, robots))
        await _start_program(processes, "edge-agents", fleet, variables)
    last = f"{LOOPBACK_SERIAL}-{robots}"
    alone = _loopback_file(processes, hall, last, range(1))
    return await _start_program(processes, f"edge-agent-{last}", alone, variables)


def _order_service_file(processes: Processes, hall: Hall, port: int) -> str:
    plant = processes.folder / "hall.json"
    plant.write_text(hall.plant.to_json(), encoding="utf-8")
    return f"""\
plant = {_toml_text(plant)}
http = {{ port = {port} }}
store = {{ url = {_toml_text(f"sqlite:///{processes.folder / 'orders.sqlite3'}")} }}

[engine.peripherals]
enabled = true

[engine.dispatch]
parking = {{ enabled = true }}
recharging = {{ enabled = true }}
energy = {{ until_fully_recharged = false }}
"""


def _aggregator_file(processes: Processes, port: int, rest_url: str) -> str:
    return f"""\
http = {{ port = {port} }}
history = {{ url = {_toml_text(f"sqlite:///{processes.folder / 'history.sqlite3'}")} }}
order_service = {{ url = {_toml_text(rest_url)} }}
"""


def _loopback_file(processes: Processes, hall: Hall, serial_number: str, robots: range) -> str:
    starts = "".join(
        f"\n[[loopback.starts]]\nx = {place.x}\ny = {place.y}\ntheta = {place.theta}\n"
        for place in (hall.starts[robot] for robot in robots)
    )
    # A fleet of one would not be numbered.
    serial = f"{serial_number}-1" if len(robots) == 1 and serial_number == LOOPBACK_SERIAL else serial_number
    return f"""\
manufacturer = "{MANUFACTURER}"
serial_number = "{serial}"
map_id = "{MAP_ID}"
driver = "loopback"
interval = {{ state_maximum = 10.0 }}
journal = {{ folder = {_toml_text(processes.folder / "journal")} }}

[loopback]
count = {len(robots)}
speed = {SPEED}
control = true
{BATTERY}
{starts}"""


def _ros_fleet(hall: Hall, serials: tuple[str, ...]) -> RosFleet:
    places = hall.starts[-len(serials) :]
    robots = tuple(
        DemoRobot(serial, f"r{index + 1}", place.x, place.y, place.theta)
        for index, (serial, place) in enumerate(zip(serials, places, strict=True))
    )
    return RosFleet(robots, MAP_ID, (-4.0, hall.width + 3.0, -4.0, 20.0), SPEED)


def _toml_text(value: object) -> str:
    """Return a TOML string."""
    return json.dumps(str(value))
