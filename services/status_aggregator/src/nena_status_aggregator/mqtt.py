"""MQTT subscriptions: decodes the messages of robots and order service and feeds the fleet model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from secrets import token_hex
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from nena_shared.clock import Clock
from nena_shared.fleet_api.epoch import EpochFilter
from nena_shared.fleet_api.peripherals import PeripheralStatus
from nena_shared.fleet_api.plant import PAYLOAD_LIMIT, MapImage
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink
from nena_shared.plant import Vehicle
from nena_shared.plant.model import PlantModel
from nena_shared.rate_limit import MessageRate
from nena_shared.settings import TopicPrefix
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.deviations import Deviations
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError, problems_of
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.robot_sources import RobotSources
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import DEFAULT_MANUFACTURER, RobotKey, Topic, TopicScheme
from nena_shared.vda5050.visualization import Visualization
from nena_status_aggregator.fleet import messages
from nena_status_aggregator.fleet.messages import NO_TIME, MessageKind, Verdict
from nena_status_aggregator.fleet.model import FleetModel
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.settings import AggregatorSettings, Share

log = get_logger(__name__)

PROBLEM_LIMIT = 1000
"""Maximum number of topics with a remembered problem; repeated problems are logged once."""

TOPIC_LENGTH = 300
"""Maximum length of a topic in memory and log, characters."""

SCHEMES_LIMIT = 100
"""Maximum number of subscribed pairs of interface name and major version."""

RETAINED = (MessageKind.CONNECTION, MessageKind.FACTSHEET)

UNDATED_REMEMBERED = 10_000
"""Maximum number of topics with unreadable timestamps whose headerIds are remembered."""

LIMITS_LOGGED_EVERY = 60.0
"""Minimum interval between log lines about robots and orders beyond the limits, seconds."""

KEY_LENGTH = 200
"""Maximum length of manufacturer and serial number together, characters."""

M = TypeVar("M", Connection, State, Visualization, Factsheet)
Take = Callable[[RobotKey, M, Timestamp], None]
"""Passes a robot's message on to the model; the last argument is the MQTT message it was read from."""


