"""Zone sets: store them, and send, enable and delete them on robots (VDA 5050 3.0, section 6.4)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import RefusedError, UnknownError
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.store.database import Changes
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.plant import ZoneOutline, ZoneSetAtVehicle, ZoneSetPhase, ZoneSetStatus
from nena_shared.fleet_api.refusals import Refusal
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


class WantedZoneSet(BaseModel):
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
class DueStep:
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

    def due_steps(
        self,
        robot: RobotKey,
        states: Iterable[ZoneSetState],
        wanted: Mapping[str, WantedZoneSet],
        now: float,
    ) -> Iterator[DueStep]:
        """Yield the steps due on a robot that reports ``states``; ``now`` is in monotonic seconds."""
        reported = {zone_set.zone_set_id: zone_set.zone_set_status for zone_set in states}
        for name, zone_set in wanted.items():
            step = _next_step(zone_set, reported.get(name))
            last = self._tries.get((robot, name))
            if step is None:
                self._tries.pop((robot, name), None)
            elif last is None or last.step is not step:
                note = f"{step} was sent; no state confirms it yet"
                self._tries[robot, name] = _Try(step, now + FIRST_PAUSE, FIRST_PAUSE, note)
                yield DueStep(robot, name, step)
            elif now >= last.again_at:
                last.pause = min(last.pause * 2, LONGEST_PAUSE)
                last.again_at = now + last.pause
                yield DueStep(robot, name, step)

    def record_result(self, robot: RobotKey, zone_set_id: str, text: str) -> None:
        """Record the result of the last attempt."""
        if last := self._tries.get((robot, zone_set_id)):
            last.note = text

    def last_result(self, robot: RobotKey, zone_set_id: str) -> str:
        """Return the last attempt and its result; empty if no step is pending."""
        last = self._tries.get((robot, zone_set_id))
        return last.note if last else ""


def _next_step(wanted: WantedZoneSet, status: RobotZoneSetStatus | None) -> ZoneStep | None:
    # VDA 5050 3.0, 6.4: a robot has a new zone set DISABLED until enableZoneSet, with which it disables the
    # others of the same map: to disable one, nothing is sent.
    if wanted.deleted:
        return None if status is None else ZoneStep.DELETE
    if status is None:
        return ZoneStep.SEND
    return ZoneStep.ENABLE if wanted.enabled and status is RobotZoneSetStatus.DISABLED else None


KIND = "zoneSet"
CHECK_INTERVAL = 1.0
"""Seconds between checks of the robots' zone sets."""


