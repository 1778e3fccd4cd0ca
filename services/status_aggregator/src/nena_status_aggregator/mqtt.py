"""The robots' topics that the aggregator reads, one scheme for each major version of VDA 5050."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from secrets import token_hex
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from nena_shared.clock import Clock
from nena_shared.fleet_api.epoch import EpochFilter
from nena_shared.fleet_api.plant import PAYLOAD_LIMIT, RobotMap, robot_of_map, topics_of_maps
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink
from nena_shared.plant import Vehicle
from nena_shared.plant.model import PlantModel
from nena_shared.settings import TopicPrefix
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.brief.reader import B, read_brief
from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError, problems_of
from nena_shared.vda5050.message_reader import Decode, MessageReader
from nena_shared.vda5050.robot_sources import RobotSources
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.model import FleetModel
from nena_status_aggregator.fleet.robot import Instant
from nena_status_aggregator.settings import AggregatorSettings, Share


def schemes(settings: AggregatorSettings) -> tuple[TopicScheme, ...]:
    """Give the topics of each major version."""
    return TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")


def schemes_of(vehicles: Iterable[Vehicle]) -> tuple[TopicScheme, ...]:
    """Give the topics that the plant model names for some of its vehicles, but for what is no topic."""
    names = dict.fromkeys(each.interface_name for each in vehicles if each.interface_name)
    return tuple(TopicScheme(name, major) for name in names if _is_prefix(name) for major in ("v2", "v3"))


def _is_prefix(name: str) -> bool:
    try:
        TypeAdapter(TopicPrefix).validate_python(name)
    except ValidationError:
        return False
    return True


log = get_logger(__name__)

PROBLEMS_REMEMBERED = 1000
"""Topics whose last problem is remembered, so that a robot that repeats itself does not fill the log."""

TOPIC_LENGTH = 300
"""Characters of a topic that are remembered and logged."""

SCHEMES_LIMIT = 100
"""Interface names and major versions that are listened to."""

KEPT_AT_THE_BROKER = (MessageKind.CONNECTION, MessageKind.FACTSHEET)

KEY_LENGTH = 200
"""Characters of manufacturer and serial number together."""

H = TypeVar("H", bound=Header)
M = TypeVar("M", Connection, StateBrief, VisualizationBrief, Factsheet)
Take = Callable[[RobotKey, M, Instant, Inbound], None]
"""Hands a robot's message to the model; the last is what it was read from."""


