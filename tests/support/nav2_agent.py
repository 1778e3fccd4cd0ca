"""An edge agent in this process, a simulated robot in a separate one, and fleet control over a broker."""

from __future__ import annotations

import json
import shutil
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from std_msgs.msg import String

from nena_edge_agent.settings import EdgeAgentSettings
from support.broker import Broker, MqttPeer
from support.edge_agent import AgentProcess, FleetControl, agent_settings, running_agent, status_of
from support.nav2_driver import PATIENT
from support.robot_core import action
from support.ros import BEST_EFFORT, Inbox, RosPeer
from support.simulator import SimulatorProcess, publisher_to
from support.waiting import until

ROS: dict[str, Any] = {"goals": PATIENT.model_dump(), "watch_period": 0.1, "call_timeout": 3.0}
"""Short check intervals, and long timeouts for a slow machine."""

ROUNDED = 0.01
"""Maximum rounding of a state's timestamp, downwards, seconds."""


class Bench:
    """Test bench: fleet control, the ROS graph, and a folder for the programs."""

    def __init__(
        self,
        broker: Broker,
        interface_name: str,
        *,
        ros: RosPeer,
        domain_id: int,
        folder: Path,
        version: str = "2.1.0",
    ) -> None:
        self.mqtt = MqttPeer(broker, f"{interface_name}/#")
        self.fleet = FleetControl(self.mqtt, interface_name, version=version)
        self._version = version
        self.ros = ros
        self._odometry: Inbox[Any] = ros.subscribe(Odometry, "odom", BEST_EFFORT)
        self._faults: Any = None
        self._broker = broker
        self._interface_name = interface_name
        self.domain_id = domain_id
        self._folder = folder

    @contextmanager
    def simulator(self, *options: str, time_factor: float = 5.0, **robot: Any) -> Iterator[SimulatorProcess]:
        """Run the robot in a separate process; ``robot`` has fields of its settings."""
        fields = json.dumps([{"domain_id": self.domain_id, **robot}])
        options = ("--time_factor", str(time_factor), "--robots", fields, *options)
        with SimulatorProcess(*options, directory=self._folder) as process:
            process.wait_for_line("robot ready")
            yield process

    @property
    def speed(self) -> float:
        """Return the robot's speed by its odometry, m/s."""
        return abs(self._odometry.messages[-1].twist.twist.linear.x) if self._odometry.messages else 0.0

    async def speed_at(self, state: dict[str, Any]) -> float:
        """Return the robot's speed by its odometry, m/s, at the time of a state."""
        told = datetime.fromisoformat(state["timestamp"]).timestamp() + ROUNDED

        def after() -> bool:
            return bool(self._odometry.messages) and stamp_of(self._odometry.messages[-1]) > told

        await until(after, what="odometry that is younger than the state")
        before = [each for each in self._odometry.messages if stamp_of(each) <= told]
        return abs(float(before[-1].twist.twist.linear.x))

    def speeds(self, start: float, end: float) -> list[float]:
        """Return the robot's speeds (m/s) between two positions on its path (m), by its odometry."""
        found = self._odometry.messages
        return [each.twist.twist.linear.x for each in found if start < each.pose.pose.position.x < end]

    @property
    def places(self) -> list[float]:
        """Return the robot's x coordinates by its odometry, m."""
        return [each.pose.pose.position.x for each in self._odometry.messages]

    @property
    def odometry(self) -> list[Any]:
        """Return all messages of its odometry."""
        return self._odometry.messages

    def forget(self) -> None:
        """Remove what the agents have stored, so that the next one has no order."""
        shutil.rmtree(self._folder / "journal", ignore_errors=True)

    async def moves(self) -> None:
        """Wait until the robot drives, so that navigation has accepted its goal."""
        await until(lambda: self.speed > 0.5, what="the robot on its way")

    async def killed_while_pausing(self, agent: AgentProcess) -> None:
        """Kill the agent while it pauses a drive, and check that the pause finishes at standstill."""
        self.fleet.instant(action("p", "NONE", "startPause"))
        await self.fleet.state(lambda state: status_of(state, "p") == "RUNNING")
        agent.kill()
        agent.restart()
        stopped = await self.fleet.state(lambda state: status_of(state, "p") == "FINISHED")
        assert await self.speed_at(stopped) == 0.0

    def fault(self, kind: str, **fields: Any) -> None:
        """Start a fault of the robot, or end it (``active=False``)."""
        self._faults = self._faults or publisher_to(self.ros, String, "simulator/fault")
        self._faults.publish(String(data=json.dumps({"kind": kind, **fields})))

    def settings(self, *, ros: dict[str, Any] | None = None, **changes: Any) -> EdgeAgentSettings:
        """Return the agent's settings."""
        values = {"domain_id": self.domain_id, **ROS, **(ros or {})}
        return agent_settings(
            self._broker,
            self._interface_name,
            self._folder / "journal",
            driver="nav2",
            ros=values,
            version=self._version,
            **changes,
        )

    def agent_process(self, *options: str) -> AgentProcess:
        """Start the agent in a separate process, with more settings."""
        domain = ("--ros.domain_id", str(self.domain_id), "--ros.watch_period", "0.1")
        folder = self._folder / "journal"
        return AgentProcess(self._broker, self._interface_name, folder, *domain, *options, driver="nav2")

    @asynccontextmanager
    async def agent(
        self, *, ros: dict[str, Any] | None = None, **changes: Any
    ) -> AsyncIterator[FleetControl]:
        """Run the agent; yield fleet control once the robot has sent a state."""
        async with running_agent(self.settings(ros=ros, **changes)):
            await self.fleet.state()
            yield self.fleet

    @asynccontextmanager
    async def robot(
        self, *, ros: dict[str, Any] | None = None, time_factor: float = 5.0, **changes: Any
    ) -> AsyncIterator[FleetControl]:
        """Run the simulator and the agent; yield fleet control once the robot can accept an order."""
        with self.simulator(time_factor=time_factor):
            async with self.agent(ros=ros, **changes) as fleet:
                await fleet.state(ready)
                self.fault("stuck", active=False)  # makes the publisher, so that the next one takes no time
                yield fleet


def stamp_of(message: Odometry) -> float:
    """Return the message's timestamp, UTC in s."""
    return float(message.header.stamp.sec + message.header.stamp.nanosec / 1e9)


def ready(state: dict[str, Any]) -> bool:
    """Return whether a robot is localised and has no error."""
    position = state.get("agvPosition") or state.get("mobileRobotPosition") or {}
    known = position.get("positionInitialized") or position.get("localized")
    return not state["errors"] and bool(known)


def failure_of(state: dict[str, Any]) -> str | None:
    """Return why the drive to a node has failed."""
    for error in state["errors"]:
        if error["errorType"] == "nodeUnreachable":
            references = {each["referenceKey"]: each["referenceValue"] for each in error["errorReferences"]}
            return str(references.get("failure"))
    return None
