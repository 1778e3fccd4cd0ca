"""Tells what happens to robots and orders, and counts it."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot

from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.vda5050.brief.state import PositionBrief, StateBrief
from nena_status_aggregator.fleet.condition import Condition, Reason
from nena_status_aggregator.fleet.events import Code, Happening, Values, changes
from nena_status_aggregator.fleet.robot import Instant, Robot
from nena_status_aggregator.fleet.statistics import Statistics
from nena_status_aggregator.fleet.view_builder import short

Tell = Callable[[Happening], None]

STANDING = (Condition.OFFLINE, Condition.SILENT, Condition.MANUAL, Condition.ERROR, Condition.BLOCKED)
"""Conditions of which each new reason is told; a busy robot has another one at every node."""


class Chronicle:
    """Makes a :class:`Happening` of each change and hands it to ``tell``."""

    def __init__(self, statistics: Statistics, tell: Tell, *, track_distance: float) -> None:
        """``track_distance``: m after which a position is told again; 0: none is."""
        self._statistics = statistics
        self._tell = tell
        self._track_distance = track_distance

    def state(self, robot: Robot, before: StateBrief | None, now: StateBrief, at: Instant) -> None:
        """Tell what has happened between two states."""
        for change in changes(before, now):
            self._statistics.count_change(change.code, change.values)
            self._of_robot(robot, change.code, change.text, change.values, at)

    def position(self, robot: Robot, at: Instant) -> None:
        """Tell where a robot is, if that is far enough from where it was told last."""
        here, last = robot.position, robot.tracked
        if not self._track_distance or here is None:
            return
        near = last is not None and last.map_id == here.map_id and _way(last, here) < self._track_distance
        if near:
            return
        robot.tracked = here
        values: Values = {"x": here.x, "y": here.y, "theta": here.theta, "mapId": here.map_id}
        self._of_robot(robot, Code.POSITION, f"At {here.x:.2f}, {here.y:.2f}.", values, at)

    def connection(self, robot: Robot, before: str | None, at: Instant) -> None:
        """Tell of a connection message, if it says anything new."""
        now = robot.connection.connection_state.value if robot.connection else None
        if now != before:
            text = f"Connection {now}."
            self._of_robot(robot, Code.CONNECTION, text, {"state": now, "before": before}, at)

    def condition(self, robot: Robot, before: tuple[Condition, Reason], at: Instant) -> None:
        """Tell of a new condition, and of a new reason to stand."""
        condition, reason = before
        changed = condition is not robot.condition
        if changed or (robot.condition in STANDING and reason.code != robot.reason.code):
            values: Values = {
                "condition": robot.condition.value,
                "before": condition.value,
                "reason": robot.reason.code,
            }
            self._of_robot(robot, Code.CONDITION, short(robot.reason.text) or "", values, at)

    def forgotten(self, robot: Robot, at: Instant) -> None:
        """Tell that a robot made room."""
        self._of_robot(robot, Code.ROBOT_FORGOTTEN, "Not heard of for too long; it made room.", {}, at)

    def order(self, before: TransportOrderStatus | None, now: TransportOrderStatus, at: Instant) -> None:
        """Tell of a transport order that is in another state, or waits for something else."""
        if before and (before.state, before.reason) == (now.state, now.reason):
            return
        values: Values = {
            "state": now.state.value,
            "before": before.state.value if before else None,
            "vehicle": now.processing_vehicle,
        }
        text = f"{now.state}: {short(now.reason)}"
        self._tell(Happening(at.utc, Code.TRANSPORT_ORDER, text, order=now.name, values=values))

    def link(self, *, connected: bool, at: Instant) -> None:
        """Tell that the link to the broker stands, or is lost."""
        text = "The link to the broker stands." if connected else "The link to the broker is lost."
        self._tell(Happening(at.utc, Code.LINK, text, values={"connected": connected}))

    def _of_robot(self, robot: Robot, code: Code, text: str, values: Values, at: Instant) -> None:
        self._tell(Happening(at.utc, code, text, robot.id, _order_of(robot), values))


def _way(start: PositionBrief, end: PositionBrief) -> float:
    return hypot(end.x - start.x, end.y - start.y)


def _order_of(robot: Robot) -> str | None:
    if robot.vehicle and robot.vehicle.transport_order:
        return robot.vehicle.transport_order
    return short(robot.state.order_id) or None if robot.state else None
