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
from typing import Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_order_service.engine.context import Context
from nena_order_service.errors import TooManyStopsError, UnknownStopError
from nena_order_service.fleet.instant_actions import START_PAUSE
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.fleet.robot import NOT_REACHED, LinkStatus, RobotView
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.traffic.areas import resources_in
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.stops import Area, StopRequest, StopStatus, UnpausedVehicle, VehicleStop
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

    @property
    def text(self) -> Reason:
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


class Closed:
    """A gate that allocates and releases nothing."""

    def may_allocate(self, index: int) -> bool:
        """Return False."""
        del index
        return False

    may_release = may_allocate


CLOSED: Final = Closed()


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
        for stop in sorted(_read(FleetStop, stops), key=lambda each: each.number):
            self._add(stop)
        self._lock(*self._stops.values())
        self._visible = dict(self._stops)
        self._robots = {each.key: each for each in _read(StoppedRobot, robots)}

    # Stops

    @property
    def all_robots(self) -> FleetStop | None:
        """The oldest stop of all robots; None if there is none."""
        return next((each for each in self._stops.values() if each.area is None), None)

    def get(self, name: str) -> FleetStop:
        """Return an active stop; raises UnknownStopError."""
        if name not in self._stops:
            raise UnknownStopError(name)
        return self._stops[name]

    def begin(self, request: StopRequest, by: str) -> FleetStop:
        """Begin a stop; raises TooManyStopsError."""
        if len(self._stops) >= STOPS_LIMIT:
            raise TooManyStopsError(STOPS_LIMIT)
        number = max((each.number for each in self._stops.values()), default=0) + 1
        stop = FleetStop(
            number=number,
            name=f"stop-{unique_id()[:8]}",
            by=by,
            reason=request.reason,
            since=self._clock.now(),
            area=request.area,
        )
        self._add(stop)
        self._lock(stop)
        self._state.pending.stored.documents[STOP, stop.name] = stop.model_dump_json(exclude_none=True)
        self._state.after_commit(partial(self._show, dict(self._stops)))
        log.warning("robots stopped", stop=stop.name, by=by, reason=stop.reason, area=bool(stop.area))
        return stop

    def end(self, name: str, by: str, reason: str) -> FleetStop:
        """End a stop; raises UnknownStopError."""
        stop = self.get(name)
        del self._stops[name], self._resources[name]
        self._lock(stop)
        self._state.pending.stored.documents[STOP, name] = None
        self._state.after_commit(partial(self._show, dict(self._stops)))
        log.warning("stop ended", stop=name, by=by, reason=reason, begun_by=stop.by)
        return stop

    def _show(self, committed: dict[str, FleetStop]) -> None:
        self._visible = committed
        for listener in self.listeners:
            listener()

    def _add(self, stop: FleetStop) -> None:
        self._stops[stop.name] = stop
        self._resources[stop.name] = (
            resources_in(self._context.plant, stop.area) if stop.area else frozenset()
        )

    def _lock(self, *changed: FleetStop) -> None:
        """Lock the paths of all areas, if any of the ``changed`` stops has one."""
        if any(each.area for each in changed):
            paths = self._context.plant.paths_by_name
            areas = self._resources.items()
            locked = {each: name for name, found in areas for each in found if each in paths}
            self._context.locked_paths.lock(by_stops=locked)

    # Vehicles

    def stop_of(self, vehicle: FleetVehicle) -> FleetStop | None:
        """Return the oldest stop that pauses a vehicle; None if there is none."""
        if not self._stops:
            return None
        covering = self._covering(vehicle, self._context.view(vehicle))
        return self._stops[covering[0]] if covering else None

    def vehicle_stop(self, vehicle: FleetVehicle) -> VehicleStop | None:
        """Return the oldest stop that pauses a vehicle, for its status."""
        stop = self.stop_of(vehicle)
        if stop is None:
            return None
        return VehicleStop(name=stop.name, by=stop.by, reason=stop.reason, area=stop.area is not None)

    def why(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why a vehicle does not drive for its order because of a stop; None if it may."""
        if not self._stops:
            return None
        if stop := self.stop_of(vehicle):
            return stop.text
        if stop := self.bar(vehicle, self._state.order_of(vehicle.key)):
            return Reason(R.CROSSES_PAUSED_AREA, stop.reason, by=stop.by)
        return None

    def bar(self, vehicle: FleetVehicle, order: TransportOrder | None) -> FleetStop | None:
        """Return the stop whose area a vehicle would touch on its straight drive to a coordinate, if any."""
        areas = [(each, each.area) for each in self._stops.values() if each.area]
        if not areas or order is None:
            return None
        goal, view = order.current.destination.coordinate, self._context.view(vehicle)
        for stop, area in areas if goal else ():
            here = _place_on(area.map_id, vehicle, view)
            if here and goal and area.crosses(here, (goal.x, goal.y)):
                return stop
        return None

    def person_pauses(self, vehicle: FleetVehicle) -> None:
        """Note that a host pauses a vehicle: it stays paused when the stops end."""
        self._person_paused[vehicle.key] = self._clock.monotonic()
        known = self._robots.get(vehicle.key)
        if known is None:
            return
        if known.stops:
            self._put(known.model_copy(update={"resume": False}), vehicle)
        else:
            self._forget(vehicle)

    def person_resumes(self, vehicle: FleetVehicle) -> None:
        """Note that a host resumes a vehicle that no stop pauses."""
        self._person_paused.pop(vehicle.key, None)

    def look_at(self, vehicle: FleetVehicle) -> None:
        """Pause or resume a robot as its stops require; call it at each of its states, and periodically."""
        known = self._robots.get(vehicle.key)
        if not self._stops and known is None:
            return
        view = self._context.view(vehicle)
        if covering := self._covering(vehicle, view):
            self._hold(vehicle, view, covering)
        elif known:
            self._let_go(vehicle, view, known)

    def ended(self, event: InstantActionEnded) -> None:
        """Handle the end of a startPause or stopPause."""
        attempt = self._attempts.get(event.robot)
        if attempt is None or attempt.action_id != event.action.action_id:
            return
        attempt.running, attempt.again_at = False, self._clock.monotonic() + RETRY_AFTER
        before, attempt.note = attempt.note, ""
        if event.status is not ActionStatus.FINISHED:
            attempt.note = ": ".join(map(str, filter(None, (event.reason, event.result))))
        if attempt.note and attempt.note != before:
            action = attempt.action_type
            log.warning("stop not executed", robot=str(event.robot), action=action, reason=attempt.note)
        self.look_at(self._context.registry.discover(event.robot))

    def link_changed(self) -> None:
        """Retry at once, because our own link to the broker has changed."""
        self._attempts = {robot: each for robot, each in self._attempts.items() if each.running}

    # Status

    def statuses(self) -> tuple[StopStatus, ...]:
        """Return the state of all stops that are in the store, the oldest first."""
        return self._statuses(self._visible)

    def status(self, stop: FleetStop) -> StopStatus:
        """Return the state of a stop."""
        return self._statuses({stop.name: stop})[0]

    def _statuses(self, stops: Mapping[str, FleetStop]) -> tuple[StopStatus, ...]:
        paused: Counter[str] = Counter()
        others: dict[str, list[UnpausedVehicle]] = {name: [] for name in stops}
        for vehicle in self._context.registry if stops else ():
            view = self._context.view(vehicle)
            if view.link is LinkStatus.UNKNOWN and self._never_connected(vehicle):
                continue
            covering = stops.keys() & self._covering(vehicle, view)
            reason = self._why_not_paused(vehicle, view) if covering else None
            for name in covering:
                if reason:
                    others[name].append(UnpausedVehicle(vehicle=vehicle.name, **explained(reason)))
                else:
                    paused[name] += 1
        return tuple(
            StopStatus(
                name=each.name,
                by=each.by,
                reason=each.reason,
                since=each.since,
                area=each.area,
                vehicles=paused[each.name] + len(others[each.name]),
                paused=paused[each.name],
                not_paused=tuple(others[each.name]),
            )
            for each in stops.values()
        )

    def _never_connected(self, vehicle: FleetVehicle) -> bool:
        """Return whether a robot that is not heard was never there: it would have answered by now."""
        patience = self._context.settings.restart_patience
        return vehicle.key not in self._state.vehicles and self._context.fleet.connected_for() >= patience

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

    # How it works

    def _covering(self, vehicle: FleetVehicle, view: RobotView) -> tuple[str, ...]:
        """Return the stops that pause a vehicle, the oldest first; each pauses it until its end."""
        known = self._robots.get(vehicle.key)
        earlier = known.stops if known else ()
        return tuple(
            name
            for name, stop in self._stops.items()
            if stop.area is None or name in earlier or self._is_in(stop.area, name, vehicle, view)
        )

    def _is_in(self, area: Area, name: str, vehicle: FleetVehicle, view: RobotView) -> bool:
        """Return whether a vehicle is in an area or could drive in.

        It could if it holds a point or path of the area, or drives straight through it to a coordinate.
        """
        resources = self._resources[name]
        if any(not resources.isdisjoint(each.uses) for each in self._context.traffic.held(vehicle.name)):
            return True
        here = _place_on(area.map_id, vehicle, view)
        if here is None:
            return False
        order = self._state.order_of(vehicle.key) if self._state.drives.sent.get(vehicle.key) else None
        goal = order.current.destination.coordinate if order else None
        return area.crosses(here, (goal.x, goal.y) if goal else here)

    def _hold(self, vehicle: FleetVehicle, view: RobotView, stops: tuple[str, ...]) -> None:
        """Pause a robot. What it reports now decides whether it continues at the end.

        One that has not reported is paused as well, whatever it does; its first state decides. If nothing at
        all is heard of it, it is sent the pause until its delivery fails, but not again: perhaps it does not
        exist.
        """
        if view.link in NOT_REACHED:
            return
        if view.state is None or view.stale:
            if view.link is not LinkStatus.UNKNOWN or vehicle.key not in self._attempts:
                self._send(vehicle, START_PAUSE)
            return
        known, paused = self._robots.get(vehicle.key), view.state.paused
        resume = (known is not None and known.resume) if paused else not self._person_is_pausing(vehicle)
        self._put(
            StoppedRobot(
                manufacturer=vehicle.key.manufacturer,
                serial_number=vehicle.key.serial_number,
                stops=stops,
                resume=resume,
            ),
            vehicle,
        )
        if not paused:
            self._send(vehicle, START_PAUSE)
        elif (attempt := self._attempts.get(vehicle.key)) and not attempt.running:
            del self._attempts[vehicle.key]  # if the robot is resumed meanwhile, it is paused again at once

    def _let_go(self, vehicle: FleetVehicle, view: RobotView, known: StoppedRobot) -> None:
        """Resume a robot that only stops have paused; it is done once the robot has confirmed it."""
        if not known.resume:
            self._forget(vehicle)
            return
        self._put(known.model_copy(update={"stops": ()}), vehicle)
        if view.link is not LinkStatus.ONLINE or view.state is None or view.stale:
            return
        attempt = self._attempts.get(vehicle.key)
        if attempt and attempt.running:
            return  # its startPause must not arrive after the stopPause
        if attempt and attempt.action_type == STOP_PAUSE and not view.state.paused:
            self._forget(vehicle)
        else:
            self._send(vehicle, STOP_PAUSE)

    def _person_is_pausing(self, vehicle: FleetVehicle) -> bool:
        asked = self._person_paused.get(vehicle.key)
        return asked is not None and self._clock.monotonic() - asked < PERSON_PAUSES_FOR

    def _send(self, vehicle: FleetVehicle, action_type: str) -> None:
        """Send an instant action after the commit, unless the same one is running or has just failed."""
        attempt = self._attempts.get(vehicle.key)
        earlier = attempt if attempt and attempt.action_type == action_type else None
        if earlier and (earlier.running or self._clock.monotonic() < earlier.again_at):
            return
        action = Action(action_type=action_type, action_id=unique_id(), blocking_type=BlockingType.NONE)
        note = earlier.note if earlier else ""
        self._attempts[vehicle.key] = _Attempt(action_type, action.action_id, note=note)
        self._state.after_commit(partial(self._context.fleet.instant_action, vehicle.key, action))

    def _put(self, record: StoppedRobot, vehicle: FleetVehicle) -> None:
        if self._robots.get(record.key) == record:
            return
        self._robots[record.key] = record
        self._state.pending.stored.documents[STOPPED_ROBOT, str(record.key)] = record.model_dump_json()
        self._state.vehicle_changed(vehicle.name)

    def _forget(self, vehicle: FleetVehicle) -> None:
        del self._robots[vehicle.key]
        self._attempts.pop(vehicle.key, None)
        self._state.pending.stored.documents[STOPPED_ROBOT, str(vehicle.key)] = None
        self._state.vehicle_changed(vehicle.name)


def _place_on(map_id: str | None, vehicle: FleetVehicle, view: RobotView) -> tuple[float, float] | None:
    """Return the position of a robot, m in the plant frame, if it is known and on this map (None: any)."""
    at = view.state.mobile_robot_position if view.state else None
    if at is None or not at.localized or not vehicle.profile.knows_frame(at.map_id):
        return None
    if map_id not in (None, at.map_id):
        return None
    here = vehicle.profile.on(at.map_id).to_plant(MapPlace(at.x, at.y))
    return here.x_m, here.y_m


def _read(kind: type[D], documents: Mapping[str, str]) -> list[D]:
    found = []
    for name, document in documents.items():
        try:
            found.append(kind.model_validate_json(document))
        except ValidationError as error:
            log.warning("stored stop is unreadable", document=name, problems=problems_of(error))
    return found
