"""An honest robot, and fleet control, each at a real broker with a separate link."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.link import FleetLink, RobotAddresses
from nena_order_service.fleet.outputs import BrokerLinkChanged, FleetOutput, RobotChanged
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.clock import SystemClock
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound, Term, always
from nena_shared.plant import Vehicle
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.broker import BrokerAddress
from support.waiting import until

QUICK = FleetSettings(
    silent_after=2.0, resend_after=0.1, resend_at_most_after=0.4, sendings=5, tick_interval=0.02
)
"""Fleet control that soon says of a robot that it is silent, and of a message that it is lost."""
PATIENT = FleetSettings(resend_after=60.0, resend_at_most_after=60.0, tick_interval=0.02)
"""Fleet control on a slow machine, where nothing is lost."""


class WiredRobot:
    """Accepts orders from the broker, and reports after each step."""

    def __init__(
        self,
        broker: BrokerAddress,
        interface_name: str,
        robot: HonestRobot | None = None,
        version: str = "2.1.0",
    ) -> None:
        self.robot = robot or HonestRobot()
        self.codec = codec_for(version)
        self.scheme = TopicScheme(interface_name, self.codec.major_version)
        self.tells_factsheet = True
        """Whether it tells its factsheet at each connect."""
        self.deaf = False
        """Whether orders and instant actions pass it by."""
        self.silent = False
        """Whether its states are lost."""
        self.received: Counter[str] = Counter()
        self.headers: list[int] = []
        self.link = MqttLink(
            broker.settings,
            client_id=f"robot-{interface_name}-{self.robot.key.serial_number}",
            hooks=LinkHooks(
                will=lambda: self._connection(ConnectionState.CONNECTION_BROKEN),
                on_connected=lambda: [self._connection(ConnectionState.ONLINE), *self._factsheet()],
            ),
        )
        self.link.subscribe(self.scheme.of(self.robot.key, Topic.ORDER), self._take_order)
        self.link.subscribe(self.scheme.of(self.robot.key, Topic.INSTANT_ACTIONS), self._take_actions)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[WiredRobot]:
        """Connect to the broker; at the end of the block the connection breaks, without DISCONNECT."""
        task = asyncio.create_task(self.link.run(), name="robot under test")
        try:
            await until(lambda: self.link.state.connected, what="the robot's connection")
            self.report()
            yield self
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def report(self) -> None:
        if self.silent:
            return
        seconds = asyncio.get_running_loop().time()
        payload = self.codec.encode(self.robot.state(seconds))
        self.link.publish(Outbound(self.scheme.of(self.robot.key, Topic.STATE), payload, keep=False))

    def step(self) -> None:
        self.robot.step()
        self.report()

    def say(self, topic: Topic, payload: bytes) -> None:
        self.link.publish(Outbound(self.scheme.of(self.robot.key, topic), payload))

    def _connection(self, state: ConnectionState) -> Outbound:
        payload = self.codec.encode(self.robot.connection(state))
        return Outbound(self.scheme.of(self.robot.key, Topic.CONNECTION), payload, qos=1, retain=True)

    def _factsheet(self) -> Iterator[Outbound]:
        if self.tells_factsheet:
            payload = self.codec.encode(self.robot.factsheet())
            yield Outbound(self.scheme.of(self.robot.key, Topic.FACTSHEET), payload, retain=True)

    def _take_order(self, inbound: Inbound) -> None:
        order = self.codec.decode(Order, inbound.payload)
        self.received[order.order_id] += 1
        self.headers.append(order.header_id)
        if not self.deaf:
            self.robot.take_order(order)
            self.report()

    def _take_actions(self, inbound: Inbound) -> None:
        message = self.codec.decode(InstantActions, inbound.payload)
        self.received.update(each.action_type for each in message.actions)
        if not self.deaf:
            self.robot.take_instant_actions(message)
            self.report()


class WiredFleet:
    """Fleet control at the broker, and its news."""

    def __init__(
        self,
        broker: BrokerAddress,
        interface_name: str,
        settings: FleetSettings = PATIENT,
        vehicles: Mapping[RobotKey, Vehicle] | None = None,
        term: Term = always,
    ) -> None:
        self.news: list[FleetOutput] = []
        addresses = RobotAddresses([TopicScheme(interface_name, major) for major in ("v2", "v3")])
        addresses.expect_vehicles((vehicles or {}).items())
        self.mqtt = MqttLink(broker.settings, client_id=f"fleet-{interface_name}", term=term)
        self.fleet = FleetLink(
            self.mqtt,
            addresses=addresses,
            settings=settings,
            clock=SystemClock(),
            on_events=lambda *news: self.news.extend(news),
        )

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[WiredFleet]:
        """Connect to the broker, and do what is overdue."""
        tasks = [asyncio.create_task(self.mqtt.run()), asyncio.create_task(self.fleet.run())]
        try:
            await until(lambda: self.mqtt.state.connected, what="the fleet's connection")
            yield self
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def story(self) -> list[str]:
        """Name the news of orders and actions."""
        others = (RobotChanged, BrokerLinkChanged)
        return [type(each).__name__ for each in self.news if not isinstance(each, others)]

    async def wait_for(self, name: str) -> FleetOutput:
        """Return the first news of this kind."""
        return await until(
            lambda: next((each for each in self.news if type(each).__name__ == name), None),
            what=f"{name}, told was {self.story()}",
        )
