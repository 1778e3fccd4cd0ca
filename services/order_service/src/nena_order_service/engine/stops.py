"""Stops: pause all robots, or those in an area, until a person ends it.

A robot is paused with the instant action startPause, and gets no further base or order meanwhile. A stop of
an area also locks its paths, so that other robots drive around it. Stops, and the robots that they have
paused, are stored before anything is sent: after a restart, robots stay paused, and continue when the stop
ends. A robot that was paused before, or that a person pauses during the stop, stays paused at its end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_order_service.engine.context import Context
from nena_order_service.errors import RefusedError, UnknownError
from nena_order_service.fleet.instant_actions import START_PAUSE
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import NOT_REACHED, LinkStatus, RobotView
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.traffic.areas import resources_in
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.stops import (
    Area,
    DirectStop,
    StopRequest,
    StopStatus,
    UnpausedVehicle,
    VehicleStop,
)
from nena_shared.log import get_logger
from nena_shared.plant import MapPlace
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.malformed import problems_of
from nena_shared.vda5050.topics import RobotKey

R = ReasonCode

log = get_logger(__name__)

STOP_PAUSE: Final = "stopPause"

STOP: Final = "stop"
STOPPED_ROBOT: Final = "stoppedRobot"
"""Kinds of documents in the store."""

STOPS_LIMIT: Final = 50
"""Maximum number of active stops."""

RETRY_AFTER: Final = 5.0
"""Seconds after which a robot is sent startPause or stopPause again if it did not execute it."""

PERSON_PAUSES_FOR: Final = 10.0
"""Seconds for which a host's startPause counts although the robot does not report that it is paused yet."""

UNCONFIRMED: Final = Reason(R.PAUSE_UNCONFIRMED)

D = TypeVar("D", bound=BaseModel)


class FleetStop(BaseModel):
    """A stop as stored."""

    model_config = ConfigDict(frozen=True)

    number: int
    name: str
    by: str
    reason: str
    since: datetime
    area: Area | None = None

    def with_status(self, **status: Any) -> StopStatus:  # noqa: ANN401 - other fields of the status
        """Return the stop for hosts."""
        return StopStatus(**self.model_dump(exclude={"number", "area"}), area=self.area, **status)

    @property
    def as_reason(self) -> Reason:
        """Who pauses which robots and why, for the reasons of vehicles and orders."""
        return Reason(R.AREA_PAUSED if self.area else R.ALL_PAUSED, self.reason, by=self.by)


class StoppedRobot(BaseModel):
    """A robot that stops pause, as stored."""

    model_config = ConfigDict(frozen=True)

    manufacturer: str
    serial_number: str
    stops: tuple[str, ...] = ()
    """The stops that pause it; empty while it has not confirmed yet that it continues."""
    resume: bool
    """Whether it continues at the end; False: it was paused before, or a person has paused it meanwhile."""

    @property
    def key(self) -> RobotKey:
        """The robot."""
        return RobotKey(self.manufacturer, self.serial_number)


@dataclass(slots=True)
class _Attempt:
    """The last startPause or stopPause that a robot was sent."""

    action_type: str
    action_id: str
    running: bool = True
    again_at: float = 0.0
    note: str = ""
    """Why the robot did not execute it."""


class ClosedGate:
    """A gate that allocates and releases nothing."""

    def may_allocate(self, index: int) -> bool:
        """Return False."""
        del index
        return False

    may_release = may_allocate


CLOSED: Final = ClosedGate()


