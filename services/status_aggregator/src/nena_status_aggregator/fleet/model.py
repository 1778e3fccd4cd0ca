"""The robots that are kept, and which one makes room when there are too many.

Anybody who may publish can invent robots, so their number is bounded. The rule: a newcomer takes the place of
the robot that has not been heard of for the longest time, but only if that time is longer than its silence
limit; while all are alive the newcomer is refused, and counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from weakref import WeakValueDictionary

from nena_shared.clock import iso
from nena_shared.fleet_api.plant import RobotMap
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant.model import PlantModel
from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.event_log import Chronicle, Tell
from nena_status_aggregator.fleet.messages import MessageKind, Verdict
from nena_status_aggregator.fleet.orders import OrderBook
from nena_status_aggregator.fleet.publication import Delta, Publication
from nena_status_aggregator.fleet.robot import Instant, PlantFrame, Robot
from nena_status_aggregator.fleet.statistics import Statistics
from nena_status_aggregator.fleet.view_builder import short, view_order, view_robot
from nena_status_aggregator.fleet.views import FleetView, OrderView, PlantView, RobotView


class RobotRegister:
    """All robots that are known, by their keys."""

    def __init__(self, limit: int, silence_limit: float | None) -> None:
        self._limit = limit
        self._silence_limit = silence_limit
        self._robots: dict[RobotKey, Robot] = {}

    def __iter__(self) -> Iterator[Robot]:
        return iter(self._robots.values())

    def __len__(self) -> int:
        return len(self._robots)

    def get(self, key: RobotKey) -> Robot | None:
        """Give a robot that is known."""
        return self._robots.get(key)

    def meet(self, key: RobotKey, at: Instant) -> tuple[Robot | None, Robot | None]:
        """Give the robot, known or new, or None if there is no room; and the robot that had to go for it."""
        robot = self._robots.get(key)
        gone = None
        if robot is None:
            if len(self._robots) >= self._limit:
                gone = self._quietest(at)
                if gone is None:
                    return None, None
                del self._robots[gone.key]
            robot = self._robots[key] = Robot(key, at)
        robot.heard = at.monotonic
        return robot, gone

    def _quietest(self, at: Instant) -> Robot | None:
        robot = min(self._robots.values(), key=lambda each: each.heard)
        quiet = at.monotonic - robot.heard > robot.silence_limit(self._silence_limit)
        return robot if quiet else None


ROOM = 64 * 1024 * 1024
"""Bytes of images that are kept; above that a further one is not taken, for anybody may invent robots."""


class MapShelf:
    """Knows the maps that some robot has; one that no robot has any more goes by itself."""

    def __init__(self) -> None:
        self._known: WeakValueDictionary[str, RobotMap] = WeakValueDictionary()

    def shared(self, found: RobotMap) -> RobotMap | None:
        """Give the map that equals ``found`` and is kept already, else ``found``; None: there is no room."""
        known = self._known.get(found.digest)
        if known == found:
            return known
        if sum(len(each.png) for each in self._known.values()) + len(found.png) > ROOM:
            return None
        self._known[found.digest] = found
        return found


@dataclass(frozen=True, slots=True)
class ModelLimits:
    """What the model keeps, and when it worries."""

    robots: int = 2000
    orders: int = 1000
    silence: float | None = None
    """Seconds without a state; None: by what the robot says of its interval, see ``Robot.silence_limit``."""
    clock_skew: float = 2.0
    """Seconds from which a robot's clock counts as wrong."""
    track_distance: float = 0.0
    """m after which a robot's position is told again as a happening; 0: none is."""


