"""The data of one robot: connection, state, position, order progress, distance driven and silence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from math import hypot, inf
from typing import NamedTuple

from nena_shared.clock import Clock, ClockSkew
from nena_shared.fleet_api.plant import MapImage
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.plant import MapPlace, MapPose, MapTransform, PlantModel
from nena_shared.plant.model import map_transforms
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import MobileRobotPosition, State, Velocity
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_shared.vda5050.visualization import Visualization
from nena_status_aggregator.fleet.condition import (
    Condition,
    ConditionInputs,
    ConditionReason,
    assess_condition,
)
from nena_status_aggregator.fleet.messages import MessageKind, Sequence


class Timestamp(NamedTuple):
    """A point in time: monotonic seconds for durations, and UTC for people."""

    monotonic: float
    utc: datetime

    @classmethod
    def of(cls, clock: Clock) -> Timestamp:
        """Read ``clock``."""
        return cls(clock.monotonic(), clock.now())


LONGEST_STEP = 20.0
"""m between two reports; a longer step is a new localisation or a robot moved by hand."""

NOISE = 0.01
"""m; smaller steps are accumulated, so that noise does not count as driving."""


class Odometer:
    """Sums the distances between positions on the same map."""

    __slots__ = ("_last", "_trip", "empty_meters", "loads", "meters")

    def __init__(self) -> None:
        self.meters = 0.0
        self.empty_meters = 0.0
        """The part of ``meters`` without a load."""
        self.loads: int | None = None
        """Number of loads in the last state; None: not reported."""
        self._last: MobileRobotPosition | None = None
        self._trip = 0.0, 0.0

    def add_position(self, position: MobileRobotPosition | None) -> None:
        """Add a position; distances to and from unlocalised positions do not count."""
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
                self.empty_meters += step if self.loads == 0 else 0.0
        self._last = position

    def end_trip(self) -> tuple[float, float | None]:
        """Return the distance since the last call, m, and the part without a load (None: not reported)."""
        start, start_empty = self._trip
        self._trip = self.meters, self.empty_meters
        empty = self.empty_meters - start_empty
        return round(self.meters - start, 2), None if self.loads is None else round(empty, 2)


@dataclass(slots=True)
class OrderProgress:
    """Progress of an order: remaining nodes relative to all nodes.

    Nodes have even sequence IDs and the first one counts as reached (VDA 5050 3.0, 6.1.1 and 6.6.1), so the
    last node's sequence ID is their number, even if this program started in the middle of the order or
    the base was extended.
    """

    order_id: str = ""
    nodes: int = 0
    """Number of nodes of the order without the first one."""
    nodes_left: int = 0

    def update_from(self, state: State) -> None:
        """Update from a state."""
        if state.order_id != self.order_id:
            self.order_id = state.order_id
            self.nodes = 0
        if state.node_states:
            self.nodes = state.node_states[-1].sequence_id // 2
            self.nodes_left = min(len(state.node_states), self.nodes)
        else:
            # Finished or cancelled: the last node shows how far the robot came.
            reached = state.last_node_sequence_id // 2
            self.nodes = max(self.nodes, reached)
            self.nodes_left = self.nodes - reached

    @property
    def percent(self) -> float:
        """Progress, 0 to 100; 100 for an order with a single node."""
        if not self.nodes:
            return 100.0
        return round(100.0 * (self.nodes - self.nodes_left) / self.nodes, 1)


log = get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PlantFrame:
    """Transforms from robots' maps to the plant frame, by map ID.

    Positions of robots that transform themselves, or on maps without a transform, already are in the plant
    frame.
    """

    transforms: Mapping[str, MapTransform] = field(default_factory=dict)

    @classmethod
    def from_plant(cls, plant: PlantModel | None) -> PlantFrame:
        """Create from a plant model; invalid transforms are logged and ignored."""
        try:
            return cls(map_transforms(plant)) if plant else cls()
        except ValueError as error:
            log.warning("ignoring the invalid map transforms of the plant model", reason=str(error))
            return cls()

    def to_plant_position(
        self, at: MobileRobotPosition | None, sheet: Factsheet | None
    ) -> MobileRobotPosition | None:
        """Return a position in the plant frame; None until the factsheet tells who transforms."""
        transform = self.transforms.get(at.map_id) if at else None
        if at is None or transform is None or (sheet and transforms_itself(sheet)):
            return at
        if sheet is None:
            # A robot in the wrong place on the map misleads more than one that is not shown yet.
            return None
        pose = transform.pose_to_plant(MapPose(at.x, at.y, at.theta))
        # Without validation: turned and moved, valid values stay valid.
        return MobileRobotPosition.model_construct(
            x=pose.x_m,
            y=pose.y_m,
            theta=pose.heading_rad,
            map_id=at.map_id,
            localized=at.localized,
            localization_score=at.localization_score,
            deviation_range=at.deviation_range,
        )

    def to_plant_point(
        self, x: float, y: float, map_id: str | None, sheet: Factsheet | None
    ) -> tuple[float, float] | None:
        """Return a point in the plant frame, m; None as for :meth:`to_plant_position`."""
        transform = self.transforms.get(map_id) if map_id else None
        if transform is None or (sheet and transforms_itself(sheet)):
            return x, y
        if sheet is None:
            return None
        place = transform.to_plant(MapPlace(x, y))
        return place.x_m, place.y_m


AWAY = {
    ConnectionState.OFFLINE: Reason(ReasonCode.IS_OFFLINE),
    ConnectionState.HIBERNATING: Reason(ReasonCode.IS_HIBERNATING),
    ConnectionState.CONNECTION_BROKEN: Reason(ReasonCode.CONNECTION_LOST),
}
"""Why a robot cannot be reached, by its connection."""

LEAST_SILENCE_LIMIT = 35.0
"""Seconds: VDA 5050 requires a state at least every 30 s (3.0, 6.6); 5 s allow for latency."""

INTERVALS_MISSED = 3
"""State intervals of the factsheet after which a robot is silent."""


class Robot:
    """The last known data of a robot, updated by its messages."""

    def __init__(self, key: RobotKey, seen: Timestamp) -> None:
        self.key = key
        self.last_message_at = seen.monotonic
        """Time of the last message of any kind, monotonic s."""
        self.scheme: TopicScheme | None = None
        """Its topics; None: nothing was received from the robot itself."""
        self.codec: Codec | None = None
        """Its version of VDA 5050; None as above."""
        self.connection: Connection | None = None
        self.connection_since = seen.utc
        self.state: State | None = None
        self.state_at = seen
        """Time of the last state, or of the robot's first message."""
        self.state_after_connection = False
        self.frame = PlantFrame()
        self.reported: MobileRobotPosition | None = None
        """Reported position, in the robot's own frame."""
        self.velocity: Velocity | None = None
        self.factsheet: Factsheet | None = None
        self.vehicle: VehicleStatus | None = None
        self.map: MapImage | None = None
        """The robot's grid map."""
        self.progress = OrderProgress()
        self.odometer = Odometer()
        self.tracked: MobileRobotPosition | None = None
        """The position in the last position event."""
        self.skew = ClockSkew()
        self.sequences = {
            kind: Sequence() for kind in (MessageKind.STATE, MessageKind.VISUALIZATION, MessageKind.FACTSHEET)
        }
        self.states = 0
        """States received and used."""
        self.malformed = 0
        self.problem = ""
        """The problem of its last malformed message."""
        self.unreadable = ""
        """The problem of its last state; empty if it was readable."""
        self.unreadable_at = -inf
        self.ignored = ""
        """Why its last state was ignored; empty if it was not."""
        self.ignored_at = -inf
        self.deviations: tuple[Repair, ...] = ()
        """How its messages deviate from the standard, and how they were read."""
        self.condition = Condition.SILENT
        self.condition_since = seen.utc
        self.reason = ConditionReason("stateless")
        self._silence_noticed = False

    @property
    def id(self) -> str:
        """Manufacturer and serial number."""
        return str(self.key)

    @property
    def vehicle_name(self) -> str:
        """Name in the plant model, if the order service knows it; else the serial number."""
        return self.vehicle.name if self.vehicle else self.key.serial_number

    @property
    def away_reason(self) -> Reason | None:
        """Why it cannot be reached, by its connection; None if it can."""
        return AWAY.get(self.connection.connection_state) if self.connection else None

    def why_not_paused(self) -> Reason | None:
        """Return, as a predicate, why it does not report that it is paused; None if it does."""
        if away := self.away_reason:
            return away
        if self._silence_noticed:
            return Reason(ReasonCode.IS_SILENT)
        return None if self.state and self.state.paused else Reason(ReasonCode.PAUSE_UNCONFIRMED)

    @property
    def position(self) -> MobileRobotPosition | None:
        """Position in the plant frame; None if unknown."""
        return self.frame.to_plant_position(self.reported, self.factsheet)

    def on_connection(self, message: Connection, at: Timestamp) -> None:
        """Update from a connection message; repeating the same state does not change its time."""
        if self.connection is None or self.connection.connection_state is not message.connection_state:
            self.state_after_connection = False
            self.connection_since = at.utc
        self.connection = message

    def on_state(self, message: State, at: Timestamp, *, retained: bool) -> None:
        """Update from a state; the age of a retained state is taken from its timestamp."""
        age = max(0.0, (at.utc - message.timestamp).total_seconds()) if retained else 0.0
        self.state = message
        self.unreadable = self.ignored = ""
        self.states += 1
        self.state_at = Timestamp(at.monotonic - age, at.utc - timedelta(seconds=age))
        self.state_after_connection = not retained
        self._silence_noticed = False
        self.reported = message.mobile_robot_position
        self.velocity = message.velocity
        self.progress.update_from(message)
        # Position first: the way up to here was driven with the loads of the state before.
        self.odometer.add_position(message.mobile_robot_position)
        self.odometer.loads = None if message.loads is None else len(message.loads)
        if not retained:
            self.skew.measure(message.timestamp, at.utc)

    def on_malformed(self, kind: MessageKind, problem: str, at: Timestamp) -> None:
        """Record an unreadable message and what is wrong with it."""
        self.malformed += 1
        self.problem = f"{kind}: {problem}"
        if kind is MessageKind.STATE:
            self.unreadable, self.unreadable_at = self.problem, at.monotonic

    def on_sighting(self, sighting: State) -> None:
        """Update the position from an unreadable state."""
        self.reported = sighting.mobile_robot_position or self.reported
        self.odometer.add_position(self.reported)

    def on_ignored(self, header: str, at: Timestamp) -> None:
        """Record a state that is ignored because of its ``header``."""
        if not self.ignored:  # the header may change with every message
            self.ignored = f"ignored, because neither headerId nor timestamp increases ({header})"
        self.ignored_at = at.monotonic

    def on_visualization(self, message: Visualization) -> None:
        """Update position and velocity from a visualization message."""
        self.reported = message.mobile_robot_position or self.reported
        self.odometer.add_position(self.reported)
        self.velocity = message.velocity or self.velocity

    def silence_limit(self, setting: float | None) -> float:
        """Return the silence limit, s: ``setting``, or if None, the limit derived from the factsheet."""
        if setting is not None:
            return setting
        timing = self.factsheet.protocol_limits.timing if self.factsheet else None
        interval = (timing.default_state_interval if timing else None) or 0.0
        # 30 s at most by the standard (3.0, 6.6): some factsheets have milliseconds
        return max(INTERVALS_MISSED * min(interval, 30.0), LEAST_SILENCE_LIMIT)

    def state_age(self, at: Timestamp) -> float | None:
        """Return the time since the last state, s; None before the first."""
        return None if self.state is None else max(0.0, at.monotonic - self.state_at.monotonic)

    def notice_silence(self, at: Timestamp, setting: float | None) -> bool:
        """Return True once when the silence limit has passed."""
        if self._silence_noticed or at.monotonic - self.state_at.monotonic <= self.silence_limit(setting):
            return False
        self._silence_noticed = True
        return True

    def silent_from(self, setting: float | None) -> float:
        """Return the monotonic time (s) at which it becomes silent; infinity if it already is."""
        return inf if self._silence_noticed else self.state_at.monotonic + self.silence_limit(setting)

    def update_condition(self, at: Timestamp, setting: float | None, *, link_up: bool) -> None:
        """Update the condition."""
        limit = self.silence_limit(setting)
        condition, self.reason = assess_condition(
            ConditionInputs(
                connection=self.connection.connection_state if self.connection else None,
                connection_since=self.connection_since,
                state=self.state,
                state_time=self.state_at.utc,
                state_after_connection=self.state_after_connection,
                overdue=at.monotonic - self.state_at.monotonic > limit,
                silence_limit=limit,
                link_up=link_up,
                problem=self.problem,
                unreadable=self.unreadable if at.monotonic - self.unreadable_at <= limit else "",
                ignored=self.ignored if at.monotonic - self.ignored_at <= limit else "",
                fleet_remark=self.vehicle.reason if self.vehicle else None,
                coded_remark=self.vehicle.coded_reason if self.vehicle else None,
                transport_order=self.vehicle.transport_order if self.vehicle else None,
                wait=self.vehicle.wait if self.vehicle else None,
                stop=self.vehicle.stop if self.vehicle else None,
                taken_out=self.vehicle is not None and self.vehicle.taken_out,
            )
        )
        if condition is not self.condition:
            self.condition = condition
            self.condition_since = at.utc
