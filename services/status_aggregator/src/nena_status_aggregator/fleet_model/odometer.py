"""How far a robot has driven, by the positions that it reports."""

from __future__ import annotations

from math import hypot

from nena_shared.vda5050.brief.state import PositionBrief

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
