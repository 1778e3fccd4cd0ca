"""Zone sets: store them, and send, enable and delete them on robots (VDA 5050 3.0, section 6.4)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import UnknownZoneSetError, ZoneSetChangedError
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.store.database import Changes
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.plant import ZoneOutline, ZoneSetAtVehicle, ZoneSetPhase, ZoneSetStatus
from nena_shared.log import get_logger
from nena_shared.tasks import forever
from nena_shared.vda5050.action import Action, ActionParameter, ActionStatus, BlockingType
from nena_shared.vda5050.state import RobotZoneSetStatus, ZoneSetState
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import nearest_codec
from nena_shared.vda5050.zone_set import ZoneSet

log = get_logger(__name__)

FIRST_PAUSE = 10.0
"""Delay before the first retry, seconds; doubles each time."""
LONGEST_PAUSE = 600.0


class Wanted(BaseModel):
    """A zone set, and its target status on the robots."""

    model_config = ConfigDict(frozen=True)

    zone_set: ZoneSet
    enabled: bool = False
    deleted: bool = False


class ZoneStep(StrEnum):
    """The next step on a robot; the values are topic and action names."""

    SEND = "zoneSet"
    ENABLE = "enableZoneSet"
    DELETE = "deleteZoneSet"


@dataclass(frozen=True, slots=True)
class Due:
    """A step that is due on a robot now."""

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
    """Schedules the attempts on each robot, with growing delays between retries."""

    def __init__(self) -> None:
        self._tries: dict[tuple[RobotKey, str], _Try] = {}

    def due(
        self,
        robot: RobotKey,
        states: Iterable[ZoneSetState],
        wanted: Mapping[str, Wanted],
        now: float,
    ) -> Iterator[Due]:
        """Yield the steps due on a robot that reports ``states``; ``now`` is in monotonic seconds."""
        known = {each.zone_set_id: each.zone_set_status for each in states}
        for name, each in wanted.items():
            step = _step(each, known.get(name))
            if step is None:
                self._tries.pop((robot, name), None)
            elif self._begins(robot, name, step, now):
                yield Due(robot, name, step)

    def note(self, robot: RobotKey, zone_set_id: str, text: str) -> None:
        """Record the result of the last attempt."""
        if known := self._tries.get((robot, zone_set_id)):
            known.note = text

    def noted(self, robot: RobotKey, zone_set_id: str) -> str:
        """Return the last attempt and its result; empty if no step is pending."""
        known = self._tries.get((robot, zone_set_id))
        return known.note if known else ""

    def _begins(self, robot: RobotKey, name: str, step: ZoneStep, now: float) -> bool:
        before = self._tries.get((robot, name))
        if before and before.step is step and now < before.again_at:
            return False
        again = before is not None and before.step is step
        pause = min(before.pause * 2, LONGEST_PAUSE) if before and again else FIRST_PAUSE
        note = before.note if before and again else f"{step} was sent; no state confirms it yet"
        self._tries[robot, name] = _Try(step, now + pause, pause, note)
        return True


def _step(wanted: Wanted, status: RobotZoneSetStatus | None) -> ZoneStep | None:
    if wanted.deleted:
        return None if status is None else ZoneStep.DELETE
    if status is None:
        return ZoneStep.SEND
    return ZoneStep.ENABLE if wanted.enabled and status is RobotZoneSetStatus.DISABLED else None


KIND = "zoneSet"
LOOK_INTERVAL = 1.0
"""Seconds between checks of the robots' zone sets."""


