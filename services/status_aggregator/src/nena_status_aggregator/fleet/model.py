"""The fleet model: turns messages with their time of arrival into views and numbered changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from math import inf
from weakref import WeakValueDictionary

from nena_shared.clock import iso
from nena_shared.fleet_api.attention import Matter, MatterChange
from nena_shared.fleet_api.peripherals import PeripheralStatus
from nena_shared.fleet_api.plant import MapImage
from nena_shared.fleet_api.reasons import explained
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.stops import StopStatus, UnpausedVehicle
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant.model import PlantModel
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_shared.vda5050.versions import nearest_codec
from nena_shared.vda5050.visualization import Visualization
from nena_status_aggregator.fleet.attention import AttentionRegistry, Fleet, find_matters
from nena_status_aggregator.fleet.event_log import EventLog, Publish
from nena_status_aggregator.fleet.messages import MessageKind, Verdict
from nena_status_aggregator.fleet.order_service import OrderServiceWatch
from nena_status_aggregator.fleet.orders import OrderRegistry
from nena_status_aggregator.fleet.peripherals import PeripheralRegistry
from nena_status_aggregator.fleet.publication import Delta, Publication
from nena_status_aggregator.fleet.queues import Queues
from nena_status_aggregator.fleet.robot import PlantFrame, Robot, Timestamp
from nena_status_aggregator.fleet.statistics import Statistics
from nena_status_aggregator.fleet.view_builder import (
    short,
    view_jam,
    view_order,
    view_peripheral,
    view_robot,
    view_stop,
)
from nena_status_aggregator.fleet.views import (
    FleetView,
    OrderServiceView,
    OrderView,
    PeripheralView,
    RobotView,
)
from nena_status_aggregator.settings import JamSettings


class RobotRegistry:
    """Known robots by key.

    Any client that may publish can invent robots, so their number is limited: a new robot replaces the one
    with the oldest last message if that one is silent; otherwise the new robot is refused and counted.
    """

    def __init__(self, limit: int, silence_limit: float | None) -> None:
        self._limit = limit
        self._silence_limit = silence_limit
        self._robots: dict[RobotKey, Robot] = {}

    def __iter__(self) -> Iterator[Robot]:
        return iter(self._robots.values())

    def __len__(self) -> int:
        return len(self._robots)

    def get(self, key: RobotKey) -> Robot | None:
        """Return a known robot."""
        return self._robots.get(key)

    def find_or_add(self, key: RobotKey, at: Timestamp) -> tuple[Robot | None, Robot | None]:
        """Return the known or new robot, or None if the limit is reached, and the robot it replaced."""
        robot = self._robots.get(key)
        replaced = None
        if robot is None:
            if len(self._robots) >= self._limit:
                replaced = min(self._robots.values(), key=lambda candidate: candidate.last_message_at)
                if at.monotonic - replaced.last_message_at <= replaced.silence_limit(self._silence_limit):
                    return None, None
                del self._robots[replaced.key]
            robot = self._robots[key] = Robot(key, at)
        robot.last_message_at = at.monotonic
        return robot, replaced


ATTENTION_INTERVAL = 0.5
"""Seconds between two searches for what needs a person, which look at the whole fleet."""

SETTLED_AFTER = timedelta(seconds=1)
"""Time after a connection to the broker by which what it retains has arrived."""

ROOM = 64 * 1024 * 1024
"""Maximum total size of stored images, bytes; as any client may invent robots, further ones are refused."""


class MapCache:
    """Stores equal maps of several robots once; unused maps are freed."""

    def __init__(self) -> None:
        self._maps: WeakValueDictionary[str, MapImage] = WeakValueDictionary()

    def share_map(self, image: MapImage) -> MapImage | None:
        """Return the stored map that equals ``image``, else ``image``; None if the limit is reached."""
        stored = self._maps.get(image.digest)
        # The digest is part of the message: an invented one must not show another robot's map.
        if stored == image:
            return stored
        if sum(len(other_map.png) for other_map in self._maps.values()) + len(image.png) > ROOM:
            return None
        self._maps[image.digest] = image
        return image


@dataclass(frozen=True, slots=True)
class ModelLimits:
    """Limits of the fleet model."""

    robots: int = 10_000
    orders: int = 1000
    open_orders: int = 0
    """Maximum number of orders that have not ended, if more than ``orders``."""
    peripherals: int = 1000
    silence: float | None = None
    """Time without a state after which a robot is silent, s; None: see ``Robot.silence_limit``."""
    clock_skew: float = 2.0
    """Deviation from which a robot's clock counts as wrong, s."""
    track_distance: float = 0.0
    """m between two position events of a robot; 0 disables them."""
    jam: JamSettings = field(default_factory=JamSettings)