class FleetModel:
    """Changed by the methods ``on_...``; :meth:`flush` tells what they changed, :meth:`snapshot` everything.

    Owned by one task; nothing in it waits.
    """

    def __init__(self, limits: ModelLimits, tell: Tell = lambda _: None) -> None:
        """Begin with an empty fleet; ``tell`` is handed each happening and must return at once."""
        self.limits = limits
        self.robots = RobotRegister(limits.robots, limits.silence)
        self.orders = OrderBook(limits.orders)
        self.statistics = Statistics()
        self._maps = MapShelf()
        self._chronicle = Chronicle(self.statistics, tell, track_distance=limits.track_distance)
        self.plant: PlantModel | None = None
        self._frame = PlantFrame()
        self._key_of_vehicle: dict[str, RobotKey] = {}
        self._plant_version = 0
        self._public = Publication()
        self._unjudged: dict[RobotKey, None] = {}
        """Robots whose condition may be another one by now."""
        self._nobody_silent_before = -inf
        """Until this moment (s) no robot that is not touched before can fall silent."""

    def on_connection(self, key: RobotKey, message: Connection, at: Instant) -> None:
        """Take in a connection message; never judged late, for a will carries the header of its CONNECT."""
        robot = self._meet(key, MessageKind.CONNECTION, at)
        if robot is not None:
            before = robot.connection.connection_state.value if robot.connection else None
            robot.on_connection(message, at)
            self._chronicle.connection(robot, before, at)

    def on_state(self, key: RobotKey, message: StateBrief, at: Instant, *, retained: bool = False) -> None:
        """Take in a state; ``retained``: the broker had kept it."""
        robot = self._meet(key, MessageKind.STATE, at)
        if robot is None or not self._is_news(robot, MessageKind.STATE, message):
            return
        before = robot.state
        robot.on_state(message, at, retained=retained)
        self._chronicle.state(robot, before, message, at)
        self._chronicle.position(robot, at)
        self._touch_order_of(robot)

    def on_visualization(self, key: RobotKey, message: VisualizationBrief, at: Instant) -> None:
        """Take in where a robot is between two states."""
        robot = self._meet(key, MessageKind.VISUALIZATION, at)
        if robot is not None and self._is_news(robot, MessageKind.VISUALIZATION, message):
            robot.on_visualization(message)
            self._chronicle.position(robot, at)

    def on_factsheet(self, key: RobotKey, message: Factsheet, at: Instant) -> None:
        """Take in what a robot is and can do."""
        robot = self._meet(key, MessageKind.FACTSHEET, at)
        if robot is not None and self._is_news(robot, MessageKind.FACTSHEET, message):
            robot.factsheet = message

    def on_robot_map(self, key: RobotKey, found: RobotMap | None, at: Instant) -> None:
        """Take in what a robot's own map looks like, or that the broker keeps none any more."""
        robot = self._meet(key, MessageKind.ROBOT_MAP, at)
        if robot is not None:
            robot.map = self._maps.shared(found) if found else None

    def on_malformed(
        self, kind: MessageKind, topic: str, problem: str, at: Instant, *, key: RobotKey | None = None
    ) -> None:
        """Take in that a message could not be read, and why; also a robot never understood is seen.

        Args:
            kind: what the message should have been.
            topic: where it came.
            problem: what is wrong with it, a sentence.
            at: when it came.
            key: the robot that the topic names, if any.

        """
        self.statistics.received[kind] += key is None
        self.statistics.malformed[kind] += 1
        self._public.malformed = {
            "counts": {each.value: count for each, count in self.statistics.malformed.items() if count},
            "lastTopic": short(topic),
            "lastProblem": short(problem),
            "lastTime": iso(at.utc),
        }
        robot = self._meet(key, kind, at) if key else None
        if robot is not None:
            robot.malformed += 1
            robot.problem = f"{kind}: {problem}"

    def on_vehicle_status(self, status: VehicleStatus, at: Instant) -> None:
        """Take in what the order service says of a vehicle."""
        key = RobotKey(status.manufacturer, status.serial_number)
        robot = self._meet(key, MessageKind.VEHICLE_STATUS, at)
        if robot is None:
            return
        self._touch_order_of(robot)
        if robot.vehicle:
            self._key_of_vehicle.pop(robot.vehicle.name, None)
        robot.vehicle = status
        self._key_of_vehicle[status.name] = key
        self._touch_order_of(robot)

    def on_order_status(self, status: TransportOrderStatus, at: Instant) -> None:
        """Take in what the order service says of a transport order."""
        self.statistics.received[MessageKind.ORDER_STATUS] += 1
        known = self.orders.get(status.name)
        if not self.orders.take(status):
            self.statistics.repeated[MessageKind.ORDER_STATUS] += 1
            return
        if status.state.final and not (known and known.status.state.final):
            self.statistics.count_end(status)
        self._chronicle.order(known.status if known else None, status, at)
        self._public.orders.touch(status.name)
        for name in self.orders.shrink():
            self.statistics.orders_forgotten += 1
            self._public.orders.touch(name)

    def on_order_cleared(self, name: str) -> None:
        """Take in that the broker keeps no status of this order any more."""
        self.statistics.received[MessageKind.ORDER_STATUS] += 1
        if self.orders.clear(name):
            self._public.orders.touch(name)

    def on_plant_model(self, plant: PlantModel | None) -> None:
        """Take in the plant model, or that there is none any more."""
        self.statistics.received[MessageKind.PLANT_MODEL] += 1
        if plant == self.plant:
            return
        self.plant = plant
        self._frame = PlantFrame.of(plant)
        for robot in self.robots:
            robot.frame = self._frame
            self._touch(robot.key)
        self._plant_version += 1
        self._public.plant = view_plant(plant, self._plant_version) if plant else None

    def on_link(self, *, connected: bool, at: Instant) -> None:
        """Take in that the link to the broker stands, or is lost."""
        self._public.link = {"connected": connected, "since": iso(at.utc)}
        self._chronicle.link(connected=connected, at=at)
        for robot in self.robots:
            self._touch(robot.key)
        if not connected:
            self.orders.doubt()
            for order in self.orders:
                self._public.orders.touch(order.status.name)

    @property
    def link_up(self) -> bool:
        """Whether the link to the broker stands."""
        return self._public.link["connected"]

    def advance(self, at: Instant) -> None:
        """Bring the conditions of all robots up to date, without telling anybody yet."""
        if at.monotonic >= self._nobody_silent_before:
            self._find_silent(at)
        for key in self._unjudged:
            touched = self.robots.get(key)
            if touched is not None:
                before = touched.condition, touched.reason
                touched.judge(at, self.limits.silence, link_up=self.link_up)
                self._chronicle.condition(touched, before, at)
                soonest = touched.silent_from(self.limits.silence)
                self._nobody_silent_before = min(self._nobody_silent_before, soonest)
        self._unjudged.clear()

    def flush(self, at: Instant) -> Delta | None:
        """Bring all conditions up to date, and tell what changed since the last call; None: nothing."""
        self.advance(at)
        return self._public.flush(self._look_at_robot, self._look_at_order)

    def snapshot(self) -> FleetView:
        """Tell everything, as of the last :meth:`flush`."""
        return self._public.snapshot()

    def robot_view(self, key: RobotKey) -> RobotView | None:
        """Tell of one robot, as of the last :meth:`flush`."""
        return self._public.robots.views.get(key)

    def order_view(self, name: str) -> OrderView | None:
        """Tell of one order, as of the last :meth:`flush`."""
        return self._public.orders.views.get(name)

    def _meet(self, key: RobotKey, kind: MessageKind, at: Instant) -> Robot | None:
        """Count the message, and give the robot that it is about; None: there is no room for it."""
        self.statistics.received[kind] += 1
        robot, gone = self.robots.meet(key, at)
        if gone is not None:
            self.statistics.robots_forgotten += 1
            self._chronicle.forgotten(gone, at)
            self._touch(gone.key)
            if gone.vehicle:
                self._key_of_vehicle.pop(gone.vehicle.name, None)
        if robot is None:
            self.statistics.refused[kind] += 1
        else:
            robot.frame = self._frame
            self._touch(key)
        return robot

    def _is_news(
        self, robot: Robot, kind: MessageKind, message: StateBrief | VisualizationBrief | Factsheet
    ) -> bool:
        sequence = robot.sequences[kind]
        missed, restarts = sequence.missed, sequence.restarts
        verdict = sequence.judge(message.header_id, message.timestamp)
        self.statistics.missed[kind] += sequence.missed - missed
        self.statistics.restarts += sequence.restarts - restarts
        self.statistics.repeated[kind] += verdict is Verdict.REPEATED
        self.statistics.late[kind] += verdict is Verdict.LATE
        return verdict is Verdict.TAKEN

    def _touch_order_of(self, robot: Robot) -> None:
        if robot.vehicle and robot.vehicle.transport_order:
            self._public.orders.touch(robot.vehicle.transport_order)

    def _find_silent(self, at: Instant) -> None:
        """Look for robots that have fallen silent, and until when none can."""
        setting, soonest = self.limits.silence, inf
        for robot in self.robots:
            if robot.falls_silent(at, setting):
                self._touch(robot.key)
            soonest = min(soonest, robot.silent_from(setting))
        self._nobody_silent_before = soonest

    def _touch(self, key: RobotKey) -> None:
        self._unjudged[key] = None
        self._public.robots.touch(key)

    def _look_at_robot(self, key: RobotKey) -> RobotView | None:
        robot = self.robots.get(key)
        if robot is None:
            return None
        return view_robot(
            robot,
            silence_limit=robot.silence_limit(self.limits.silence),
            skew_limit=self.limits.clock_skew,
        )

    def _look_at_order(self, name: str) -> OrderView | None:
        order = self.orders.get(name)
        if order is None:
            return None
        key = self._key_of_vehicle.get(order.status.processing_vehicle or "")
        robot = self.robots.get(key) if key else None
        return view_order(order, robot.state.last_node_id if robot and robot.state else None)


def view_plant(plant: PlantModel, version: int) -> PlantView:
    """Tell which plant model there is."""
    return {
        "version": version,
        "name": plant.name,
        "points": len(plant.points),
        "paths": len(plant.paths),
        "locations": len(plant.locations),
    }
