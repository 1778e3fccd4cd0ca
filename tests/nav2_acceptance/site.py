"""The Nav2 under test: its address, the positions for the checks, and how to kill its processes."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from itertools import count
from math import dist
from typing import Any

from action_msgs.srv import CancelGoal
from lifecycle_msgs.srv import GetState

from nena_shared.vda5050.order import NodePosition
from support.edge_agent import FleetControl, ended, status_of
from support.nav2_agent import ROS, Bench, ready
from support.pausing import time_passes
from support.robot_core import action, order, position
from support.waiting import PATIENCE, until

Place = tuple[float, float]
FORGIVING = 0.6
"""Allowed deviation of the nodes, metres."""

MANAGERS = ("lifecycle_manager_navigation", "lifecycle_manager_localization")
OF_LOCALISATION = ("amcl", "map_server")
"""Servers of the second lifecycle manager."""
BOND = 4.0
"""Time after which a lifecycle manager misses a process that is down, seconds.

One that is killed and back later stays unconfigured: its manager waits for the old one.
"""
RESPAWN = 20.0
"""Time within which a Nav2 that restarts by itself is active again, seconds."""
ACTIONS = ("navigate_to_pose", "navigate_through_poses", "follow_path")
NO_POSE = "no pose received"
"""Part of the error of a robot that is not localised."""


LEASE = 20.0
"""Time for which a killed process stays in the ROS graph, seconds."""
TRANSFORM = 1.5
"""Time after a new pose in which Nav2 may not have its transform yet, seconds."""
DISCOVERY = 2.0
"""Time within which a service is discovered, seconds."""


class LeftOutError(Exception):
    """A check cannot run on this Nav2; the text says what is missing."""


@dataclass(frozen=True)
class Course:
    """Positions on the map, m: the robot drives back and forth between ``start`` and ``end``.

    ``beside`` is the goal of another client. The others are unreachable; None: unknown.
    """

    start: Place
    end: Place
    beside: Place
    outside: Place | None = None
    obstacle: Place | None = None
    edge: Place | None = None

    def between(self, share: float) -> Place:
        """Return a position on the straight line, 0 at the start, 1 at the end."""
        (x0, y0), (x1, y1) = self.start, self.end
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


@dataclass
class Nav2Site:
    """A running Nav2. ``kill`` and ``revive`` are shell commands with ``{server}``; empty: not possible.

    ``pose`` becomes the initial position of a robot that is not localised, as after a simulation's start.
    """

    bench: Bench
    course: Course
    namespace: str = "/"
    kill: str = ""
    revive: str = ""
    pose: Place | None = None
    speed: float | None = None
    """Speed of its controller, m/s; None: unknown."""
    tell: Callable[[str], None] = lambda _: None
    """Receives the progress, a line at a time."""
    respawn: float = RESPAWN
    """Time for which a server that was started again may take to become active by itself, seconds."""
    _down: dict[str, float] = field(default_factory=dict)
    """When the processes were killed that have not been started again."""
    _orders: Any = field(default_factory=lambda: count(1))

    async def die(self, server: str) -> None:
        """Kill one process of Nav2.

        Raises:
            LeftOutError: there is no command for it.

        """
        self.tell(f"{server} is killed")
        await self._end(server)
        self._down[server] = time.monotonic()

    async def live(self, server: str) -> None:
        """Restart the process, and wait until it is active; raises as :meth:`die`.

        A process that was down for longer than its bond needs its lifecycle manager restarted as well.
        """
        self.tell(f"{server} is started")
        await self._start(server)
        down = time.monotonic() - self._down.pop(server, time.monotonic())
        if server in MANAGERS:
            return  # which have no lifecycle of their own
        if down >= BOND:
            try:
                await self._brought_up(server, within=self.respawn)
            except AssertionError:
                manager = MANAGERS[server in OF_LOCALISATION]
                await self.die(manager)
                await self.live(manager)
        await self._brought_up(server)

    async def _brought_up(self, server: str, *, within: float = PATIENCE) -> None:
        """Wait until a server is active."""
        name = f"{self.namespace.rstrip('/')}/{server}/get_state"
        client = self.bench.ros.client(GetState, name)
        await until(
            lambda: self.bench.ros.call(client, GetState.Request()).current_state.label == "active",
            timeout=within,
            what=f"{server} active",
        )

    async def _end(self, server: str) -> None:
        """Kill a process."""
        await self._run(self.kill, server)

    async def _start(self, server: str) -> None:
        """Start a process again."""
        await self._run(self.revive, server)

    async def reset(self) -> None:
        """Bring Nav2, robot and agent to a state in which a check can begin, whatever a failed one has left.

        All processes run, no goal is active, the robot stands and is localised, and no order is stored.
        """
        self.tell("robot and agent are reset")
        for server in sorted(self._down, key=MANAGERS.__contains__):  # managers last
            if server in self._down:
                await self.live(server)
        await self.open_up()
        self._cancel_goals()
        await self.stands()
        self.bench.forget()
        async with self.agent():
            await time_passes(TRANSFORM)

    def _cancel_goals(self) -> None:
        """Cancel all goals of Nav2."""
        for action_name in ACTIONS:
            name = f"{self.namespace.rstrip('/')}/{action_name}/_action/cancel_goal"
            client = self.bench.ros.node.create_client(CancelGoal, name)
            if client.wait_for_service(DISCOVERY):
                self.bench.ros.call(client, CancelGoal.Request())

    async def close_in(self) -> None:
        """Make ``course.obstacle`` unreachable, unless it already is."""

    async def open_up(self) -> None:
        """Undo :meth:`close_in`."""

    async def _run(self, command: str, server: str) -> None:
        if not command:
            text = "no command to kill and start a process of Nav2 (--kill, --revive)"
            raise LeftOutError(text)
        process = await asyncio.create_subprocess_shell(command.format(server=server))
        await process.wait()

    @asynccontextmanager
    async def agent(self, navigation: str = "auto", **changes: Any) -> AsyncIterator[FleetControl]:
        """Run an edge agent on this Nav2, and wait until it accepts orders."""
        ros = {**ROS, "call_timeout": 1.0, "namespace": self.namespace, "navigation": navigation}
        ros |= changes.pop("ros", {})
        begun = len(self.bench.fleet.states)
        async with self.bench.agent(ros=ros, **changes) as fleet:
            await self._located(begun)
            yield fleet

    async def _located(self, begun: int) -> None:
        """Wait until the robot accepts orders; set its last known or initial position if it needs one."""
        pose = self._last_pose or (None if self.pose is None else (*self.pose, 0.0))
        if pose is not None:
            state = await self.when(
                lambda state: ready(state) or NO_POSE in str(state["errors"]), since=begun
            )
            if not ready(state):
                await self._set_pose(*pose)
        await self.when(ready, since=begun)

    @property
    def _last_pose(self) -> tuple[float, float, float] | None:
        """Return x, y and theta of the last state with a known position."""
        told = (state.get("agvPosition") for state in reversed(self.bench.fleet.states))
        at = next((each for each in told if each and each["positionInitialized"]), None)
        return None if at is None else (at["x"], at["y"], at["theta"])

    async def when(self, accept: Any, *, since: int, within: float = PATIENCE) -> dict[str, Any]:
        """Wait for a state after the first ``since`` for which ``accept`` is true."""
        fleet = self.bench.fleet
        return await until(
            lambda: next((each for each in fleet.states[since:] if accept(each)), None),
            timeout=within,
            what=lambda: f"a state as expected; the last is {fleet.states[-1:]}; this",
        )

    @property
    def here(self) -> Place:
        """Return the robot's reported position."""
        found = self.bench.fleet.states[-1]["agvPosition"]
        return found["x"], found["y"]

    @property
    def far(self) -> Place:
        """Return the end of the course that is farther from the robot."""
        return max(self.course.start, self.course.end, key=lambda place: dist(place, self.here))

    def send(self, *places: Place, radius: float = FORGIVING, horizon: int = 0) -> str:
        """Send an order from the robot's position over ``places``; return its ID.

        The last ``horizon`` of them are not released.
        """
        order_id = f"nav2-{next(self._orders)}"
        nodes = {"n0": self.node(self.here, 2.0)}
        nodes |= {f"n{index}": self.node(place, radius) for index, place in enumerate(places, 1)}
        released = len(nodes) - horizon
        self.bench.fleet.send(order(*nodes, order_id=order_id, positions=nodes, released=released))
        return order_id

    def extend(self, order_id: str, way: Sequence[Place], *, radius: float) -> None:
        """Release the last position of ``way``; the order already has all others."""
        last = len(way)
        nodes = {f"n{index}": self.node(way[index - 1], radius) for index in (last - 1, last)}
        first = 2 * (last - 1)
        self.bench.fleet.send(order(*nodes, order_id=order_id, update=1, first=first, positions=nodes))

    @staticmethod
    def node(place: Place, radius: float) -> NodePosition:
        return position(*place, radius=radius)

    def over(self) -> tuple[Place, ...]:
        """Return the positions from the robot to the far end."""
        shares = (0.33, 0.67, 1.0)
        if self.far == self.course.start:
            return tuple(self.course.between(1.0 - each) for each in shares)
        return tuple(self.course.between(each) for each in shares)

    async def done(self, order_id: str, *, within: float = 120.0) -> dict[str, Any]:
        """Wait for the end of an order."""
        return await self.when(ended(order_id), since=0, within=within)

    async def moves(self) -> None:
        await until(lambda: self.bench.speed > 0.1, what="the robot driving")

    async def stands(self) -> None:
        await until(lambda: self.bench.speed < 0.01, what="standstill")

    async def instant(self, action_type: str, **parameters: Any) -> dict[str, Any]:
        """Send an instant action and wait for its end."""
        action_id = f"i{next(self._orders)}"
        self.bench.fleet.instant(action(action_id, "NONE", action_type, **parameters))
        return await self.when(lambda state: status_of(state, action_id) in ("FINISHED", "FAILED"), since=0)

    async def put_back(self) -> dict[str, Any]:
        """Set the robot's last known pose in the localisation."""
        pose = self._last_pose
        assert pose is not None, "no state had a known position"
        return await self._set_pose(*pose)

    async def _set_pose(self, x: float, y: float, theta: float) -> dict[str, Any]:
        return await self.instant("initPosition", x=x, y=y, theta=theta, mapId="hall", lastNodeId="n0")


class SimulatedSite(Nav2Site):
    """The robot simulator; its faults kill and restart processes."""

    async def _end(self, server: str) -> None:
        self.bench.fault("server_died", server=server, lease=LEASE)

    async def _start(self, server: str) -> None:
        self.bench.fault("server_died", server=server, active=False)

    async def close_in(self) -> None:
        if self.course.obstacle is not None:
            x, y = self.course.obstacle
            self.bench.fault("unreachable", circles=[{"x": x, "y": y, "radius": 0.5}], error_code=208)

    async def open_up(self) -> None:
        self.bench.fault("unreachable", active=False)