class ZoneSets:
    """Keeps zone sets on all robots, also on those that connect later; a stored one never changes."""

    def __init__(self, engine: Engine, send: Callable[[RobotKey, ZoneSet], None]) -> None:
        """Store zone sets in the engine's store; ``send`` publishes one to a robot."""
        self._engine = engine
        self._send = send
        self._wanted: dict[str, Wanted] = {}
        self._asked: dict[str, Wanted] = {}
        """The state including uncommitted requests of hosts; new requests are checked against it."""
        self._distribution = ZoneDistribution()

    async def load(self) -> None:
        """Restore the zone sets from before a restart."""
        for name, document in (await self._engine.store.documents(KIND)).items():
            try:
                self._wanted[name] = self._asked[name] = Wanted.model_validate_json(document)
            except ValidationError:
                log.exception("stored zone set is unreadable", zone_set=name)

    async def run(self) -> None:
        """Bring robots to the target status periodically, until cancelled."""
        await forever("zone sets", self._look_later)

    def all(self) -> tuple[ZoneSetStatus, ...]:
        """Return all zone sets."""
        return tuple(self._status(each) for each in self._wanted.values())

    def get(self, name: str) -> ZoneSetStatus:
        """Return a zone set; raises UnknownZoneSetError."""
        return self._status(self._known(name))

    async def put(self, zone_set: ZoneSet) -> ZoneSetStatus:
        """Store a zone set for all robots; the change is committed on return.

        Raises:
            ZoneSetChangedError: a different zone set with this ID is stored.
            StoreNotReadyError: the change may be lost.
        """
        known = self._asked.get(zone_set.zone_set_id)
        if known and known.zone_set != zone_set:
            raise ZoneSetChangedError(zone_set.zone_set_id)
        enabled = known is not None and known.enabled and not known.deleted
        return await self._change(Wanted(zone_set=zone_set, enabled=enabled))

    async def enable(self, name: str) -> ZoneSetStatus:
        """Enable a zone set on the robots, instead of any other one of its map."""
        wanted = self._asked_for(name)
        others = [
            each.model_copy(update={"enabled": False})
            for each in self._asked.values()
            if each.enabled and each is not wanted and each.zone_set.map_id == wanted.zone_set.map_id
        ]
        return await self._change(wanted.model_copy(update={"enabled": True, "deleted": False}), *others)

    async def delete(self, name: str) -> ZoneSetStatus:
        """Delete a zone set on all robots, including those that connect later."""
        return await self._change(
            self._asked_for(name).model_copy(update={"enabled": False, "deleted": True})
        )

    async def _change(self, wanted: Wanted, *others: Wanted) -> ZoneSetStatus:
        changed = {each.zone_set.zone_set_id: each for each in (wanted, *others)}
        changes = Changes()
        for name, each in changed.items():
            changes.documents[KIND, name] = each.model_dump_json(by_alias=True, exclude_none=True)
        self._engine.unit_of_work.require_store()
        self._asked.update(changed)
        await self._engine.unit_of_work.commit(changes, lambda: self._committed(changed))
        return self._status(wanted)

    def _committed(self, changed: dict[str, Wanted]) -> None:
        self._wanted.update(changed)
        self.look()

    def _known(self, name: str) -> Wanted:
        if name not in self._wanted:
            raise UnknownZoneSetError(name)
        return self._wanted[name]

    def _asked_for(self, name: str) -> Wanted:
        if name not in self._asked:
            raise UnknownZoneSetError(name)
        return self._asked[name]

    async def _look_later(self) -> None:
        await asyncio.sleep(LOOK_INTERVAL)
        self.look()

    def look(self) -> None:
        """Send the steps that are due to online robots."""
        if not self._wanted:
            return
        now = self._engine.clock.monotonic()
        for vehicle in self._engine.registry:
            view = self._engine.view(vehicle)
            if view.link is LinkStatus.ONLINE and view.state and self._knows_zones(vehicle):
                states = view.state.zone_sets or ()
                for due in self._distribution.due(vehicle.key, states, self._wanted, now):
                    self._do(vehicle, due)

    def _do(self, vehicle: FleetVehicle, due: Due) -> None:
        log.info("zone set", robot=str(due.robot), zone_set=due.zone_set_id, step=due.step.value)
        if due.step is ZoneStep.SEND:
            self._send(due.robot, self._wanted[due.zone_set_id].zone_set)
            return
        action = Action(
            action_type=due.step.value,
            action_id=unique_id(),
            blocking_type=BlockingType.NONE,
            action_parameters=(ActionParameter(key="zoneSetId", value=due.zone_set_id),),
        )
        end = self._engine.send_instant_action(vehicle, action)
        end.add_done_callback(partial(self._ended, due))

    def _ended(self, due: Due, end: asyncio.Future[InstantActionEnded]) -> None:
        if not end.cancelled() and end.result().status is not ActionStatus.FINISHED:
            outcome = end.result()
            words = ": ".join(filter(None, (str(outcome.reason), outcome.result)))
            self._distribution.note(due.robot, due.zone_set_id, f"{due.step} failed: {words}")

    def _knows_zones(self, vehicle: FleetVehicle) -> bool:
        state = self._engine.view(vehicle).state
        codec = nearest_codec(state.version) if state else None
        rules = codec.rules if codec else None
        return rules is not None and rules.zones

    def _status(self, wanted: Wanted) -> ZoneSetStatus:
        zone_set = wanted.zone_set
        return ZoneSetStatus(
            zone_set_id=zone_set.zone_set_id,
            map_id=zone_set.map_id,
            zones=len(zone_set.zones),
            outlines=tuple(
                ZoneOutline(
                    zone_id=each.zone_id,
                    zone_type=each.zone_type,
                    vertices=tuple((corner.x, corner.y) for corner in each.vertices),
                )
                for each in zone_set.zones
            ),
            enabled=wanted.enabled,
            deleted=wanted.deleted,
            vehicles=tuple(
                self._at(vehicle, zone_set.zone_set_id)
                for vehicle in self._engine.registry
                if self._engine.view(vehicle).state is None or self._knows_zones(vehicle)
            ),
        )

    def _at(self, vehicle: FleetVehicle, name: str) -> ZoneSetAtVehicle:
        state = self._engine.view(vehicle).state
        phase = ZoneSetPhase.UNKNOWN if state is None else ZoneSetPhase.MISSING
        for each in (state.zone_sets or ()) if state else ():
            if each.zone_set_id == name:
                phase = ZoneSetPhase(each.zone_set_status.value)
        note = self._distribution.noted(vehicle.key, name)
        return ZoneSetAtVehicle(vehicle=vehicle.name, phase=phase, note=note)