class FleetSubscriber:
    """Feeds the fleet model from MQTT. Unreadable messages are counted and logged, never fatal."""

    def __init__(self, settings: AggregatorSettings, model: FleetModel, clock: Clock) -> None:
        self._model = model
        self._clock = clock
        self._share = Share.read(settings.share)
        self._schemes: set[TopicScheme] = set()
        self._fleet_topics = FleetTopics(settings.topic_prefix)
        self._epochs = EpochFilter()
        self._problems: dict[str, str] = {}
        self._rate = MessageRate(settings.messages_per_second, settings.messages_burst)
        self._sources = RobotSources()
        self._deviations = Deviations(clock)
        model.statistics.repaired = self._deviations.totals
        self._repaired = False
        """Whether the last message had to be repaired."""
        self._undated: dict[tuple[RobotKey, MessageKind], messages.Sequence] = {}
        """headerIds of topics with unreadable timestamps."""
        self._left_out = (0, 0)
        """Number of ignored messages of robots beyond the limit, and of removed open orders, when logged."""
        self._limits_due = -LIMITS_LOGGED_EVERY
        self._reader = MessageReader(self._on_repaired, strict=settings.strict)
        self.mqtt = MqttLink(
            settings.mqtt,
            # several aggregators may use one broker; client IDs must be unique
            client_id=f"nena-status-aggregator-{token_hex(4)}",
            hooks=LinkHooks(on_lost=self._on_connection_lost),
        )
        self._own_schemes = schemes(settings)
        self._subscribe_robots(self._own_schemes)
        self._subscribe_fleet()

    async def run(self) -> None:
        """Stay connected to the broker until cancelled."""
        await self.mqtt.run()

    def report_connection(self) -> None:
        """Report to the model that the broker connection and all subscriptions are established."""
        if self.mqtt.state.connected and not self._model.link_up:
            self._model.on_link(connected=True, at=Timestamp.of(self._clock))

    def read_postponed(self) -> None:
        """Read the last messages of robots that had sent too many, once their limit allows."""
        self._rate.read_postponed(self._clock.monotonic())

    def report_limits(self) -> None:
        """Log, at most once a minute, that limits leave out robots or open orders."""
        limits, time_s = self._model.limits, self._clock.monotonic()
        if time_s < self._limits_due:
            return
        refused, forgotten = sum(self._model.statistics.refused.values()), self._model.orders.open_removed
        logged = self._left_out
        if (refused, forgotten) == logged:
            return
        self._left_out, self._limits_due = (refused, forgotten), time_s + LIMITS_LOGGED_EVERY
        if refused > logged[0]:
            log.error(
                "more robots than robots_limit; panel and metrics lack the others",
                limit=limits.robots,
                messages_ignored=refused - logged[0],
            )
        if forgotten > logged[1]:
            log.error(
                "more open orders than open_orders_limit; panel and metrics lack some of them",
                limit=max(limits.orders, limits.open_orders),
                orders_removed=forgotten - logged[1],
            )

    def _subscribe_robots(self, schemes: Iterable[TopicScheme]) -> None:
        """Subscribe to all robots below these topics, unless already subscribed."""
        model = self._model
        for scheme in schemes:
            if scheme in self._schemes:
                continue
            if len(self._schemes) >= SCHEMES_LIMIT:
                log.error(
                    "too many interface names; robots of the remaining ones are not monitored",
                    limit=SCHEMES_LIMIT,
                )
                return
            self._schemes.add(scheme)
            kept = partial(model.on_state, retained=True)
            self._subscribe_topic(scheme, MessageKind.CONNECTION, Connection, model.on_connection)
            self._subscribe_topic(scheme, MessageKind.STATE, State, model.on_state, kept)
            self._subscribe_topic(scheme, MessageKind.VISUALIZATION, Visualization, model.on_visualization)
            self._subscribe_topic(scheme, MessageKind.FACTSHEET, Factsheet, model.on_factsheet)

    def _subscribe_fleet(self) -> None:
        fleet = self._fleet_topics
        for topic_filter, kind, take in (
            (fleet.plant_model, MessageKind.PLANT_MODEL, self._read_plant_model),
            (fleet.all_vehicle_statuses, MessageKind.VEHICLE_STATUS, self._read_vehicle_status),
            (fleet.all_order_statuses, MessageKind.ORDER_STATUS, self._read_order_status),
            (
                fleet.all_peripherals(PeripheralTopic.STATUS),
                MessageKind.PERIPHERAL_STATUS,
                self._read_peripheral_status,
            ),
            (fleet.service_status, MessageKind.SERVICE_STATUS, self._read_service_status),
            (fleet.all_robot_maps, MessageKind.ROBOT_MAP, self._read_robot_map),
        ):
            self.mqtt.subscribe(topic_filter, partial(self._on_fleet_message, kind, take))

    def _subscribe_topic(
        self,
        scheme: TopicScheme,
        kind: MessageKind,
        form: type[M],
        take: Take[M],
        take_retained: Take[M] | None = None,
    ) -> None:
        """Subscribe to a topic of all robots; ``take`` receives each valid message of an accepted source."""

        def handle_message(inbound: Inbound) -> None:
            key = scheme.robot_of(inbound.topic)
            if key is None or not self._share.has(key):
                return
            if not inbound.payload and kind in RETAINED:
                return  # clears the retained message
            at = Timestamp.of(self._clock)
            if len(str(key)) > KEY_LENGTH:
                self._count_malformed(
                    kind,
                    inbound.topic,
                    f"manufacturer and serial number exceed {KEY_LENGTH} characters",
                    at,
                    None,
                )
                return
            if self._has_too_many(kind, inbound, at, partial(handle_message, inbound)):
                return
            self._repaired = False
            try:
                message = self._reader.read(form, inbound.topic, inbound.payload, scheme.major_version, key)
            except MalformedMessageError as error:
                self._count_malformed(
                    kind, inbound.topic, _summarise_problems(error.quoted_problems), at, key
                )
                self._read_sighting(kind, key, inbound, scheme)
                return
            if not self._is_next(key, kind, message.header_id, inbound.payload, at):
                return
            # What a robot left at the broker below an earlier version or interface name is outdated.
            if self._sources.accepts(key, scheme, message, retained=inbound.retained):
                (take_retained if take_retained and inbound.retained else take)(key, message, at)
                self._model.on_source(key, scheme, message.version)
                if self._repaired:
                    self._model.on_deviations(key, self._deviations.of(key))

        self.mqtt.subscribe(scheme.for_all(Topic(kind)), handle_message)

    def _has_too_many(
        self, kind: MessageKind, inbound: Inbound, at: Timestamp, read: Callable[[], None]
    ) -> bool:
        """Count a message that is beyond the limit of its robot; ``read`` reads it again."""
        if not self._rate.exceeded(inbound.topic, len(inbound.payload), at.monotonic, read=read):
            return False
        self._model.statistics.too_many[kind] += 1
        return True

    def _on_repaired(self, topic: str, repairs: tuple[Repair, ...]) -> None:
        robots = (scheme.robot_of(topic) for scheme in self._schemes)
        self._deviations.note(next(filter(None, robots)), topic.rpartition("/")[2], repairs)
        self._repaired = True

    def _is_next(
        self, key: RobotKey, kind: MessageKind, header_id: int, payload: bytes, at: Timestamp
    ) -> bool:
        """Return False for an old message with an unreadable timestamp, judging by its headerId."""
        # A last will has the header of its CONNECT, so connection messages are never late.
        if not self._reader.undated or kind is MessageKind.CONNECTION:
            return True
        # The time of arrival, which replaces the timestamp, would make an old message look new.
        if len(self._undated) >= UNDATED_REMEMBERED:
            self._undated.clear()
        sequence = self._undated.setdefault((key, kind), messages.Sequence())
        if sequence.assess_message(header_id, NO_TIME, payload) is Verdict.NEW:
            return True
        self._model.on_ignored(key, kind, f"headerId {header_id}", at)
        return False

    def _on_connection_lost(self) -> None:
        # Restoring a backup of the order service may have lowered its epoch meanwhile.
        self._epochs.reset()
        self._model.on_link(connected=False, at=Timestamp.of(self._clock))

    def _on_fleet_message(
        self, kind: MessageKind, take: Callable[[Inbound, Timestamp], None], inbound: Inbound
    ) -> None:
        at = Timestamp.of(self._clock)
        try:
            take(inbound, at)
        except ValidationError as error:
            self._count_malformed(kind, inbound.topic, _summarise_problems(problems_of(error)), at, None)

    def _read_sighting(self, kind: MessageKind, key: RobotKey, inbound: Inbound, scheme: TopicScheme) -> None:
        # An unreadable state may still have a position: a moving robot should not stand still on the map.
        if kind is not MessageKind.STATE:
            return
        sighting = self._reader.sighting(inbound.topic, inbound.payload, scheme.major_version)
        if sighting:
            self._model.on_sighting(key, sighting)

    def _read_robot_map(self, inbound: Inbound, at: Timestamp) -> None:
        key = self._fleet_topics.robot_of_map(inbound.topic)
        if key is None or not self._share.has(key) or len(str(key)) > KEY_LENGTH:
            return
        again = partial(self._on_fleet_message, MessageKind.ROBOT_MAP, self._read_robot_map, inbound)
        if self._has_too_many(MessageKind.ROBOT_MAP, inbound, at, again):
            return
        if len(inbound.payload) > PAYLOAD_LIMIT:
            problem = f"map of {len(inbound.payload)} bytes exceeds the limit of {PAYLOAD_LIMIT}"
            self._count_malformed(MessageKind.ROBOT_MAP, inbound.topic, problem, at, key)
            return
        image = MapImage.model_validate_json(inbound.payload) if inbound.payload else None
        self._model.on_robot_map(key, image, at)

    def _read_plant_model(self, inbound: Inbound, _at: Timestamp) -> None:
        plant = PlantModel.from_json(inbound.payload) if inbound.payload else None
        self._model.on_plant_model(plant)
        self._reader.know_plant(plant.only_map() if plant else "", plant.points_by_name if plant else ())
        if plant:
            self._subscribe_robots(schemes_of(plant.vehicles))
            self._subscribe_by_name(plant.vehicles)

    def _subscribe_by_name(self, vehicles: Iterable[Vehicle]) -> None:
        """Subscribe to what robots retain by its name: RabbitMQ delivers it to no wildcard subscription."""
        for vehicle in vehicles:
            robot = _robot_of(vehicle)
            for scheme in schemes_of([vehicle]) or self._own_schemes:
                for topic in (Topic.CONNECTION, Topic.FACTSHEET):
                    self.mqtt.subscribe_by_name(scheme.of(robot, topic))

    def _read_vehicle_status(self, inbound: Inbound, at: Timestamp) -> None:
        if not inbound.payload or not self._epochs.is_current(inbound.payload):
            return
        status = VehicleStatus.model_validate_json(inbound.payload)
        if self._share.has(RobotKey(status.manufacturer, status.serial_number)):
            self._model.on_vehicle_status(status, at)
        else:
            self._model.on_vehicle_elsewhere(status)

    def _read_service_status(self, inbound: Inbound, at: Timestamp) -> None:
        if not inbound.payload:
            self._model.order_service.forget_status()
        elif self._epochs.is_current(inbound.payload):
            status = ServiceStatus.model_validate_json(inbound.payload)
            self._model.on_service_status(status, at, retained=inbound.retained)

    def _read_order_status(self, inbound: Inbound, at: Timestamp) -> None:
        if not self._epochs.is_current(inbound.payload):
            return
        if inbound.payload:
            self._model.on_order_status(TransportOrderStatus.model_validate_json(inbound.payload), at)
        else:
            self._model.on_order_cleared(self._fleet_topics.name_in(inbound.topic))

    def _read_peripheral_status(self, inbound: Inbound, at: Timestamp) -> None:
        if not self._epochs.is_current(inbound.payload):
            return
        if not inbound.payload:
            self._model.on_peripheral_cleared(self._fleet_topics.name_in(inbound.topic))
        elif not self._model.on_peripheral_status(PeripheralStatus.model_validate_json(inbound.payload)):
            problem = f"more than {self._model.limits.peripherals} devices; this one is not shown"
            self._count_malformed(MessageKind.PERIPHERAL_STATUS, inbound.topic, problem, at, None)

    def _count_malformed(
        self, kind: MessageKind, topic: str, problem: str, at: Timestamp, key: RobotKey | None
    ) -> None:
        topic = topic[:TOPIC_LENGTH]
        self._model.on_malformed(kind, topic, problem, at, key=key)
        if self._problems.get(topic) == problem:
            return
        if len(self._problems) >= PROBLEM_LIMIT:  # costs repeated log lines, no memory
            self._problems.clear()
        self._problems[topic] = problem
        log.warning("unreadable message", topic=topic, robot=str(key) if key else None, problem=problem)


