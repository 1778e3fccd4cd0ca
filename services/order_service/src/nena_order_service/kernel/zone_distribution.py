"""Which zone sets a robot is to be sent, to enable or to delete, from its states (VDA 5050 3.0 6.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from nena_shared.vda5050.brief.state import ZoneSetBrief
from nena_shared.vda5050.state import ZoneSetState, ZoneSetStatus
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.zone_set import ZoneSet

FIRST_PAUSE = 10.0
"""Seconds until something is tried again; then twice as long each time."""
LONGEST_PAUSE = 600.0


class Wanted(BaseModel):
    """A zone set, and what robots are to do with it."""

    model_config = ConfigDict(frozen=True)

    zone_set: ZoneSet
    enabled: bool = False
    deleted: bool = False


class ZoneStep(StrEnum):
    """What is to be done at a robot; the actions by their names."""

    SEND = "zoneSet"
    ENABLE = "enableZoneSet"
    DELETE = "deleteZoneSet"


@dataclass(frozen=True, slots=True)
class Due:
    """Something to do at a robot now."""

    robot: RobotKey
    zone_set_id: str
    step: ZoneStep


@dataclass(slots=True)
class _Try:
    step: ZoneStep
    again_at: float
    pause: float
    note: str


class ZoneDistribution:
    """Remembers what was tried at each robot, so that nothing is asked for too often."""

    def __init__(self) -> None:
        self._tries: dict[tuple[RobotKey, str], _Try] = {}

    def due(
        self,
        robot: RobotKey,
        states: Iterable[ZoneSetState | ZoneSetBrief],
        wanted: Mapping[str, Wanted],
        now: float,
    ) -> Iterator[Due]:
        """Give what is to be done at a robot that reports ``states``, at ``now`` in monotonic seconds."""
        known = {each.zone_set_id: each.zone_set_status for each in states}
        for name, each in wanted.items():
            step = _step(each, known.get(name))
            if step is None:
                self._tries.pop((robot, name), None)
            elif self._begins(robot, name, step, now):
                yield Due(robot, name, step)

    def note(self, robot: RobotKey, zone_set_id: str, text: str) -> None:
        """Note what came of what was tried last."""
        if known := self._tries.get((robot, zone_set_id)):
            known.note = text

    def noted(self, robot: RobotKey, zone_set_id: str) -> str:
        """Say what was tried last, and what came of it; empty for nothing that is left to do."""
        known = self._tries.get((robot, zone_set_id))
        return known.note if known else ""

    def _begins(self, robot: RobotKey, name: str, step: ZoneStep, now: float) -> bool:
        before = self._tries.get((robot, name))
        if before and before.step is step and now < before.again_at:
            return False
        again = before is not None and before.step is step
        pause = min(before.pause * 2, LONGEST_PAUSE) if before and again else FIRST_PAUSE
        note = before.note if before and again else f"{step} was sent, and no state shows it yet"
        self._tries[robot, name] = _Try(step, now + pause, pause, note)
        return True


def _step(wanted: Wanted, status: ZoneSetStatus | None) -> ZoneStep | None:
    if wanted.deleted:
        return None if status is None else ZoneStep.DELETE
    if status is None:
        return ZoneStep.SEND
    return ZoneStep.ENABLE if wanted.enabled and status is ZoneSetStatus.DISABLED else None
