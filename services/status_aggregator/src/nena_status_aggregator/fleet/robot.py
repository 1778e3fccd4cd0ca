"""A moment as the model is told it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from math import hypot, inf
from typing import NamedTuple

from msgspec.structs import replace

from nena_shared.clock import Clock
from nena_shared.fleet_api.plant import RobotMap
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.plant import MapPlace, MapPose, MapTransform, PlantModel
from nena_shared.plant.model import map_transforms
from nena_shared.vda5050.brief.state import PositionBrief, StateBrief, VelocityBrief, VisualizationBrief
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.condition import Condition, Evidence, Reason, judge
from nena_status_aggregator.fleet.messages import ClockSkew, MessageKind, Sequence


class Instant(NamedTuple):
    """The same moment twice: seconds that never go back, for durations; UTC, for people."""

    monotonic: float
    utc: datetime

    @classmethod
    def of(cls, clock: Clock) -> Instant:
        """Read ``clock``."""
        return cls(clock.monotonic(), clock.now())


LONGEST_STEP = 20.0
"""m between two reports; more is a new localisation, or a robot that was carried."""

NOISE = 0.01
"""m; smaller steps wait until they have added up, so that a standing robot does not drive."""


class Odometer:
    """Adds up the ways between positions of the same map."""

    __slots__ = ("_last", "meters")

    def __init__(self) -> None:
        self.meters = 0.0
        self._last: PositionBrief | None = None

    def follow(self, position: PositionBrief | None) -> None:
        """Take in where the robot is; where it is not localized, the way there is not known."""
        last = self._last
        if position is None or not position.localized:
            self._last = None
            return
        if last is not None and last.map_id == position.map_id:
            step = hypot(position.x - last.x, position.y - last.y)
            if step < NOISE:
                return
            if step <= LONGEST_STEP:
                self.meters += step
        self._last = position


@dataclass(slots=True)
class OrderProgress:
    """Nodes left against the nodes of the order.

    Nodes have the even sequence ids and the first one counts as reached (VDA 5050 3.0 sections 6.1.1 and
    6.6.1), so the last node's sequence id tells how many there are, also to an aggregator that was started in
    mid-order, and also after the horizon was replaced or the base was extended.
    """

    order_id: str = ""
    nodes: int = 0
    """Nodes to reach in the whole order, without the first."""
    nodes_left: int = 0

    def follow(self, state: StateBrief) -> None:
        """Take in a state."""
        if state.order_id != self.order_id:
            self.order_id = state.order_id
            self.nodes = 0
        if state.node_states:
            self.nodes = state.node_states[-1].sequence_id // 2
            self.nodes_left = min(len(state.node_states), self.nodes)
        else:
            # Reached, or cancelled on the way: then the last node tells how far it came.
            reached = state.last_node_sequence_id // 2
            self.nodes = max(self.nodes, reached)
            self.nodes_left = self.nodes - reached

    @property
    def percent(self) -> float:
        """0 to 100; an order of a single node has nothing to drive and is at 100."""
        if not self.nodes:
            return 100.0
        return round(100.0 * (self.nodes - self.nodes_left) / self.nodes, 1)


log = get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PlantFrame:
    """How the plant lies on maps, by their ids."""

    transforms: Mapping[str, MapTransform] = field(default_factory=dict)

    @classmethod
    def of(cls, plant: PlantModel | None) -> PlantFrame:
        """Take what a plant model says; one that says nonsense says nothing."""
        try:
            return cls(map_transforms(plant)) if plant else cls()
        except ValueError as error:
            log.warning("the plant model's transforms are passed over", reason=str(error))
            return cls()

    def position(self, at: PositionBrief | None, sheet: Factsheet | None) -> PositionBrief | None:
        """Give a position; None too before a factsheet has said who transforms."""
        transform = self.transforms.get(at.map_id) if at else None
        if at is None or transform is None or (sheet and transforms_itself(sheet)):
            return at
        if sheet is None:
            return None
        pose = transform.pose_to_plant(MapPose(at.x, at.y, at.theta))
        return replace(at, x=pose.x_m, y=pose.y_m, theta=pose.heading_rad)

    def place(
        self, x: float, y: float, map_id: str | None, sheet: Factsheet | None
    ) -> tuple[float, float] | None:
        """Give a place, m; None as for :meth:`position`."""
        transform = self.transforms.get(map_id) if map_id else None
        if transform is None or (sheet and transforms_itself(sheet)):
            return x, y
        if sheet is None:
            return None
        place = transform.to_plant(MapPlace(x, y))
        return place.x_m, place.y_m


LEAST_SILENCE_LIMIT = 35.0
"""Seconds: VDA 5050 asks for a state at least every 30 s (3.0 section 6.6), and 5 s are for the way."""

INTERVALS_MISSED = 3
"""A robot that says how often it sends states may miss two of them."""


class Robot:
    """One robot, changed by the messages about it; it does not know the time but by them."""

    def __init__(self, key: RobotKey, seen: Instant) -> None:
        self.key = key
        self.heard = seen.monotonic
        """When any message came last, s."""
        self.connection: Connection | None = None
        self.connection_since = seen.utc
        self.state: StateBrief | None = None
        self.state_at = seen
        """When the last state came, or the robot was first seen."""
        self.state_after_connection = False
        self.frame = PlantFrame()
        self.reported: PositionBrief | None = None
        """Where it says that it is, in the frame in which it speaks."""
        self.velocity: VelocityBrief | None = None
        self.factsheet: Factsheet | None = None
        self.vehicle: VehicleStatus | None = None
        self.map: RobotMap | None = None
        """What its own map looks like."""
        self.progress = OrderProgress()
        self.odometer = Odometer()
        self.tracked: PositionBrief | None = None
        """The position that was told last, for the track."""
        self.skew = ClockSkew()
        self.sequences = {
            kind: Sequence() for kind in (MessageKind.STATE, MessageKind.VISUALIZATION, MessageKind.FACTSHEET)
        }
        self.states = 0
        """States taken in."""
        self.malformed = 0
        self.problem = ""
        """What was wrong with its last malformed message."""
        self.condition = Condition.SILENT
        self.condition_since = seen.utc
        self.reason = Reason("stateless")
        self._silence_noticed = False

    @property
    def id(self) -> str:
        """Manufacturer and serial number."""
        return str(self.key)

    @property
    def position(self) -> PositionBrief | None:
        """Where it is in the plant's frame; None where nobody knows."""
        return self.frame.position(self.reported, self.factsheet)

    def on_connection(self, message: Connection, at: Instant) -> None:
        """Take in a connection message; a repetition of what is known leaves the time since when alone."""
        before = self.connection
        same = before is not None and before.connection_state is message.connection_state
        if not same:
            self.state_after_connection = False
            self.connection_since = at.utc
        self.connection = message

    def on_state(self, message: StateBrief, at: Instant, *, retained: bool) -> None:
        """Take in a state; one that the broker had kept is as old as its own timestamp says."""
        age = max(0.0, (at.utc - message.timestamp).total_seconds()) if retained else 0.0
        self.state = message
        self.states += 1
        self.state_at = Instant(at.monotonic - age, at.utc - timedelta(seconds=age))
        self.state_after_connection = not retained
        self._silence_noticed = False
        self.reported = message.mobile_robot_position
        self.velocity = message.velocity
        self.progress.follow(message)
        self.odometer.follow(message.mobile_robot_position)
        if not retained:
            self.skew.measure(message.timestamp, at.utc)

    def on_visualization(self, message: VisualizationBrief) -> None:
        """Take in a visualization: where it is now, between two states."""
        self.reported = message.mobile_robot_position or self.reported
        self.odometer.follow(self.reported)
        self.velocity = message.velocity or self.velocity

    def silence_limit(self, setting: float | None) -> float:
        """Seconds that this robot may be without a state; ``setting`` None: by the interval that it names."""
        if setting is not None:
            return setting
        timing = self.factsheet.protocol_limits.timing if self.factsheet else None
        interval = (timing.default_state_interval if timing else None) or 0.0
        return max(INTERVALS_MISSED * interval, LEAST_SILENCE_LIMIT)

    def age(self, at: Instant) -> float | None:
        """Seconds since the last state; None before the first."""
        return None if self.state is None else max(0.0, at.monotonic - self.state_at.monotonic)

    def falls_silent(self, at: Instant, setting: float | None) -> bool:
        """Tell, once, that the limit has been passed since the last look."""
        if self._silence_noticed or at.monotonic - self.state_at.monotonic <= self.silence_limit(setting):
            return False
        self._silence_noticed = True
        return True

    def silent_from(self, setting: float | None) -> float:
        """Give the moment (s) from which it is silent if no state comes; infinity if it is already."""
        return inf if self._silence_noticed else self.state_at.monotonic + self.silence_limit(setting)

    def judge(self, at: Instant, setting: float | None, *, link_up: bool) -> None:
        """Bring the condition up to date."""
        limit = self.silence_limit(setting)
        condition, self.reason = judge(
            Evidence(
                connection=self.connection.connection_state if self.connection else None,
                connection_since=self.connection_since,
                state=self.state,
                state_time=self.state_at.utc,
                state_after_connection=self.state_after_connection,
                overdue=at.monotonic - self.state_at.monotonic > limit,
                silence_limit=limit,
                link_up=link_up,
                problem=self.problem,
                fleet_remark=self.vehicle.reason if self.vehicle else None,
            )
        )
        if condition is not self.condition:
            self.condition = condition
            self.condition_since = at.utc