def _summarise_problems(problems: Sequence[str]) -> str:
    """Return the first problem and the number of further ones."""
    more = len(problems) - 1
    return f"{problems[0]} (and {more} more)" if more else problems[0]


def schemes(settings: AggregatorSettings) -> tuple[TopicScheme, ...]:
    """Return the topic schemes of all major versions."""
    return TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")


def schemes_of(vehicles: Iterable[Vehicle]) -> tuple[TopicScheme, ...]:
    """Return the topic schemes of the vehicles' prefixes and interface names; invalid ones are skipped."""
    found: dict[TopicScheme, None] = {}
    for vehicle in vehicles:
        if (prefix := vehicle.topic_prefix) and _is_prefix(prefix):
            found[TopicScheme.below(prefix, vehicle.protocol_version, _robot_of(vehicle))] = None
        elif (name := vehicle.interface_name) and _is_prefix(name):
            found |= dict.fromkeys(TopicScheme(name, major) for major in ("v2", "v3"))
    return tuple(found)


def _robot_of(vehicle: Vehicle) -> RobotKey:
    return RobotKey(vehicle.manufacturer or DEFAULT_MANUFACTURER, vehicle.serial_number or vehicle.name)


def _is_prefix(name: str) -> bool:
    try:
        TypeAdapter(TopicPrefix).validate_python(name)
    except ValidationError:
        return False
    return True