class ZoneSets:
    """Keeps zone sets on all robots, also on those that connect later; a stored one never changes."""

    def __init__(self, engine: Engine, send: Callable[[RobotKey, ZoneSet], None]) -> None:
        """Store zone sets in the engine's store; ``send`` publishes one to a robot."""
        self._engine = engine
        self._send_zone_set = send
        self._wanted: dict[str, WantedZoneSet] = {}
        self._requested: dict[str, WantedZoneSet] = {}
        """The state including uncommitted requests of hosts; new requests are checked against it."""
        self._distribution = ZoneDistribution()

    async def load(self) -> None:
        """Restore the zone sets from before a restart."""
        for name, document in (await self._engine.store.documents(KIND)).items():
            try:
                self._wanted[name] = self._requested[name] = WantedZoneSet.model_validate_json(document)
            except ValidationError:
                log.exception("stored zone set is unreadable", zone_set=name)

    async def run(self) -> None:
        """Bring robots to the target status periodically, until cancelled."""

        async def check_later() -> None:
            await asyncio.sleep(CHECK_INTERVAL)
            self.send_due_steps()

        await forever("zone sets", check_later)

    def all(self) -> tuple[ZoneSetStatus, ...]:
        """Return all zone sets."""
        return tuple(map(self._status_of, self._wanted.values()))

    def get(self, name: str) -> ZoneSetStatus:
        """Return a zone set; raises UnknownError."""
        if name not in self._wanted:
            raise UnknownError(Refusal.UNKNOWN_ZONE_SET, name)
        return self._status_of(self._wanted[name])

    async def put(self, zone_set: ZoneSet) -> ZoneSetStatus:
        """Store a zone set for all robots; the change is committed on return.

        Raises:
            RefusedError: a different zone set with this ID is stored.
            StoreNotReadyError: the change may be lost.
        """
        previous = self._requested.get(zone_set.zone_set_id)
        # VDA 5050 3.0, 6.4: the content of a zoneSetId never changes; robots reject another one
        # (DUPLICATE_ZONE_SET), and states, which name the ID only, would not show which one a robot has.
        if previous and previous.zone_set != zone_set:
            raise RefusedError(
                Refusal.ZONE_SET_CHANGED,
                f"A different zone set {zone_set.zone_set_id!r} already exists, and a stored zone set never "
                "changes. Choose a new zoneSetId.",
            )
        enabled = previous is not None and previous.enabled and not previous.deleted
        return await self._change(WantedZoneSet(zone_set=zone_set, enabled=enabled))

    async def enable(self, name: str) -> ZoneSetStatus:
        """Enable a zone set on the robots, instead of any other one of its map."""
        wanted, map_id = self._requested_state(name), self._requested_state(name).zone_set.map_id
        others = [
            zone_set.model_copy(update={"enabled": False})
            for zone_set in self._requested.values()
            if zone_set.enabled and zone_set is not wanted and zone_set.zone_set.map_id == map_id
        ]
        return await self._change(wanted.model_copy(update={"enabled": True, "deleted": False}), *others)

    async def delete(self, name: str) -> ZoneSetStatus:
        """Delete a zone set on all robots, including those that connect later."""
        return await self._change(
            self._requested_state(name).model_copy(update={"enabled": False, "deleted": True})
        )

    async def _change(self, wanted: WantedZoneSet, *others: WantedZoneSet) -> ZoneSetStatus:
        changed = {zone_set.zone_set.zone_set_id: zone_set for zone_set in (wanted, *others)}
        changes = Changes()
        for name, zone_set in changed.items():
            changes.documents[KIND, name] = zone_set.model_dump_json(by_alias=True, exclude_none=True)
        self._engine.unit_of_work.require_store()
        self._requested.update(changed)

        def apply_committed() -> None:
            self._wanted.update(changed)
            self.send_due_steps()

        await self._engine.unit_of_work.commit(changes, apply_committed)
        return self._status_of(wanted)

    def _requested_state(self, name: str) -> WantedZoneSet:
        if name not in self._requested:
            raise UnknownError(Refusal.UNKNOWN_ZONE_SET, name)
        return self._requested[name]

    def send_due_steps(self) -> None:
        """Send the steps that are due to online robots."""
        if not self._wanted:
            return
        now = self._engine.clock.monotonic()
        for vehicle in self._engine.registry:
            view = self._engine.view(vehicle)
            if view.link is LinkStatus.ONLINE and view.state and self._knows_zones(vehicle):
                states = view.state.zone_sets or ()
                for due in self._distribution.due_steps(vehicle.key, states, self._wanted, now):
                    self._send_step(vehicle, due)

    def _send_step(self, vehicle: FleetVehicle, due: DueStep) -> None:
        log.info("zone set", robot=str(due.robot), zone_set=due.zone_set_id, step=due.step.value)
        if due.step is ZoneStep.SEND:
            self._send_zone_set(due.robot, self._wanted[due.zone_set_id].zone_set)
            return
        action = Action(
            action_type=due.step.value,
            action_id=unique_id(),
            blocking_type=BlockingType.NONE,
            action_parameters=(ActionParameter(key="zoneSetId", value=due.zone_set_id),),
        )
        end = self._engine.send_instant_action(vehicle, action)
        end.add_done_callback(partial(self._on_action_ended, due))

    def _on_action_ended(self, due: DueStep, end: asyncio.Future[InstantActionEnded]) -> None:
        if not end.cancelled() and end.result().status is not ActionStatus.FINISHED:
            outcome = end.result()
            problem = ": ".join(filter(None, (str(outcome.reason), outcome.result)))
            self._distribution.record_result(due.robot, due.zone_set_id, f"{due.step} failed: {problem}")

    def _knows_zones(self, vehicle: FleetVehicle) -> bool:
        state = self._engine.view(vehicle).state
        codec = nearest_codec(state.version) if state else None
        return codec is not None and codec.rules.zones

    def _status_of(self, wanted: WantedZoneSet) -> ZoneSetStatus:
        zone_set = wanted.zone_set
        return ZoneSetStatus(
            zone_set_id=zone_set.zone_set_id,
            map_id=zone_set.map_id,
            zones=len(zone_set.zones),
            outlines=tuple(
                ZoneOutline(
                    zone_id=zone.zone_id,
                    zone_type=zone.zone_type,
                    vertices=tuple((corner.x, corner.y) for corner in zone.vertices),
                )
                for zone in zone_set.zones
            ),
            enabled=wanted.enabled,
            deleted=wanted.deleted,
            vehicles=tuple(
                self._status_at(vehicle, zone_set.zone_set_id)
                for vehicle in self._engine.registry
                if self._engine.view(vehicle).state is None or self._knows_zones(vehicle)
            ),
        )

    def _status_at(self, vehicle: FleetVehicle, name: str) -> ZoneSetAtVehicle:
        state = self._engine.view(vehicle).state
        phase = ZoneSetPhase.UNKNOWN if state is None else ZoneSetPhase.MISSING
        for zone_set in (state.zone_sets or ()) if state else ():
            if zone_set.zone_set_id == name:
                phase = ZoneSetPhase(zone_set.zone_set_status.value)
        note = self._distribution.last_result(vehicle.key, name)
        return ZoneSetAtVehicle(vehicle=vehicle.name, phase=phase, note=note)
