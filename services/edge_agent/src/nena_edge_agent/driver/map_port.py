"""The port of drivers whose robot has its own map: everything is in the frame of that map.

Its types have the same fields as those of the plant's frame (:mod:`nena_edge_agent.driver.port`), but
differ, so that the frames cannot be confused. Only :mod:`nena_edge_agent.driver.plant_frame` converts between
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from nena_edge_agent.driver.port import (
    BaseArea,
    BaseDriver,
    BaseGoal,
    BaseOwnGoals,
    BasePoseReport,
    FrameIndependentEvent,
)


@dataclass(frozen=True, slots=True)
class MapPose:
    """A position and heading: m and rad in the frame of the robot's own map ``map_id``."""

    x: float
    y: float
    theta: float
    map_id: str


class MapGoal(BaseGoal[MapPose]):
    """A goal on the robot's map; lengths are in metres of that map."""

    __slots__ = ()


class MapPoseReport(BasePoseReport[MapPose]):
    """A pose on the robot's map."""

    __slots__ = ()


class MapOwnGoals(BaseOwnGoals[MapPose]):
    """Own goals of an earlier run, on the robot's map."""

    __slots__ = ()


class MapArea(BaseArea):
    """An area on the robot's map that it must not enter."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class MapPlanReport:
    """Navigation's plan: at least two points, in m on the map ``map_id``."""

    points: tuple[tuple[float, float], ...]
    map_id: str


MapDriverEvent = FrameIndependentEvent | MapPoseReport | MapPlanReport
MapEmit = Callable[[MapDriverEvent], None]


class MapDriver(BaseDriver, Protocol):
    """A driver on the robot's own map; otherwise like :class:`nena_edge_agent.driver.port.Driver`."""

    def reclaim(self, goals: MapOwnGoals) -> None:
        """Treat ``goals`` as this robot's own if navigation still drives to them."""
        ...

    def go_to(self, goal: MapGoal) -> None:
        """Drive to ``goal``; a current goal is replaced without a stop and without an event."""
        ...

    def keep_out(self, areas: tuple[MapArea, ...]) -> None:
        """Make navigation plan around ``areas``, and around no others."""
        ...

    def initialize_position(self, pose: MapPose) -> None:
        """Set the robot's pose in the localisation."""
        ...