class Stops:
    """Changes stops, and pauses and resumes robots, in the engine's units of work."""

    def __init__(self, context: Context) -> None:
        self.listeners: list[Callable[[], None]] = []
        """Called when a stop has begun or ended, after the commit."""
        self._context = context
        self._state = context.state
        self._clock = context.clock
        self._stops: dict[str, FleetStop] = {}
        self._visible: dict[str, FleetStop] = {}
        """The active stops that are in the store, by name."""
        self._resources: dict[str, frozenset[str]] = {}
        """The points and paths in the area of each stop; none for a stop of all robots."""
        self._robots: dict[RobotKey, StoppedRobot] = {}
        self._attempts: dict[RobotKey, _Attempt] = {}
        self._person_paused: dict[RobotKey, float] = {}
        """Times of hosts' startPause actions, monotonic seconds."""

    def load(self, stops: Mapping[str, str], robots: Mapping[str, str]) -> None:
        """Read the documents of the store; unreadable ones are logged and left out."""
        for stop in sorted(_read_documents(FleetStop, stops), key=lambda stop: stop.number):
            self._add_stop(stop)
        self._lock_areas(*self._stops.values())
        self._visible = dict(self._stops)
        self._robots = {robot.key: robot for robot in _read_documents(StoppedRobot, robots)}

    # Stops

    @property
    def all_robots(self) -> FleetStop | None:
        """The oldest stop of all robots; None if there is none."""
        return next((stop for stop in self._stops.values() if stop.area is None), None)

    def get(self, name: str) -> FleetStop:
        """Return an active stop; raises UnknownError."""
        if name not in self._stops:
            raise UnknownError(Refusal.UNKNOWN_STOP, name)
        return self._stops[name]

    def begin(self, request: StopRequest, by: str) -> FleetStop:
        """Begin a stop; raises RefusedError."""
        if len(self._stops) >= STOPS_LIMIT:
            text = f"{STOPS_LIMIT} stops are active. End one of them first."
            raise RefusedError(Refusal.TOO_MANY_STOPS, text)
        stop = FleetStop(
            number=self._next_number(),
            name=f"stop-{unique_id()[:8]}",
            by=by,
            reason=request.reason,
            since=self._clock.now(),
            area=request.area,
        )
        self._begin(stop)
        return stop

    def same_as(self, direct: DirectStop) -> FleetStop | None:
        """Return the active stop for the same request, which may arrive after the aggregator gave it up."""
        wanted = direct.by, direct.reason, None
        return next(
            (each for each in self._stops.values() if (each.by, each.reason, each.area) == wanted), None
        )

    def continue_direct(self, direct: DirectStop) -> FleetStop:
        """Continue a stop that the status aggregator has begun: its robots continue at the end."""
        stop = self.same_as(direct)
        if stop is None or stop.name != direct.name:
            if stop:  # nobody knows its name: the aggregator gave the request up, and shows its own
                self.end(stop.name, direct.by, "continued under the name that is shown")
            stop = FleetStop(
                number=self._next_number(),
                name=direct.name,
                by=direct.by,
                reason=direct.reason,
                since=direct.since,
            )
            self._begin(stop)
        for robot in direct.paused:
            record = self._robots.get(robot)
            names = record.stops if record else ()
            names = names if stop.name in names else (*names, stop.name)
            put = StoppedRobot(
                manufacturer=robot.manufacturer, serial_number=robot.serial_number, stops=names, resume=True
            )
            self._put_robot(put, self._context.registry.discover(robot))
        return stop

    def _next_number(self) -> int:
        return max((stop.number for stop in self._stops.values()), default=0) + 1

    def _begin(self, stop: FleetStop) -> None:
        self._add_stop(stop)
        self._lock_areas(stop)
        self._state.pending.stored.documents[STOP, stop.name] = stop.model_dump_json(exclude_none=True)
        self._state.after_commit(partial(self._show_committed, dict(self._stops)))
        log.warning("robots stopped", stop=stop.name, by=stop.by, reason=stop.reason, area=bool(stop.area))

    def end(self, name: str, by: str, reason: str) -> FleetStop:
        """End a stop; raises UnknownError."""
        stop = self.get(name)
        del self._stops[name], self._resources[name]
        self._lock_areas(stop)
        self._state.pending.stored.documents[STOP, name] = None
        self._state.after_commit(partial(self._show_committed, dict(self._stops)))
        log.warning("stop ended", stop=name, by=by, reason=reason, begun_by=stop.by)
        return stop

    def _show_committed(self, committed: dict[str, FleetStop]) -> None:
        self._visible = committed
        for listener in self.listeners:
            listener()

    def _add_stop(self, stop: FleetStop) -> None:
        self._stops[stop.name] = stop
        self._resources[stop.name] = (
            resources_in(self._context.plant, stop.area) if stop.area else frozenset()
        )

    def _lock_areas(self, *changed: FleetStop) -> None:
        """Lock the paths of all areas, if any of the ``changed`` stops has one."""
        if any(stop.area for stop in changed):
            paths = self._context.plant.paths_by_name
            areas = self._resources.items()
            locked = {path: name for name, resources in areas for path in resources if path in paths}
            self._context.locked_paths.lock(by_stops=locked)

    # Vehicles

    def stop_of(self, vehicle: FleetVehicle) -> FleetStop | None:
        """Return the oldest stop that pauses a vehicle; None if there is none."""
        if not self._stops:
            return None
        covering = self._stops_covering(vehicle, self._context.view(vehicle))
        return self._stops[covering[0]] if covering else None

    def vehicle_stop(self, vehicle: FleetVehicle) -> VehicleStop | None:
        """Return the oldest stop that pauses a vehicle, for its status."""
        stop = self.stop_of(vehicle)
        if stop is None:
            return None
        return VehicleStop(name=stop.name, by=stop.by, reason=stop.reason, area=stop.area is not None)

    def why_stopped(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why a vehicle does not drive for its order because of a stop; None if it may."""
        if not self._stops:
            return None
        if stop := self.stop_of(vehicle):
            return stop.as_reason
        order = self._state.order_of(vehicle.key)
        if order is None or (goal := order.current.destination.coordinate) is None:
            return None
        # The locked paths of an area keep routes out of it, but a drive to a coordinate has no paths: it goes
        # straight there, and would touch the area.
        view = self._context.view(vehicle)
        for stop in self._stops.values():
            position = _position_on(stop.area.map_id, vehicle, view) if stop.area else None
            if stop.area and position and stop.area.crosses(position, (goal.x, goal.y)):
                return Reason(R.CROSSES_PAUSED_AREA, stop.reason, by=stop.by)
        return None

    def person_pauses(self, vehicle: FleetVehicle) -> None:
        """Note that a host pauses a vehicle: it stays paused when the stops end."""
        self._person_paused[vehicle.key] = self._clock.monotonic()
        record = self._robots.get(vehicle.key)
        if record is None:
            return
        if record.stops:
            self._put_robot(record.model_copy(update={"resume": False}), vehicle)
        else:
            self._forget_robot(vehicle)

    def person_resumes(self, vehicle: FleetVehicle) -> None:
        """Note that a host resumes a vehicle that no stop pauses."""
        self._person_paused.pop(vehicle.key, None)

    def pause_or_resume(self, vehicle: FleetVehicle) -> None:
        """Pause or resume a robot as its stops require; call it at each of its states, and periodically."""
        record = self._robots.get(vehicle.key)
        if not self._stops and record is None:
            return
        view = self._context.view(vehicle)
        if stops := self._stops_covering(vehicle, view):
            self._pause_robot(vehicle, view, stops)
        elif record:
            self._resume_robot(vehicle, view, record)

    def on_action_ended(self, event: InstantActionEnded) -> None:
        """Handle the end of a startPause or stopPause."""
        attempt = self._attempts.get(event.robot)
        if attempt is None or attempt.action_id != event.action.action_id:
            return
        attempt.running, attempt.again_at = False, self._clock.monotonic() + RETRY_AFTER
        last_note, attempt.note = attempt.note, ""
        if event.status is not ActionStatus.FINISHED:
            attempt.note = ": ".join(map(str, filter(None, (event.reason, event.result))))
        if attempt.note and attempt.note != last_note:  # repeated every few seconds: logged once
            action = attempt.action_type
            log.warning("stop not executed", robot=str(event.robot), action=action, reason=attempt.note)
        self.pause_or_resume(self._context.registry.discover(event.robot))

    def link_changed(self) -> None:
        """Retry at once, because our own link to the broker has changed."""
        self._attempts = {robot: attempt for robot, attempt in self._attempts.items() if attempt.running}

    # Status

    def statuses(self) -> tuple[StopStatus, ...]:
        """Return the state of all stops that are in the store, the oldest first."""
        return self._statuses_of(self._visible)

    def status_of(self, stop: FleetStop) -> StopStatus:
        """Return the state of a stop."""
        return self._statuses_of({stop.name: stop})[0]

    def _statuses_of(self, stops: Mapping[str, FleetStop]) -> tuple[StopStatus, ...]:
        paused: Counter[str] = Counter()
        unpaused: dict[str, list[UnpausedVehicle]] = {name: [] for name in stops}
        # A robot that was there would have answered by now: only its vehicle is in the plant model.
        all_have_answered = self._context.fleet.connected_for() >= self._context.settings.restart_patience
        for vehicle in self._context.registry if stops else ():
            view = self._context.view(vehicle)
            if (
                view.link is LinkStatus.UNKNOWN
                and vehicle.key not in self._state.vehicles
                and all_have_answered
            ):
                continue
            covering = stops.keys() & self._stops_covering(vehicle, view)
            reason = self._why_not_paused(vehicle, view) if covering else None
            for name in covering:
                if reason:
                    unpaused[name].append(UnpausedVehicle(vehicle=vehicle.name, **explained(reason)))
                else:
                    paused[name] += 1
        return tuple(
            stop.with_status(
                vehicles=paused[stop.name] + len(unpaused[stop.name]),
                paused=paused[stop.name],
                not_paused=tuple(unpaused[stop.name]),
            )
            for stop in stops.values()
        )

    def _why_not_paused(self, vehicle: FleetVehicle, view: RobotView) -> Reason | None:
        """Return, as a predicate, why a robot does not report that it is paused; None if it does."""
        if view.link is not LinkStatus.UNKNOWN:
            if view.link is not LinkStatus.ONLINE or view.state is None or view.stale:
                return view.availability.reason
            if view.state.paused:
                return None
        attempt = self._attempts.get(vehicle.key)
        failed = attempt.note if attempt and attempt.action_type == START_PAUSE else None
        return Reason(R.PAUSE_FAILED, failed) if failed else UNCONFIRMED

    # Pausing and resuming

    def _stops_covering(self, vehicle: FleetVehicle, view: RobotView) -> tuple[str, ...]:
        """Return the stops that pause a vehicle, the oldest first; each pauses it until its end."""
        record = self._robots.get(vehicle.key)
        earlier = record.stops if record else ()
        return tuple(
            name
            for name, stop in self._stops.items()
            if stop.area is None or name in earlier or self._is_in_area(stop.area, name, vehicle, view)
        )

    def _is_in_area(self, area: Area, name: str, vehicle: FleetVehicle, view: RobotView) -> bool:
        """Return whether a vehicle is in an area or could drive in.

        It could if it holds a point or path of the area, or drives straight through it to a coordinate.
        """
        resources = self._resources[name]
        if any(not resources.isdisjoint(held.uses) for held in self._context.traffic.held_by(vehicle.name)):
            return True
        position = _position_on(area.map_id, vehicle, view)
        if position is None:
            return False
        order = self._state.order_of(vehicle.key) if self._state.drives.sent.get(vehicle.key) else None
        goal = order.current.destination.coordinate if order else None
        return area.crosses(position, (goal.x, goal.y) if goal else position)

    def _pause_robot(self, vehicle: FleetVehicle, view: RobotView, stops: tuple[str, ...]) -> None:
        """Pause a robot. What it reports now decides whether it continues at the end."""
        if view.link in NOT_REACHED:
            return
        if view.state is None or view.stale:
            # Paused as well, whatever it does; its first state decides. If nothing at all is heard of it, it
            # is sent the pause until its delivery fails, but not again: perhaps it does not exist.
            if view.link is not LinkStatus.UNKNOWN or vehicle.key not in self._attempts:
                self._send_action(vehicle, START_PAUSE)
            return
        record, paused = self._robots.get(vehicle.key), view.state.paused
        if paused:  # by stops only if it was driving when they began
            resume = record is not None and record.resume
        else:  # it may not yet report the pause that a host has just requested
            requested = self._person_paused.get(vehicle.key)
            resume = requested is None or self._clock.monotonic() - requested >= PERSON_PAUSES_FOR
        self._put_robot(
            StoppedRobot(
                manufacturer=vehicle.key.manufacturer,
                serial_number=vehicle.key.serial_number,
                stops=stops,
                resume=resume,
            ),
            vehicle,
        )
        if not paused:
            self._send_action(vehicle, START_PAUSE)
        elif (attempt := self._attempts.get(vehicle.key)) and not attempt.running:
            del self._attempts[vehicle.key]  # if the robot is resumed meanwhile, it is paused again at once

    def _resume_robot(self, vehicle: FleetVehicle, view: RobotView, record: StoppedRobot) -> None:
        """Resume a robot that only stops have paused; it is done once the robot has confirmed it."""
        if not record.resume:
            self._forget_robot(vehicle)
            return
        self._put_robot(record.model_copy(update={"stops": ()}), vehicle)
        if view.link is not LinkStatus.ONLINE or view.state is None or view.stale:
            return
        attempt = self._attempts.get(vehicle.key)
        if attempt and attempt.running:
            return  # its startPause must not arrive after the stopPause
        if attempt and attempt.action_type == STOP_PAUSE and not view.state.paused:
            self._forget_robot(vehicle)
        else:
            self._send_action(vehicle, STOP_PAUSE)

    def _send_action(self, vehicle: FleetVehicle, action_type: str) -> None:
        """Send an instant action after the commit, unless the same one is running or has just failed."""
        attempt = self._attempts.get(vehicle.key)
        earlier = attempt if attempt and attempt.action_type == action_type else None
        if earlier and (earlier.running or self._clock.monotonic() < earlier.again_at):
            return
        action = Action(action_type=action_type, action_id=unique_id(), blocking_type=BlockingType.NONE)
        note = earlier.note if earlier else ""
        self._attempts[vehicle.key] = _Attempt(action_type, action.action_id, note=note)
        self._state.after_commit(partial(self._context.fleet.instant_action, vehicle.key, action))

    def _put_robot(self, record: StoppedRobot, vehicle: FleetVehicle) -> None:
        if self._robots.get(record.key) == record:
            return
        self._robots[record.key] = record
        self._state.pending.stored.documents[STOPPED_ROBOT, str(record.key)] = record.model_dump_json()
        self._state.vehicle_changed(vehicle.name)

    def _forget_robot(self, vehicle: FleetVehicle) -> None:
        del self._robots[vehicle.key]
        self._attempts.pop(vehicle.key, None)
        self._state.pending.stored.documents[STOPPED_ROBOT, str(vehicle.key)] = None
        self._state.vehicle_changed(vehicle.name)


def _position_on(map_id: str | None, vehicle: FleetVehicle, view: RobotView) -> tuple[float, float] | None:
    """Return the position of a robot, m in the plant frame, if it is known and on this map (None: any)."""
    reported = view.state.mobile_robot_position if view.state else None
    if reported is None or not reported.localized or not vehicle.profile.knows_frame(reported.map_id):
        return None
    if map_id not in (None, reported.map_id):
        return None
    position = vehicle.profile.on(reported.map_id).to_plant(MapPlace(reported.x, reported.y))
    return position.x_m, position.y_m


def _read_documents(kind: type[D], documents: Mapping[str, str]) -> list[D]:
    records = []
    for name, document in documents.items():
        try:
            records.append(kind.model_validate_json(document))
        except ValidationError as error:
            log.warning("stored stop is unreadable", document=name, problems=problems_of(error))
    return records