class FleetModel:
    """The fleet as of the last messages.

    Updated by the methods ``on_...``; :meth:`flush` returns the changes, :meth:`snapshot` everything. Owned
    by one task; never blocks.
    """

    def __init__(
        self,
        limits: ModelLimits,
        publish: Publish = lambda _: None,
        on_matter: Callable[[MatterChange, Matter], None] = lambda *_: None,
    ) -> None:
        """Start with an empty fleet; the functions receive each event and each change, and must not block."""
        self.limits = limits
        self.robots = RobotRegistry(limits.robots, limits.silence)
        self.orders = OrderRegistry(limits.orders, limits.open_orders)
        self.peripherals = PeripheralRegistry(limits.peripherals)
        self.queues = Queues(limits.jam)
        self.attention = AttentionRegistry(on_matter)
        self.order_service = OrderServiceWatch()
        self.statistics = Statistics()
        self._maps = MapCache()
        self._event_log = EventLog(self.statistics, publish, track_distance=limits.track_distance)
        self.plant: PlantModel | None = None
        self._frame = PlantFrame()
        self._key_of_vehicle: dict[str, RobotKey] = {}
        self._plant_version = 0
        self.direct_stops: tuple[StopStatus, ...] = ()
        """The active stops that the order service does not know yet."""
        self._public = Publication()
        self._link_since: datetime | None = None
        """Time of the last change of the broker connection; None: it was never established."""
        self._unassessed: dict[RobotKey, None] = {}
        """Robots whose condition may have changed."""
        self._attention_due = -inf
        """Monotonic time (s) of the next search for what needs a person."""
        self._no_silence_before = -inf
        """Monotonic time (s) before which no unchanged robot can become silent."""

    def on_connection(self, key: RobotKey, message: Connection, at: Timestamp) -> None:
        """Apply a connection message; never treated as late, as a last will has the header of its CONNECT."""
        robot = self._count_and_find(key, MessageKind.CONNECTION, at)
        if robot is not None:
            previous = robot.connection.connection_state.value if robot.connection else None
            robot.on_connection(message, at)
            self._event_log.log_connection(robot, previous, at)

    def on_state(self, key: RobotKey, message: State, at: Timestamp, *, retained: bool = False) -> None:
        """Apply a state; ``retained``: delivered from the broker's store."""
        robot = self._count_and_find(key, MessageKind.STATE, at)
        if robot is None:
            return
        if not self._is_new(robot, MessageKind.STATE, message):
            header = f"headerId {message.header_id} of {iso(message.timestamp)}"
            self.on_ignored(key, MessageKind.STATE, header, at)
            return
        previous = robot.state
        robot.on_state(message, at, retained=retained)
        self._event_log.log_state(robot, previous, message, at)
        self._event_log.log_position(robot, at)
        # The progress of its transport order depends on the robot's last node.
        self._touch_order_of(robot)

    def on_visualization(self, key: RobotKey, message: Visualization, at: Timestamp) -> None:
        """Apply a visualization message."""
        robot = self._count_and_find(key, MessageKind.VISUALIZATION, at)
        if robot is not None and self._is_new(robot, MessageKind.VISUALIZATION, message):
            robot.on_visualization(message)
            self._event_log.log_position(robot, at)

    def on_factsheet(self, key: RobotKey, message: Factsheet, at: Timestamp) -> None:
        """Apply a factsheet."""
        robot = self._count_and_find(key, MessageKind.FACTSHEET, at)
        if robot is not None and self._is_new(robot, MessageKind.FACTSHEET, message):
            robot.factsheet = message

    def on_robot_map(self, key: RobotKey, image: MapImage | None, at: Timestamp) -> None:
        """Apply a robot's grid map, or its removal."""
        robot = self._count_and_find(key, MessageKind.ROBOT_MAP, at)
        if robot is not None:
            robot.map = self._maps.share_map(image) if image else None

    def on_source(self, key: RobotKey, scheme: TopicScheme, version: str) -> None:
        """Note the topics and the version of VDA 5050 of a known robot's message."""
        if robot := self.robots.get(key):
            robot.scheme, robot.codec = scheme, nearest_codec(version)

    def on_deviations(self, key: RobotKey, deviations: tuple[Repair, ...]) -> None:
        """Apply the deviations of a known robot's messages from the standard."""
        robot = self.robots.get(key)
        if robot is not None and robot.deviations != deviations:
            robot.deviations = deviations
            self._mark_changed(key)

    def on_malformed(
        self, kind: MessageKind, topic: str, problem: str, at: Timestamp, *, key: RobotKey | None = None
    ) -> None:
        """Count an unreadable message, and add its robot if it is unknown.

        Args:
            kind: kind of the message.
            topic: topic of the message.
            problem: what is wrong with it.
            at: time of arrival.
            key: robot of the topic, if any.
        """
        self.statistics.received[kind] += key is None  # with a robot, _count_and_find counts it
        self.statistics.malformed[kind] += 1
        counts = self.statistics.malformed.items()
        self._public.fleet["malformed"] = {
            "counts": {message_kind.value: count for message_kind, count in counts if count},
            "lastTopic": short(topic),
            "lastProblem": short(problem),
            "lastTime": iso(at.utc),
        }
        robot = self._count_and_find(key, kind, at) if key else None
        if robot is not None:
            robot.on_malformed(kind, problem, at)

    def on_sighting(self, key: RobotKey, sighting: State) -> None:
        """Apply what an unreadable state says about the position of a known robot."""
        robot = self.robots.get(key)
        if robot is not None:
            robot.on_sighting(sighting)
            self._mark_changed(key)

    def on_ignored(self, key: RobotKey, kind: MessageKind, header: str, at: Timestamp) -> None:
        """Apply that a state of a known robot is ignored, because its header is not after the last one's."""
        robot = self.robots.get(key)
        if robot is not None and kind is MessageKind.STATE:
            robot.on_ignored(header, at)

    def on_vehicle_status(self, status: VehicleStatus, at: Timestamp) -> None:
        """Apply a vehicle status of the order service."""
        key = RobotKey(status.manufacturer, status.serial_number)
        robot = self._count_and_find(key, MessageKind.VEHICLE_STATUS, at)
        if robot is None:
            return
        self._touch_order_of(robot)  # the order that the vehicle leaves, and below the one that it takes
        if robot.vehicle and robot.vehicle.name != status.name:
            # The plant gave the robot another name; the old one must not stay as the head of a queue.
            self._forget_vehicle(robot.vehicle.name)
        robot.vehicle = status
        self._key_of_vehicle[status.name] = key
        self._touch_order_of(robot)

    def on_vehicle_elsewhere(self, status: VehicleStatus) -> None:
        """Apply a vehicle status of another share's robot: only the vehicles it waits for."""
        self.queues.update_elsewhere(status, self.limits.robots)

    def on_order_status(self, status: TransportOrderStatus, at: Timestamp) -> None:
        """Apply a transport order status of the order service."""
        self.statistics.received[MessageKind.ORDER_STATUS] += 1
        order = self.orders.get(status.name)
        previous = order.status if order else None
        if not self.orders.apply_status(status):
            self.statistics.repeated[MessageKind.ORDER_STATUS] += 1
            return
        if status.state.final and not (previous and previous.state.final):
            self.statistics.count_ended_order(status)
        self._event_log.log_order(previous, status, at)
        self._public.orders.mark_touched(status.name)
        for name in self.orders.remove_excess():
            self.statistics.orders_forgotten += 1
            self._public.orders.mark_touched(name)

    def on_order_cleared(self, name: str) -> None:
        """Apply that the broker no longer retains the status of an order."""
        self.statistics.received[MessageKind.ORDER_STATUS] += 1
        # Normal after the final status; of an order that is still open, the final status was missed.
        if self.orders.remove_open(name):
            self._public.orders.mark_touched(name)

    def on_peripheral_status(self, status: PeripheralStatus) -> bool:
        """Apply a device status of the order service; return False if there are too many devices."""
        if not self.peripherals.apply_status(status):
            return False
        self.statistics.received[MessageKind.PERIPHERAL_STATUS] += 1
        self._public.peripherals.mark_touched(status.location)
        return True

    def on_peripheral_cleared(self, location: str) -> None:
        """Apply that the plant no longer has a device."""
        self.statistics.received[MessageKind.PERIPHERAL_STATUS] += 1
        self.peripherals.remove(location)
        self._public.peripherals.mark_touched(location)

    def on_service_status(self, status: ServiceStatus, at: Timestamp, *, retained: bool) -> None:
        """Apply a heartbeat of the order service, or its last will."""
        self.statistics.received[MessageKind.SERVICE_STATUS] += 1
        self.order_service.apply_status(status, at, retained=retained)

    def on_plant_model(self, plant: PlantModel | None) -> None:
        """Apply the plant model, or its removal."""
        self.statistics.received[MessageKind.PLANT_MODEL] += 1
        if plant == self.plant:
            return
        self.plant = plant
        self._frame = PlantFrame.from_plant(plant)
        for robot in self.robots:
            robot.frame = self._frame
            self._mark_changed(robot.key)
        self._plant_version += 1
        # Only a summary: clients fetch the plant over HTTP when its version changes.
        self._public.fleet["plant"] = (
            {
                "version": self._plant_version,
                "name": plant.name,
                "points": len(plant.points),
                "paths": len(plant.paths),
                "locations": len(plant.locations),
            }
            if plant
            else None
        )
        for location in self.peripherals.forget_unconfirmed(plant.locations_by_name if plant else ()):
            self._public.peripherals.mark_touched(location)

    def on_link(self, *, connected: bool, at: Timestamp) -> None:
        """Apply that the broker connection was established or lost."""
        self._public.fleet["link"] = {"connected": connected, "since": iso(at.utc)}
        self._link_since = at.utc
        self._event_log.log_link(connected=connected, at=at)
        for robot in self.robots:
            self._mark_changed(robot.key)
        if not connected:
            self.order_service.forget_status()
            self.orders.mark_unconfirmed()
            for order in self.orders:
                self._public.orders.mark_touched(order.status.name)
            for location in self.peripherals.mark_unconfirmed():
                self._public.peripherals.mark_touched(location)

    @property
    def link_up(self) -> bool:
        """Whether the broker is connected."""
        return self._public.fleet["link"]["connected"]

    def update_conditions(self, at: Timestamp) -> None:
        """Update the conditions of all robots and what needs a person, without publishing them yet."""
        setting = self.limits.silence
        # Time alone changes nothing but silence. So only changed robots are assessed, and the others are
        # searched for silent ones only when the first of them can have become silent.
        if at.monotonic >= self._no_silence_before:
            self._no_silence_before = inf
            for robot in self.robots:
                if robot.notice_silence(at, setting):
                    self._mark_changed(robot.key)
                self._no_silence_before = min(self._no_silence_before, robot.silent_from(setting))
        for key in self._unassessed:
            changed = self.robots.get(key)
            if changed is not None:
                previous = changed.condition, changed.reason
                changed.update_condition(at, setting, link_up=self.link_up)
                self._event_log.log_condition(changed, previous, at)
                self.queues.update_robot(changed)
                self._no_silence_before = min(self._no_silence_before, changed.silent_from(setting))
        self._unassessed.clear()
        for name in self.queues.update_chains(at):
            if name in self._key_of_vehicle:
                self._public.robots.mark_touched(self._key_of_vehicle[name])
        if at.monotonic >= self._attention_due:
            self._attention_due = at.monotonic + ATTENTION_INTERVAL
            self._update_attention(at)

    def _update_attention(self, at: Timestamp) -> None:
        fleet = Fleet(
            [*self.robots],
            self.orders,
            self.queues.chains,
            self.queues.find_jams(at),
            self.order_service,
            at,
            lost_since=None if self.link_up else self._link_since or at.utc,
            direct_stops=self.direct_stops,
        )
        since = self._link_since
        settled = self.link_up and since is not None and at.utc - since >= SETTLED_AFTER
        self.attention.update(find_matters(fleet), at.utc, keep=not settled)

    def flush(self, at: Timestamp) -> Delta | None:
        """Update all conditions; return the changes since the last call, or None."""
        self.update_conditions(at)
        up, sign = self.order_service.is_up(at), self.order_service.last_sign
        # While it is up, the time of each heartbeat would be a change for all clients.
        down_since = iso(sign) if sign and up is False else None
        # What it has said about the robots is out of date while it is down; they themselves are not.
        known = [*(self.order_service.stops if up else map(self.count_paused, self.order_service.stops))]
        stops = [view_stop(stop) for stop in known]
        stops += [view_stop(stop, direct=True) for stop in self.direct_stops]
        lacks = [*self.order_service.broker_lacks]
        status: OrderServiceView = {"up": up, "lastSign": down_since, "stops": stops, "brokerLacks": lacks}
        self._public.fleet["orderService"] = status
        jams, keys = self.queues.find_jams(at), self._key_of_vehicle
        self._public.fleet["jams"] = [view_jam(jam) for jam in jams]
        heads = {str(keys[name]): jam.robots for jam in jams for name in jam.end if name in keys}
        self._event_log.log_jams(heads, at)
        self._event_log.log_stops((*known, *self.direct_stops), at)
        self._public.fleet["attention"] = [*self.attention.matters]
        return self._public.flush(self._view_robot, self._view_order, self._view_peripheral)

    def count_paused(self, stop: StopStatus) -> StopStatus:
        """Return a stop of all robots with what they report themselves; that of an area as it is."""
        if stop.area:
            return stop
        heard = [robot for robot in self.robots if robot.state or robot.connection]
        unpaused = tuple(
            UnpausedVehicle(vehicle=robot.vehicle_name, **explained(reason))
            for robot in heard
            if (reason := robot.why_not_paused())
        )
        counts = {"vehicles": len(heard), "paused": len(heard) - len(unpaused), "not_paused": unpaused}
        return stop.model_copy(update=counts)

    def instant_actions_key_of(self, robot: Robot) -> str | None:
        """Return the name of the list in instant actions to a robot, if it deviates from the standard."""
        vehicles = self.plant.vehicles if self.plant else ()
        name = robot.vehicle_name
        return next((each.instant_actions_key for each in vehicles if each.name == name), None)

    def snapshot(self) -> FleetView:
        """Return everything as of the last :meth:`flush`."""
        return self._public.snapshot()

    def robot_view(self, key: RobotKey) -> RobotView | None:
        """Return one robot as of the last :meth:`flush`."""
        return self._public.robots.views.get(key)

    def _count_and_find(self, key: RobotKey, kind: MessageKind, at: Timestamp) -> Robot | None:
        """Count the message and return its robot; None if the robot limit is reached."""
        self.statistics.received[kind] += 1
        robot, replaced = self.robots.find_or_add(key, at)
        if replaced is not None:
            self.statistics.robots_forgotten += 1
            self._event_log.log_forgotten(replaced, at)
            self._mark_changed(replaced.key)
            if replaced.vehicle:
                self._forget_vehicle(replaced.vehicle.name)
        if robot is None:
            self.statistics.refused[kind] += 1
        else:
            robot.frame = self._frame
            self._mark_changed(key)
        return robot

    def _forget_vehicle(self, name: str) -> None:
        self._key_of_vehicle.pop(name, None)
        self.queues.remove_vehicle(name)

    def _is_new(self, robot: Robot, kind: MessageKind, message: State | Visualization | Factsheet) -> bool:
        sequence = robot.sequences[kind]
        missed, restarts = sequence.missed, sequence.restarts
        verdict = sequence.assess_message(message.header_id, message.timestamp, message)
        self.statistics.missed[kind] += sequence.missed - missed
        self.statistics.restarts += sequence.restarts - restarts
        self.statistics.repeated[kind] += verdict is Verdict.REPEATED
        self.statistics.late[kind] += verdict is Verdict.LATE
        return verdict is Verdict.NEW

    def _touch_order_of(self, robot: Robot) -> None:
        if robot.vehicle and robot.vehicle.transport_order:
            self._public.orders.mark_touched(robot.vehicle.transport_order)

    def _mark_changed(self, key: RobotKey) -> None:
        self._unassessed[key] = None
        self._public.robots.mark_touched(key)

    def _view_robot(self, key: RobotKey) -> RobotView | None:
        robot = self.robots.get(key)
        if robot is None:
            return None
        return view_robot(
            robot,
            silence_limit=robot.silence_limit(self.limits.silence),
            skew_limit=self.limits.clock_skew,
            chain=self.queues.chains.get(robot.vehicle.name) if robot.vehicle else None,
        )

    def _view_order(self, name: str) -> OrderView | None:
        order = self.orders.get(name)
        if order is None:
            return None
        key = self._key_of_vehicle.get(order.status.processing_vehicle or "")
        robot = self.robots.get(key) if key else None
        return view_order(order, robot.state.last_node_id if robot and robot.state else None)

    def _view_peripheral(self, location: str) -> PeripheralView | None:
        device = self.peripherals.get(location)
        return view_peripheral(device) if device else None
