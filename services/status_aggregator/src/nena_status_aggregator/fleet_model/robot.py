"""What is known of one robot."""

from __future__ import annotations

from datetime import timedelta
from math import inf

from nena_shared.fleet_api.robot_map import RobotMap
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.vda5050.brief.state import PositionBrief, StateBrief, VelocityBrief, VisualizationBrief
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet_model.clock_skew import ClockSkew
from nena_status_aggregator.fleet_model.condition import Condition, Evidence, Reason, judge
from nena_status_aggregator.fleet_model.instant import Instant
from nena_status_aggregator.fleet_model.message_kind import MessageKind
from nena_status_aggregator.fleet_model.odometer import Odometer
from nena_status_aggregator.fleet_model.order_progress import OrderProgress
from nena_status_aggregator.fleet_model.plant_frame import PlantFrame
from nena_status_aggregator.fleet_model.sequence import Sequence

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
