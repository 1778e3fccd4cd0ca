"""Fleet control's real core and robots, with time compressed: what passes between them is late, or lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import chain, count
from random import Random

from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outputs import FleetOutput, PublishInstantActions, PublishOrder
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.fleet import hand_over
from support.traffic.driving_robot import DrivingRobot

LONGEST_DELAY = 0.4
"""Seconds that a message is active at most."""

LOSS = 0.01
"""The share of messages that are lost."""


@dataclass
class Timeline:
    """What is to happen when, in seconds."""

    clock: ManualClock = field(default_factory=ManualClock)
    events: list[tuple[float, int, Callable[[], None]]] = field(default_factory=list)
    numbers: count[int] = field(default_factory=count)

    def after(self, seconds: float, event: Callable[[], None]) -> None:
        """Schedule an event."""
        heappush(self.events, (self.clock.seconds + seconds, next(self.numbers), event))

    def step(self) -> None:
        """Run the next event."""
        at, _, event = heappop(self.events)
        self.clock.seconds = max(at, self.clock.seconds)
        event()


class Wire:
    """Brings messages in the order in which they were sent, some of them not at all."""

    def __init__(self, timeline: Timeline, random: Random) -> None:
        self._timeline = timeline
        self._random = random
        self._last: dict[object, float] = {}

    def bring(self, line: object, message: Callable[[], None]) -> None:
        """Bring a message on one of the lines."""
        if self._random.random() < LOSS:
            return
        now = self._timeline.clock.seconds
        at = max(self._last.get(line, 0.0), now + self._random.uniform(0.01, LONGEST_DELAY))
        self._last[line] = at
        self._timeline.after(at - now, message)


class CoreFleet:
    """The engine's fleet control without a broker; a new one is made for each life of the engine."""

    def __init__(self, timeline: Timeline, wire: Wire, robots: dict[RobotKey, DrivingRobot]) -> None:
        self.core = FleetController(FleetSettings())
        self.engine: Engine | None = None
        self.alive = True
        self.on_message: Callable[[DrivingRobot], None] = lambda _robot: None
        self.away: set[RobotKey] = set()
        self._timeline = timeline
        self._wire = wire
        self._robots = robots

    @property
    def now(self) -> float:
        return self._timeline.clock.seconds

    def connect(self) -> None:
        """Connect to the broker, which reports the connected robots."""
        self.core.on_broker(connected=True, now=self.now)
        self.tick()
        for robot in self._robots.values():
            self._take(self.core.on_factsheet(robot.key, robot.factsheet(), self.now))
            away = robot.key in self.away
            self.tell_connection(robot, ConnectionState.CONNECTION_BROKEN if away else ConnectionState.ONLINE)

    def tell_connection(self, robot: DrivingRobot, state: ConnectionState) -> None:
        message = robot.connection(state, self.now)
        self._take(self.core.on_connection(robot.key, message, self.now))

    def report(self, robot: DrivingRobot) -> None:
        """Deliver a robot's state."""
        state = robot.state(self.now)
        if robot.key not in self.away:
            self._wire.bring(("state", robot.key), lambda: self._heard(robot, state))

    def tick(self) -> None:
        self._take(tuple(chain.from_iterable(self.core.tick(self.now))))

    def _heard(self, robot: DrivingRobot, state: object) -> None:
        if self.alive and robot.key not in self.away:
            self._take(self.core.on_state(robot.key, state, self.now))  # type: ignore[arg-type] # see report

    def _take(self, outputs: Iterable[FleetOutput]) -> None:
        outputs = tuple(outputs)
        news = [each for each in outputs if not isinstance(each, PublishOrder | PublishInstantActions)]
        for output in outputs:
            if isinstance(output, PublishOrder | PublishInstantActions):
                self._send(output)
        if news and self.engine and self.alive:
            self.engine.on_events(*news)

    def _send(self, output: PublishOrder | PublishInstantActions) -> None:
        robot = self._robots[output.robot]

        def arrives() -> None:
            if robot.key not in self.away:
                hand_over(output, robot)
                self.on_message(robot)

        self._wire.bring(("order", robot.key), arrives)

    def start_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        self._take(self.core.control(robot).start_order(vda_order, self.now))

    def adopt_vda_order(
        self, robot: RobotKey, vda_order: VdaOrder, *, accepted: bool, update_id: int = 0
    ) -> None:
        control = self.core.control(robot)
        self._take(control.adopt_order(vda_order, self.now, accepted=accepted, update_id=update_id))

    def extend_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        self._take(self.core.control(robot).extend_order(vda_order, self.now))

    def release_base(self, robot: RobotKey, order_id: str, sequence_id: int | None) -> None:
        self._take(self.core.control(robot).release_base(order_id, sequence_id, self.now))

    def cancel_vda_order(self, robot: RobotKey) -> None:
        self._take(self.core.control(robot).cancel_order(self.now))

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        self._take(self.core.control(robot).send_instant_action(action, self.now))

    def all_known(self) -> bool:
        return self.core.all_known(self.now)

    def connected_for(self) -> float:
        return self.core.connected_for(self.now)

    def view(self, robot: RobotKey) -> RobotView:
        return self.core.view(robot, self.now)
