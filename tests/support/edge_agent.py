"""An edge agent for tests, in this process or a separate one, and fleet control's view of it."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from nena_edge_agent.actions.plugin import RosPort
from nena_edge_agent.actions.robot_ports import ActionDrive
from nena_edge_agent.extension import Robot, settings_model
from nena_edge_agent.program import serve
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.action import Action, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import codec_for, topics_for
from support.broker import Broker, MqttPeer
from support.robot_core import HEADER, MAP
from support.waiting import PATIENCE, until

MANUFACTURER = "ACME"
SERIAL = "0001"
SETTINGS = settings_model()
"""The agent's settings, with those of its extensions."""
QUICK = {"speed": 50.0, "turn_rate": 50.0, "pose_interval": 0.02}


def agent_settings(broker: Broker, interface_name: str, folder: Path, **changes: Any) -> EdgeAgentSettings:
    """Return the settings of a quick loopback robot."""
    values: dict[str, Any] = {
        "mqtt": broker.settings.model_dump(),
        "manufacturer": MANUFACTURER,
        "serial_number": SERIAL,
        "interface_name": interface_name,
        "topic_prefix": f"{interface_name}/nena",
        "map_id": MAP,
        "driver": "loopback",
        "loopback": QUICK,
        "journal": {"folder": folder},
        "interval": {"state_minimum": 0.02, "visualization": 0.2},
        "operations": [
            {"action_type": "pick", "seconds": 0.05, "load": "take"},
            {"action_type": "drop", "seconds": 0.05, "load": "give"},
        ],
    }
    return SETTINGS(**(values | changes))


ROBOT = RobotKey(MANUFACTURER, SERIAL)


def make_robot(key: RobotKey = ROBOT, ros: RosPort | None = None) -> Robot:
    """Return a robot as extensions see it."""
    return Robot(key, RobotLink(), ActionDrive(), ros)


@asynccontextmanager
async def running_agent(settings: EdgeAgentSettings) -> AsyncIterator[asyncio.Event]:
    """Run the agent in this loop until the block ends or the yielded event is set."""
    stop = asyncio.Event()
    task = asyncio.create_task(serve(settings, stop), name="agent under test")
    try:
        yield stop
        stop.set()
        await asyncio.wait_for(task, PATIENCE)
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=PATIENCE)  # the next agent has the same name


class AgentProcess:
    """The program ``nena-edge-agent`` in a separate process; killed at the end of the block."""

    def __init__(
        self, broker: Broker, interface_name: str, folder: Path, *options: str, driver: str = "loopback"
    ) -> None:
        self._command = [
            sys.executable,
            "-m",
            "nena_edge_agent",
            *("--driver", driver, "--map_id", MAP, "--interface_name", interface_name),
            *("--topic_prefix", f"{interface_name}/nena"),
            *("--manufacturer", MANUFACTURER, "--serial_number", SERIAL),
            *("--mqtt.host", broker.host, "--mqtt.port", str(broker.port)),
            *("--mqtt.reconnect_min", "0.02", "--mqtt.reconnect_max", "0.1"),
            *("--journal.folder", str(folder), "--interval.state_minimum", "0.02"),
            *options,
        ]
        self.process = self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.kill()

    def kill(self) -> None:
        """Kill it as by ``kill -9``."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def terminate(self) -> int:
        """Terminate it; return the exit status."""
        self.process.terminate()
        return self.process.wait(PATIENCE)

    def restart(self) -> None:
        """Start it again with the same options."""
        self.process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        environment = {key: value for key, value in os.environ.items() if not key.startswith("NENA_")}
        return subprocess.Popen(self._command, env=environment)


@lru_cache(maxsize=10_000)
def _read(payload: bytes) -> dict[str, Any]:
    """Parse a message; tests search all messages repeatedly, and each is parsed once."""
    found: dict[str, Any] = json.loads(payload)
    return found


class FleetControl:
    """Fleet control of one robot: sends orders and actions, and reads its messages."""

    def __init__(
        self, peer: MqttPeer, interface_name: str, serial: str = SERIAL, version: str = "2.1.0"
    ) -> None:
        self.peer = peer
        self.robot = RobotKey(MANUFACTURER, serial)
        self._codec = codec_for(version)
        self._topics = topics_for(version, interface_name)
        self.honest_headers = False
        """Whether messages have header IDs and timestamps as from a real fleet control."""
        self._counts: Counter[Topic] = Counter()

    def topic(self, topic: Topic) -> str:
        return self._topics.of(self.robot, topic)

    def send(self, order: Order) -> None:
        self.publish(Topic.ORDER, order)

    def instant(self, *actions: Action) -> None:
        self.publish(Topic.INSTANT_ACTIONS, InstantActions(**HEADER, actions=tuple(actions)))

    def publish(self, topic: Topic, message: Header) -> None:
        """Send any message of fleet control, with the robot's version and name in its header."""
        named = message.model_copy(update=self._header(topic))
        self.peer.publish(self.topic(topic), self._codec.encode(named))

    def _header(self, topic: Topic) -> dict[str, Any]:
        header: dict[str, Any] = {
            "version": self._codec.version,
            "manufacturer": self.robot.manufacturer,
            "serial_number": self.robot.serial_number,
        }
        if self.honest_headers:
            header |= {"header_id": self._counts[topic], "timestamp": datetime.now(UTC)}
            self._counts[topic] += 1
        return header

    @property
    def states(self) -> list[dict[str, Any]]:
        return [_read(each) for each in self.peer.payloads(self.topic(Topic.STATE))]

    @property
    def connections(self) -> list[str]:
        messages = self.peer.payloads(self.topic(Topic.CONNECTION))
        return [json.loads(each)["connectionState"] for each in messages]

    async def state(
        self, accept: Callable[[dict[str, Any]], Any] = lambda _: True, *, within: float = PATIENCE
    ) -> dict[str, Any]:
        """Wait for a state, also an earlier one, for which ``accept`` is true."""
        return await until(
            lambda: next((each for each in self.states if accept(each)), None),
            timeout=within,
            what=lambda: f"a state of {self.robot}; the last ones are {self.states[-2:]}; this",
        )


def ended(order_id: str) -> Callable[[dict[str, Any]], bool]:
    """Return a filter for states in which ``order_id`` has ended."""

    def accept(state: dict[str, Any]) -> bool:
        actions = [each["actionStatus"] in ("FINISHED", "FAILED") for each in state["actionStates"]]
        return state["orderId"] == order_id and not state["nodeStates"] and all(actions)

    return accept


def status_of(state: dict[str, Any], action_id: str) -> str | None:
    found = (each["actionStatus"] for each in state["actionStates"] if each["actionId"] == action_id)
    return next(found, None)


def error_types(state: dict[str, Any]) -> Sequence[str]:
    return [each["errorType"] for each in state["errors"]]
