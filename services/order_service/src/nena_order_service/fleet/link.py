"""Fleet control's shell over MQTT: reads what robots say, sends what the core decides, hands its news on."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from functools import partial
from typing import Final, TypeVar

from pydantic import ValidationError

from nena_order_service.fleet.addresses import KEY_LENGTH, RobotAddresses
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outgoing import Outgoing
from nena_order_service.fleet.outputs import FleetOutput, Outputs, Publish, PublishZoneSet
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.tasks import forever
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.deviations import Deviations
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import nearest_codec
from nena_shared.vda5050.zone_set import ZoneSet

log = get_logger(__name__)

M = TypeVar("M", Connection, Factsheet, State)
Take = Callable[[RobotKey, M, float], Outputs]

MALFORMED_LOGGED_EACH: Final = 100
"""Of a robot's malformed messages the first and then each of so many is logged."""

_PLURALS: Final = {Topic.STATE.value: "states", Topic.CONNECTION.value: "connection messages"}
"""Messages without which a robot cannot be given orders."""

LOGGED_OF_NAME: Final = 60
"""Characters of a name that is too long."""


class FleetLink:
    """Couples a :class:`FleetController` with the broker; every method is for the event loop's thread.

    ``on_news`` gets the outputs of the core but the messages to send, in order, all of a call at once and
    within that call; it may call this object again. What goes out never waits for the broker: the core sends
    again what no state echoes.
    """

    def __init__(
        self,
        mqtt: MqttLink,
        *,
        addresses: RobotAddresses,
        settings: FleetSettings,
        clock: Clock,
        on_news: Callable[[*tuple[FleetOutput, ...]], None],
    ) -> None:
        self._mqtt = mqtt
        self._addresses = addresses
        self._settings = settings
        self._clock = clock
        self._on_news = on_news
        self._controller = FleetController(settings, utc_now=clock.now)
        self._outgoing = Outgoing(clock)
        self._connected = False
        self._term = 0
        self.malformed = 0
        """How many messages could not be read."""
        self.ignored = 0
        """How many messages came from robots beyond the limit of robots."""
        self.too_long = 0
        """How many messages came from robots whose names are longer than the store can hold."""
        self.deviations = Deviations(clock)
        """What had to be repaired in the robots' messages."""
        self._reader = MessageReader(self._note_repairs, strict=settings.strict)
        self._hear(Topic.CONNECTION, Connection, self._controller.on_connection, qos=1)
        self._hear(Topic.FACTSHEET, Factsheet, self._controller.on_factsheet, qos=settings.qos)
        self._hear(Topic.STATE, State, self._controller.on_state, qos=settings.qos)

    async def run(self) -> None:
        """Look after what is overdue, until cancelled."""
        await forever("fleet control", self._look)

    def start_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """See :meth:`FleetController.start_vda_order`; the same holds for the following methods."""
        self._hand_out(self._controller.start_vda_order(robot, vda_order, self._now()))

    def adopt_vda_order(
        self, robot: RobotKey, vda_order: VdaOrder, *, accepted: bool, update_id: int = 0
    ) -> None:
        """See :meth:`FleetController.adopt_vda_order`."""
        self._hand_out(
            self._controller.adopt_vda_order(
                robot, vda_order, self._now(), accepted=accepted, update_id=update_id
            )
        )

    def extend_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """See :meth:`FleetController.extend_vda_order`."""
        self._hand_out(self._controller.extend_vda_order(robot, vda_order, self._now()))

    def cancel_vda_order(self, robot: RobotKey) -> None:
        """See :meth:`FleetController.cancel_vda_order`."""
        self._hand_out(self._controller.cancel_vda_order(robot, self._now()))

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        """See :meth:`FleetController.instant_action`."""
        self._hand_out(self._controller.instant_action(robot, action, self._now()))

    def send_zone_set(self, robot: RobotKey, zone_set: ZoneSet) -> None:
        """Bring a robot a zone set; its states show whether it has taken it (section 6.4)."""
        self._publish(PublishZoneSet(robot, zone_set))

    def all_known(self) -> bool:
        """See :meth:`FleetController.all_known`."""
        return self._controller.all_known(self._now())

    def connected_for(self) -> float:
        """See :meth:`FleetController.connected_for`."""
        return self._controller.connected_for(self._now())

    def view(self, robot: RobotKey) -> RobotView:
        """See :meth:`FleetController.view`."""
        return self._controller.view(robot, self._now())

    def robots(self) -> tuple[RobotKey, ...]:
        """See :meth:`FleetController.robots`."""
        return self._controller.robots()

    async def _look(self) -> None:
        await asyncio.sleep(self._settings.tick_interval)
        self._notice_broker()
        self._hand_out(self._controller.tick(self._now()))

    def _notice_broker(self) -> None:
        """Tell the core when our own link has come or gone; a message that comes shows it, too.

        In a new term of leadership robots are sent nothing before they have reported: what is known of them
        may be from before another order service had the lead.
        """
        link = self._mqtt.state
        unread = link.connected and link.term != self._term
        if link.connected is self._connected and not unread:
            return
        self._connected = link.connected
        if link.connected:
            self._term = link.term
        self._hand_out(self._controller.on_broker(connected=link.connected, now=self._now(), unread=unread))

    def _hear(self, topic: Topic, kind: type[M], take: Take[M], *, qos: int) -> None:
        """Subscribe to a topic of all robots; ``take`` gets what is well-formed and says something of now."""

        def handle(scheme: TopicScheme, inbound: Inbound) -> None:
            read = self._read(kind, scheme, inbound)
            if read:
                self._hand_out(take(*read, self._now()))

        for scheme in self._addresses.schemes:
            self._mqtt.subscribe(scheme.for_all(topic), partial(handle, scheme), qos=qos)

    def _read(self, kind: type[M], scheme: TopicScheme, inbound: Inbound) -> tuple[RobotKey, M] | None:
        """Read a message; one that is malformed, outdated or from a robot too many is passed over."""
        self._notice_broker()
        robot = scheme.robot_of(inbound.topic)
        if robot is None:
            return None
        if len(str(robot)) > KEY_LENGTH:
            self._note_long_name(robot)
            return None
        if not self._controller.has_room_for(robot):
            self.ignored += 1
            return None
        try:
            message = self._reader.read(kind, inbound.topic, inbound.payload, scheme.major_version)
        except MalformedMessageError as error:
            self._note_malformed(robot, inbound.topic, error)
            return None
        codec = nearest_codec(message.version)
        assert codec, "the reader took one of its major version"  # noqa: S101 - for the type
        now = self._addresses.learn(robot, codec, scheme, message, retained=inbound.retained)
        return (robot, message) if now else None

    def _note_long_name(self, robot: RobotKey) -> None:
        """Refuse a robot that cannot be stored."""
        if self.too_long % MALFORMED_LOGGED_EACH == 0:
            log.warning(
                "a robot is not listened to: manufacturer and serial number are too long",
                robot=f"{str(robot)[:LOGGED_OF_NAME]}...",
                characters=len(str(robot)),
                limit=KEY_LENGTH,
                so_far=self.too_long + 1,
            )
        self.too_long += 1

    def _note_malformed(self, robot: RobotKey, topic: str, error: MalformedMessageError) -> None:
        self.malformed += 1
        name = topic.rpartition("/")[2]
        problem = f"sends {_PLURALS[name]} that cannot be read: {error.reason}" if name in _PLURALS else None
        self._hand_out(self._controller.on_malformed(robot, problem, self._now()))
        count = self.view(robot).malformed
        if count % MALFORMED_LOGGED_EACH == 1:
            log.warning(
                "a robot's message is not valid and changes nothing",
                robot=str(robot),
                topic=topic,
                problems=error.problems,
                so_far=count,
            )

    def _note_repairs(self, topic: str, repairs: tuple[Repair, ...]) -> None:
        """Count what had to be repaired in a message; the last four levels of a topic name the robot."""
        *_, manufacturer, serial_number, name = topic.split("/")
        self.deviations.note(RobotKey(manufacturer, serial_number), name, repairs)

    def _hand_out(self, outputs: Iterable[FleetOutput]) -> None:
        news: list[FleetOutput] = []
        for output in outputs:
            if isinstance(output, Publish):
                self._publish(output)
            else:
                news.append(output)
        if news:
            self._on_news(*news)

    def _publish(self, output: Publish) -> None:
        address = self._addresses.of(output.robot)
        if address is None:
            log.warning("nothing is sent to a robot that has said nothing yet", robot=str(output.robot))
            return
        topic, message = self._outgoing.message(output, address.codec.version)
        try:
            payload = address.codec.encode(message)
        except (MalformedMessageError, ValidationError):
            log.exception("a message cannot be said to this robot", robot=str(output.robot), topic=topic)
            return
        place = address.scheme.of(output.robot, topic)
        self._mqtt.publish(Outbound(place, payload, qos=self._settings.qos, keep=False))

    def _now(self) -> float:
        return self._clock.monotonic()
