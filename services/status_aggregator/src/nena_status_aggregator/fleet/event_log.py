"""The event log: turns changes of robots and orders into events, and counts them."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot

from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.vda5050.state import MobileRobotPosition, State
from nena_status_aggregator.fleet.condition import Condition, ConditionReason
from nena_status_aggregator.fleet.events import Code, Event, Values, changes
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
        self._started = False
        """Whether the program has been connected to the broker."""

    def state(self, robot: Robot, before: State | None, now: State, at: Timestamp) -> None:
        """Log the changes between two states."""
        for change in changes(before, now):
            self._statistics.count_change(change.code, change.values)
            values = change.values
            if change.code is Code.ORDER_ENDED:
                distance, empty = robot.odometer.end_trip()
                values = {**values, "distance": distance, "emptyDistance": empty}
            self._of_robot(robot, change.code, change.text, values, at)

    def position(self, robot: Robot, at: Timestamp) -> None:
        """Log a position that is far enough from the last logged one."""
        here, last = robot.position, robot.tracked
        if not self._track_distance or here is None:
            return
        near = (
            last is not None
            and last.map_id == here.map_id
            and _distance_between(last, here) < self._track_distance
        )
        if near:
            return
        robot.tracked = here
        values: Values = {"x": here.x, "y": here.y, "theta": here.theta, "mapId": here.map_id}
        self._of_robot(robot, Code.POSITION, f"At {here.x:.2f}, {here.y:.2f}.", values, at)

    def connection(self, robot: Robot, before: str | None, at: Timestamp) -> None:
        """Log a change of the connection state."""
        now = robot.connection.connection_state.value if robot.connection else None
        if now != before:
            text = f"Connection {now}."
            self._of_robot(robot, Code.CONNECTION, text, {"state": now, "before": before}, at)

    def condition(self, robot: Robot, before: tuple[Condition, ConditionReason], at: Timestamp) -> None:
        """Log a new condition, or a new reason for not moving."""
        condition, reason = before
        changed = condition is not robot.condition
        if changed or (robot.condition in NOT_MOVING and reason.code != robot.reason.code):
            values: Values = {
                **{key: _shorten_value(value) for key, value in robot.reason.values.items()},
                **robot.reason.shown,
                "condition": robot.condition.value,
                "before": condition.value,
                "reason": robot.reason.code,
            }
            if coded := view_reason(robot.reason.coded):
                values["codedReason"] = coded
            self._of_robot(robot, Code.CONDITION, short(robot.reason.text) or "", values, at)

    def forgotten(self, robot: Robot, at: Timestamp) -> None:
        """Log that a silent robot was removed."""
        self._of_robot(
            robot, Code.ROBOT_FORGOTTEN, "Removed for a new robot: no messages for too long.", {}, at
        )

    def order(self, before: TransportOrderStatus | None, now: TransportOrderStatus, at: Timestamp) -> None:
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
            values.update(_end_values(now))
        text = f"{now.state}: {values['reason']}"
        self._publish(Event(at.utc, Code.TRANSPORT_ORDER, text, order=now.name, values=values))

    def link(self, *, connected: bool, at: Timestamp) -> None:
        """Log that the broker connection was established or lost."""
        text = "Connected to the broker." if connected else "Connection to the broker lost."
        values: Values = {"connected": connected}
        if connected and not self._started:
            self._started = values["started"] = True
        self._publish(Event(at.utc, Code.LINK, text, values=values))

    def _of_robot(self, robot: Robot, code: Code, text: str, values: Values, at: Timestamp) -> None:
        self._publish(Event(at.utc, code, text, robot.id, _order_of(robot), values))


def _end_values(order: TransportOrderStatus) -> Values:
    """Return what reports need of an ended order."""
    seconds = (order.finished - order.created).total_seconds() if order.finished else None
    return {
        "leadTime": None if seconds is None else max(0.0, seconds),
        "late": order.late if order.deadline else None,
        "automatic": order.automatic,
        "gaveWay": order.gave_way,
    }


def _shorten_value(value: str | float) -> str | float | None:
    return short(value) if isinstance(value, str) else value


def _distance_between(start: MobileRobotPosition, end: MobileRobotPosition) -> float:
    return hypot(end.x - start.x, end.y - start.y)


def _order_of(robot: Robot) -> str | None:
    if robot.vehicle and robot.vehicle.transport_order:
        return robot.vehicle.transport_order
    return short(robot.state.order_id) or None if robot.state else None
