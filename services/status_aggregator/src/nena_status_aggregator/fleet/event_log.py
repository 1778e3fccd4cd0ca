"""The event log: turns changes of robots and orders into events, and counts them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import hypot

from nena_shared.fleet_api.stops import StopStatus
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.vda5050.state import State
from nena_status_aggregator.fleet.condition import Condition, ConditionReason
from nena_status_aggregator.fleet.events import Code, Event, Values, state_changes
from nena_status_aggregator.fleet.robot import Robot, Timestamp
from nena_status_aggregator.fleet.statistics import Statistics
from nena_status_aggregator.fleet.view_builder import short, view_reason

Publish = Callable[[Event], None]

NOT_MOVING = (
    Condition.OFFLINE,
    Condition.SILENT,
    Condition.MANUAL,
    Condition.ERROR,
    Condition.BLOCKED,
    Condition.WAITING,
)
"""Conditions in which a new reason is an event. While a robot is busy, it changes at every node."""


class EventLog:
    """Creates an :class:`Event` for each change and passes it to ``publish``."""

    def __init__(self, statistics: Statistics, publish: Publish, *, track_distance: float) -> None:
        """``track_distance``: m between two position events; 0 disables them."""
        self._statistics = statistics
        self._publish = publish
        self._track_distance = track_distance
        self._jams: dict[str, int] = {}
        self._stops: dict[str, StopStatus] = {}
        self._started = False
        """Whether the program has been connected to the broker."""

    def log_state(self, robot: Robot, before: State | None, now: State, at: Timestamp) -> None:
        """Log the changes between two states."""
        for change in state_changes(before, now):
            self._statistics.count_change(change.code, change.values)
            values = change.values
            if change.code is Code.ORDER_ENDED:
                distance, empty = robot.odometer.end_trip()
                values = {**values, "distance": distance, "emptyDistance": empty}
            self._publish_robot_event(robot, change.code, change.text, values, at)

    def log_position(self, robot: Robot, at: Timestamp) -> None:
        """Log a position that is far enough from the last logged one."""
        position, last = robot.position, robot.tracked
        if not self._track_distance or position is None:
            return
        is_same_map = last is not None and last.map_id == position.map_id
        if last and is_same_map and hypot(position.x - last.x, position.y - last.y) < self._track_distance:
            return
        robot.tracked = position
        values: Values = {"x": position.x, "y": position.y, "theta": position.theta, "mapId": position.map_id}
        self._publish_robot_event(robot, Code.POSITION, f"At {position.x:.2f}, {position.y:.2f}.", values, at)

    def log_connection(self, robot: Robot, before: str | None, at: Timestamp) -> None:
        """Log a change of the connection state."""
        state = robot.connection.connection_state.value if robot.connection else None
        if state != before:
            text = f"Connection {state}."
            self._publish_robot_event(robot, Code.CONNECTION, text, {"state": state, "before": before}, at)

    def log_condition(self, robot: Robot, before: tuple[Condition, ConditionReason], at: Timestamp) -> None:
        """Log a new condition, or a new reason for not moving."""
        condition, reason = before
        changed = condition is not robot.condition
        if changed or (robot.condition in NOT_MOVING and reason.code != robot.reason.code):
            values: Values = {
                **{
                    key: short(value) if isinstance(value, str) else value
                    for key, value in robot.reason.values.items()
                },
                **robot.reason.shown,
                "condition": robot.condition.value,
                "before": condition.value,
                "reason": robot.reason.code,
            }
            if coded := view_reason(robot.reason.coded):
                values["codedReason"] = coded
            self._publish_robot_event(robot, Code.CONDITION, short(robot.reason.text) or "", values, at)

    def log_forgotten(self, robot: Robot, at: Timestamp) -> None:
        """Log that a silent robot was removed."""
        self._publish_robot_event(
            robot, Code.ROBOT_FORGOTTEN, "Removed for a new robot: no messages for too long.", {}, at
        )

    def log_order(
        self, before: TransportOrderStatus | None, now: TransportOrderStatus, at: Timestamp
    ) -> None:
        """Log a new state or reason of a transport order."""
        if before and (before.state, before.reason) == (now.state, now.reason):
            return
        values: Values = {
            "state": now.state.value,
            "before": before.state.value if before else None,
            "reason": short(now.reason),
            "codedReason": view_reason(now.coded_reason),
            "vehicle": now.processing_vehicle,
        }
        if now.state.final:
            # Reports are computed from the history alone, when the order itself may be forgotten.
            seconds = (now.finished - now.created).total_seconds() if now.finished else None
            values |= {
                "leadTime": None if seconds is None else max(0.0, seconds),
                "late": now.late if now.deadline else None,
                "automatic": now.automatic,
                "outcome": now.ended_as,
            }
        text = f"{now.state}: {values['reason']}"
        self._publish(Event(at.utc, Code.TRANSPORT_ORDER, text, order=now.name, values=values))

    def log_jams(self, jams: dict[str, int], at: Timestamp) -> None:
        """Log the numbers of robots that wait behind the heads of jams, by the IDs of the heads."""
        for robot in self._jams | jams:
            robots = jams.get(robot, 0)
            if robots != self._jams.get(robot, 0):
                text = f"{robots} robots wait behind it." if robots else "The jam behind it is over."
                self._publish(Event(at.utc, Code.JAM, text, robot, values={"robots": robots}))
        self._jams = jams

    def log_stops(self, stops: Iterable[StopStatus], at: Timestamp) -> None:
        """Log the stops that have begun or ended."""
        now = {stop.name: stop for stop in stops}
        for name, stop in (self._stops | now).items():
            if (name in now) is not (name in self._stops):
                values: Values = {"stop": name, "active": name in now, "by": stop.by, "reason": stop.reason}
                area = stop.area.model_dump(by_alias=True) if stop.area else {}
                text = f"{'Stop' if name in now else 'End of the stop'} by {stop.by}: {stop.reason}"
                self._publish(Event(at.utc, Code.STOP, text, values=values | area))
        self._stops = now

    def log_link(self, *, connected: bool, at: Timestamp) -> None:
        """Log that the broker connection was established or lost."""
        text = "Connected to the broker." if connected else "Connection to the broker lost."
        values: Values = {"connected": connected}
        # Reports must not count the time before a start as a loss of the connection.
        if connected and not self._started:
            self._started = values["started"] = True
        self._publish(Event(at.utc, Code.LINK, text, values=values))

    def _publish_robot_event(
        self, robot: Robot, code: Code, text: str, values: Values, at: Timestamp
    ) -> None:
        order = robot.vehicle.transport_order if robot.vehicle else None
        if not order and robot.state:
            # A fleet without NeNa's order service has no transport orders, only the robots' own ones.
            order = short(robot.state.order_id) or None
        self._publish(Event(at.utc, code, text, robot.id, order or None, values))