class FleetLink:
    """Feeds the model with what the broker delivers; what cannot be read is counted, never fatal."""

    def __init__(self, settings: AggregatorSettings, model: FleetModel, clock: Clock) -> None:
        self._model = model
        self._clock = clock
        self._share = Share.read(settings.share)
        self._schemes: set[TopicScheme] = set()
        self._fleet_topics = FleetTopics(settings.topic_prefix)
        self._epochs = EpochFilter()
        self._problems: dict[str, str] = {}
        self._sources = RobotSources()
        self._reader = MessageReader()
        self.mqtt = MqttLink(
            settings.mqtt,
            # several aggregators may watch one broker: the id must differ
            client_id=f"nena-status-aggregator-{token_hex(4)}",
            on_lost=self._lost,
        )
        self._follow_robots(schemes(settings))
        self._follow_orders()

    async def run(self) -> None:
        """Keep the link up until cancelled."""
        await self.mqtt.run()

    def notice(self) -> None:
        """Tell the model when the link stands again, subscriptions and all."""
        if self.mqtt.state.connected and not self._model.link_up:
            self._model.on_link(connected=True, at=Instant.of(self._clock))

    def _follow_robots(self, schemes: Iterable[TopicScheme]) -> None:
        """Subscribe to what all robots under these topics say, unless that is done already."""
        for scheme in schemes:
            if scheme in self._schemes:
                continue
            if len(self._schemes) >= SCHEMES_LIMIT:
                log.error("too many interface names, some robots are not seen", limit=SCHEMES_LIMIT)
                return
            self._schemes.add(scheme)
            self._hear(scheme, MessageKind.CONNECTION, _in_full(Connection), self._take_connection)
            self._hear(scheme, MessageKind.STATE, _in_brief(StateBrief), self._take_state)
            self._hear(
                scheme, MessageKind.VISUALIZATION, _in_brief(VisualizationBrief), self._take_visualization
            )
            self._hear(scheme, MessageKind.FACTSHEET, _in_full(Factsheet), self._take_factsheet)
            read_map = partial(self._read_robot_map, scheme)
            handle = partial(self._on_fleet_message, MessageKind.ROBOT_MAP, read_map)
            self.mqtt.subscribe(topics_of_maps(scheme), handle)

    def _follow_orders(self) -> None:
        fleet = self._fleet_topics
        for topic_filter, kind, take in (
            (fleet.plant_model, MessageKind.PLANT_MODEL, self._read_plant_model),
            (fleet.all_vehicle_statuses, MessageKind.VEHICLE_STATUS, self._read_vehicle_status),
            (fleet.all_order_statuses, MessageKind.ORDER_STATUS, self._read_order_status),
        ):
            self.mqtt.subscribe(topic_filter, partial(self._on_fleet_message, kind, take))

    def _hear(self, scheme: TopicScheme, kind: MessageKind, decode: Decode[M], take: Take[M]) -> None:
        """Subscribe to a topic of all robots; ``take`` gets what is well-formed and says something new."""

        def handle(inbound: Inbound) -> None:
            key = scheme.robot_of(inbound.topic)
            if key is None or not self._share.has(key):
                return
            if not inbound.payload and kind in KEPT_AT_THE_BROKER:
                return  # it only clears what the broker keeps
            at = Instant.of(self._clock)
            if len(str(key)) > KEY_LENGTH:
                self._malformed(kind, inbound.topic, f"a robot's name is longer than {KEY_LENGTH}", at, None)
                return
            try:
                message = self._reader.read(decode, inbound.topic, inbound.payload, scheme.major_version)
            except MalformedMessageError as error:
                self._malformed(kind, inbound.topic, _summary(error.problems), at, key)
                return
            if self._sources.accepts(key, scheme, message, retained=inbound.retained):
                take(key, message, at, inbound)

        self.mqtt.subscribe(scheme.for_all(Topic(kind)), handle)

    def _lost(self) -> None:
        self._epochs.reset()
        self._model.on_link(connected=False, at=Instant.of(self._clock))

    def _on_fleet_message(
        self, kind: MessageKind, take: Callable[[Inbound, Instant], None], inbound: Inbound
    ) -> None:
        at = Instant.of(self._clock)
        try:
            take(inbound, at)
        except ValidationError as error:
            self._malformed(kind, inbound.topic, _summary(problems_of(error)), at, None)

    def _take_connection(self, key: RobotKey, message: Connection, at: Instant, _: Inbound) -> None:
        self._model.on_connection(key, message, at)

    def _take_state(self, key: RobotKey, message: StateBrief, at: Instant, inbound: Inbound) -> None:
        self._model.on_state(key, message, at, retained=inbound.retained)

    def _take_visualization(
        self, key: RobotKey, message: VisualizationBrief, at: Instant, _: Inbound
    ) -> None:
        self._model.on_visualization(key, message, at)

    def _take_factsheet(self, key: RobotKey, message: Factsheet, at: Instant, _: Inbound) -> None:
        self._model.on_factsheet(key, message, at)

    def _read_robot_map(self, scheme: TopicScheme, inbound: Inbound, at: Instant) -> None:
        key = robot_of_map(scheme, inbound.topic)
        if key is None or not self._share.has(key) or len(str(key)) > KEY_LENGTH:
            return
        if len(inbound.payload) > PAYLOAD_LIMIT:
            problem = f"longer than {PAYLOAD_LIMIT} bytes"
            self._malformed(MessageKind.ROBOT_MAP, inbound.topic, problem, at, key)
            return
        found = RobotMap.model_validate_json(inbound.payload) if inbound.payload else None
        self._model.on_robot_map(key, found, at)

    def _read_plant_model(self, inbound: Inbound, _at: Instant) -> None:
        plant = PlantModel.from_json(inbound.payload) if inbound.payload else None
        self._model.on_plant_model(plant)
        if plant:
            self._follow_robots(schemes_of(plant.vehicles))

    def _read_vehicle_status(self, inbound: Inbound, at: Instant) -> None:
        if not inbound.payload or not self._epochs.is_current(inbound.payload):
            return
        status = VehicleStatus.model_validate_json(inbound.payload)
        if self._share.has(RobotKey(status.manufacturer, status.serial_number)):
            self._model.on_vehicle_status(status, at)

    def _read_order_status(self, inbound: Inbound, at: Instant) -> None:
        if not self._epochs.is_current(inbound.payload):
            return
        if inbound.payload:
            self._model.on_order_status(TransportOrderStatus.model_validate_json(inbound.payload), at)
        else:
            self._model.on_order_cleared(inbound.topic.rsplit("/", 2)[1])

    def _malformed(
        self, kind: MessageKind, topic: str, problem: str, at: Instant, key: RobotKey | None
    ) -> None:
        topic = topic[:TOPIC_LENGTH]
        self._model.on_malformed(kind, topic, problem, at, key=key)
        if self._problems.get(topic) == problem:
            return
        if len(self._problems) >= PROBLEMS_REMEMBERED:
            self._problems.clear()
        self._problems[topic] = problem
        log.warning("message not understood", topic=topic, robot=str(key) if key else None, problem=problem)


def _in_full(kind: type[H]) -> Decode[H]:
    def decode(codec: Codec, payload: bytes) -> H:
        return codec.decode(kind, payload)

    return decode


def _in_brief(kind: type[B]) -> Decode[B]:
    return partial(read_brief, kind)


def _summary(problems: Sequence[str]) -> str:
    """Give the first problem, and how many there are besides."""
    more = len(problems) - 1
    return f"{problems[0]} (and {more} more)" if more else problems[0]
