"""Driving: request routes from traffic control, and send robots what it grants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Final

from nena_order_service.engine.context import Context
from nena_order_service.engine.peripherals import Peripherals
from nena_order_service.engine.positions import Positions
from nena_order_service.engine.stops import CLOSED, Stops
from nena_order_service.fleet.availability import why_not_driving, with_received
from nena_order_service.fleet.failures import FailureKind, RobotBusyError
from nena_order_service.fleet.instant_actions import STATE_REQUEST, without_parameters
from nena_order_service.fleet.outputs import FleetOutput, VdaOrderFailed
from nena_order_service.fleet.position import NotLocatedError, Standing, TooFarError
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.orders.drive import Drive, DriveState
from nena_order_service.orders.transport_order import TransportOrder, why_held
from nena_order_service.routing.router import RoutePlan
from nena_order_service.traffic.forecast import UNKNOWN_SPEED_MM_S
from nena_order_service.traffic.manager import (
    EarlyEnd,
    Gate,
    MoreClaimed,
    RouteGrant,
    RouteRejection,
)
from nena_order_service.traffic.relocation import Relocation
from nena_order_service.traffic.scheduler import WaitReason
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained, reason_of
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import DriveOrderState
from nena_shared.log import get_logger
from nena_shared.plant.track import MM_PER_M
from nena_shared.vda5050.topics import RobotKey

R = ReasonCode

log = get_logger(__name__)

MAY_STILL_SPEAK = (LinkStatus.UNKNOWN, LinkStatus.ONLINE, LinkStatus.SILENT, LinkStatus.UNREADABLE)
NAMED_MISSING: Final = 5
"""Maximum number of awaited vehicles that a reason names."""
NOWHERE = -1
"""Index of the step of a route without any."""
RELOCATION_PAUSE = 10.0
"""Delay before a robot that did not make room is sent away again, seconds."""
CAUSES: Final = {
    WaitReason.HELD: WaitCause.PASSES,
    WaitReason.RESTING: WaitCause.STANDS,
    WaitReason.ORDER: WaitCause.GOES_FIRST,
}


class RestartGate:
    """Opens once, as soon as every robot has reported its state or is known to be away, or after a timeout.

    It also waits for vehicles of which nothing is known yet: some brokers do not report which robots are
    connected (RabbitMQ), and a robot may only report every 30 s (section 6.6). One that was not heard again
    and one that is offline keep the resources that they held: the others drive around them.
    """

    def __init__(self, context: Context, on_open: Callable[[], None]) -> None:
        """``on_open`` is called once, when the gate opens: time alone may open it, without an event."""
        self._context = context
        self._on_open = on_open
        self._timeout = context.settings.restart_patience
        self._until = context.clock.monotonic() + self._timeout
        self._awaited: list[FleetVehicle] = []
        """The vehicles to wait for, without those that have answered since."""
        self._open = False

    def wait_for(self, vehicles: Iterable[FleetVehicle]) -> None:
        """Start waiting for these vehicles."""
        self._awaited = list(vehicles)
        self._until = self._context.clock.monotonic() + self._timeout

    @property
    def is_open(self) -> bool:
        """Whether anything may be sent to robots."""
        if not self._open:
            fleet = self._context.fleet
            # Time without a broker does not count: no robot can answer then.
            is_late = self._context.clock.monotonic() >= self._until
            is_late = is_late and fleet.connected_for() >= self._timeout
            missing = self._missing_vehicles()
            self._open = is_late or (not missing and fleet.all_known())
            if self._open:
                if missing:
                    log.warning("robots without a state keep their resources", vehicles=missing)
                self._on_open()
        return self._open

    @property
    def wait_reason(self) -> Reason | None:
        """Why nothing is sent yet; None when the gate is open."""
        if self.is_open:
            return None
        missing = self._missing_vehicles()
        if not missing:
            return Reason(R.FIRST_STATES)
        more = ", …" if len(missing) > NAMED_MISSING else ""
        return Reason(R.FIRST_STATE, vehicles=", ".join(missing[:NAMED_MISSING]) + more)

    def _missing_vehicles(self) -> list[str]:
        """Return the names of the vehicles that have yet to answer."""
        # Those that have answered are not checked again; if one is back later, fleet control knows it.
        views = [(vehicle, self._context.view(vehicle)) for vehicle in self._awaited]
        self._awaited = [
            vehicle
            for vehicle, view in views
            if view.state is None and view.link in MAY_STILL_SPEAK
            # what it may occupy is known from before the restart, and stays its own
            if view.link is not LinkStatus.UNKNOWN or vehicle.name not in self._context.traffic
        ]
        return [vehicle.name for vehicle in self._awaited]


class Pauses:
    """Vehicles that are paused with an order until they can continue.

    The order is on hold or will be retried later, a device executes an operation after the last movement,
    the vehicle is not localised, or locked paths close its route. A paused vehicle stays where it is; only
    one that is locked out makes room, or orders that have a way would wait for the path, too.
    """

    def __init__(self, context: Context, peripherals: Peripherals) -> None:
        self._context = context
        self._peripherals = peripherals
        self._orders = context.state.orders
        self._order_numbers = context.state.pauses
        self._locked_out: dict[str, tuple[tuple[int, str, int], Reason | None]] = {}
        """By vehicle: which lock closes its route; a search takes milliseconds, and the key says how long it
        holds."""

    def __contains__(self, vehicle: str) -> bool:
        """Return whether the vehicle of this name is paused."""
        return vehicle in self._order_numbers

    def __iter__(self) -> Iterator[tuple[str, TransportOrder]]:
        """Yield the vehicles' names and their orders."""
        return iter([(vehicle, self._orders.get(number)) for vehicle, number in self._order_numbers.items()])

    def begin(self, vehicle: FleetVehicle, order: TransportOrder) -> None:
        """Pause a vehicle with its order until :meth:`end`."""
        self._order_numbers[vehicle.name] = order.number
        self._locked_out.pop(vehicle.name, None)

    def end(self, vehicle: str) -> None:
        """End the pause of the vehicle of this name."""
        self._order_numbers.pop(vehicle, None)
        self._locked_out.pop(vehicle, None)

    def is_locked_out(self, vehicle: str) -> bool:
        """Return whether a vehicle is only paused because locked paths close its route."""
        return self._locked_out.get(vehicle, (None, None))[1] is not None

    def is_over(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle can continue with its order."""
        return not self._orders.get(self._order_numbers[vehicle.name]).held and not self.why_paused(vehicle)

    def why_held(self, vehicle: FleetVehicle) -> Reason | None:
        """Return who put the order of a paused vehicle on hold, and why; None if it is not on hold."""
        order = self._orders.find(self._order_numbers.get(vehicle.name, -1))
        return why_held(order.status.held) if order and order.status.held else None

    def why_paused(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why a vehicle cannot continue; None if it can, or if its order is on hold."""
        order = self._orders.get(self._order_numbers[vehicle.name])
        status = order.status
        if status.held:
            return None
        if status.next_try and self._context.clock.now() < status.next_try:
            return Reason(R.RETRIES_AT, time=status.next_try)
        if jobs := self._peripherals.jobs_behind(vehicle):
            return self._peripherals.wait_reason(jobs[0])
        if order.current.state is DriveOrderState.FINISHED:
            return None
        view = self._context.view(vehicle)
        try:
            standing = self._context.planner.standing(vehicle, view)
        except NotLocatedError as error:
            is_away = view.state is None or view.link is not LinkStatus.ONLINE
            away = Reason(R.ROBOT, view.availability.reason)
            return away if is_away else with_received(error.reason, view.substituted)
        key = order.number, standing.point, self._context.finder.lock_changes
        known = self._locked_out.get(vehicle.name)
        if known is None or known[0] != key:
            known = key, self._context.planner.locked_out(order, vehicle, standing)
            self._locked_out[vehicle.name] = known
        return known[1]


class Mobility:
    """Determines which vehicles at rest could drive away now, by their states, positions and orders."""

    def __init__(self, context: Context, positions: Positions, pauses: Pauses) -> None:
        self._context = context
        self._traffic = context.traffic
        self._positions = positions
        self._pauses = pauses
        self._stays_until: dict[str, float] = {}

    def relocation_failed(self, vehicle: FleetVehicle) -> None:
        """Do not send a vehicle away again for RELOCATION_PAUSE."""
        self._stays_until[vehicle.name] = self._context.clock.monotonic() + RELOCATION_PAUSE

    def can_move(self, name: str) -> bool:
        """Return whether a vehicle at rest could drive away now."""
        vehicle = self._context.registry.named(name)
        locked_out = self._pauses.is_locked_out(name)
        if vehicle is None or vehicle.obstacle or (name in self._pauses and not locked_out):
            return False
        needs_to_drive = vehicle.key in self._context.state.drives.requested
        # A vehicle that was taken out because its orders failed shows by making room whether it drives again.
        taken_out = bool(self._context.state.vehicles.of(vehicle.key).taken_out)
        if self._positions.obstacle_of(vehicle, working=needs_to_drive or taken_out or locked_out):
            return False
        if self._traffic.route_of(name) or not self._positions.is_located(vehicle):
            return False
        if self._context.clock.monotonic() < self._stays_until.get(name, 0.0) and not needs_to_drive:
            return False
        return self._context.view(vehicle).availability.can_take_order

    def is_lost(self, name: str) -> bool:
        """Return whether it is unknown when a vehicle at rest could drive away."""
        vehicle = self._context.registry.named(name)
        if vehicle is None or (name in self._pauses and not self._pauses.is_locked_out(name)):
            return True
        if self._context.view(vehicle).link is not LinkStatus.ONLINE:
            return True
        if self._traffic.route_of(name):
            return False  # it is under way and will continue
        has_order = self._context.state.drives.order_number(vehicle.key) is not None
        return not has_order and not self.can_move(name)

    def is_stopped(self, drive: Drive) -> bool:
        """Return whether a robot cannot drive on before somebody helps it, or before it is back."""
        view = self._context.view(self._context.registry.discover(drive.robot))
        return view.link is not LinkStatus.ONLINE or (
            view.state is not None and why_not_driving(view.state) is not None
        )

    def why_misplaced(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why a vehicle cannot be where it says; None if it can."""
        try:
            self._context.planner.standing(vehicle, self._context.view(vehicle))
        except TooFarError as error:
            return error.reason
        except NotLocatedError:
            pass
        return None

    def why_it_stays(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why a vehicle cannot start to drive for its order; None if it can."""
        view = self._context.view(vehicle)
        if not view.availability.can_take_order:
            return Reason(R.ROBOT, view.availability.reason)
        if obstacle := self._positions.obstacle_of(vehicle, working=True):
            return Reason(R.IT, obstacle)
        if not self._positions.is_located(vehicle):
            return self.why_misplaced(vehicle) or Reason(R.POSITION_UNKNOWN)
        return self.why_it_waits(vehicle.name)

    def why_it_waits(self, name: str) -> Reason | None:
        """Return why a vehicle waits for traffic, and why the states of the others are unreadable."""
        refusal = self._traffic.refusal_of(name)
        if refusal is None:
            return None
        reason = refusal.in_words()
        for vehicle in map(self._context.registry.named, refusal.vehicles):
            if vehicle and (view := self._context.view(vehicle)).link is LinkStatus.UNREADABLE:
                reason = Reason(
                    R.WAITS_FOR_UNREADABLE, reason, view.availability.reason, vehicle=vehicle.name
                )
        return Reason(R.IT, reason)


@dataclass(frozen=True, slots=True)
class Stuck:
    """A vehicle has no route for its order."""

    vehicle: FleetVehicle
    reason: Reason


class Driving:
    """Connects traffic control with fleet control.

    A vehicle requests the route of its drive order. Once traffic control grants it, a VDA 5050 order is sent:
    what is allocated is its base, the rest its horizon. Order updates extend the base (section 6.1.2). The
    base extends beyond the robot's next node by the distance that it drives in ``release_seconds``, or over
    ``release_ahead`` nodes (*preventive*); without either setting, over everything that can be allocated
    (*assertive*). Nothing is sent before the first step is allocated and all changes are committed.
    """

    def __init__(
        self,
        context: Context,
        positions: Positions,
        pauses: Pauses,
        gate: RestartGate,
        peripherals: Peripherals,
        *,
        stops: Stops,
    ) -> None:
        self.mobility = Mobility(context, positions, pauses)
        self._can_move, self._is_lost = cache(self.mobility.can_move), cache(self.mobility.is_lost)
        """Answers that hold during the decisions of traffic control."""
        self._context = context
        self._state = context.state
        self._drives = context.state.drives
        self._traffic = context.traffic
        self.positions = positions
        self._pauses = pauses
        self._planner = context.planner
        self._registry = context.registry
        self._gate = gate
        self._peripherals = peripherals
        self.stops = stops
        self._wait_reasons: dict[str, Reason] = {}
        """For what vehicles waited at the last call of :meth:`let_drive`, by name."""

    def request_route(
        self,
        order: TransportOrder,
        vehicle: FleetVehicle,
        way: RoutePlan,
        *,
        first: bool = False,
        retriable: bool = False,
    ) -> None:
        """Request a vehicle's route for its current drive order, the first leg of ``way``.

        ``first``: serve it before others, because it already had its turn. ``retriable``: the robot may
        retry its actions.
        """
        self.positions.update_held(vehicle)
        route_request = self._planner.route_request(order, vehicle, way.legs[0])
        self._drives.put(Drive.to_current_destination(order, vehicle.key, retriable=retriable))
        self._traffic.request_route(route_request, first=first)
        self._state.drive_due = True

    def drop_drive(self, vehicle: FleetVehicle) -> None:
        """Drop a vehicle's drive of which nothing was sent to the robot."""
        self._drives.requested.pop(vehicle.key, None)
        self._traffic.drop_request(vehicle.name)
        if self._drives.granted.pop(vehicle.key, None):
            self._traffic.revoke_route(vehicle.name)

    def cancel_drive(self, drive: Drive) -> None:
        """Send cancelOrder to a robot after the commit."""
        self._shorten_route(drive)
        # A restart restores from the store what the vehicle may still drive over: no more than its base.
        self._drives.put(drive.changed(cancelled=True, way=drive.way[: drive.allocated]))
        self._state.after_commit(lambda: self._context.fleet.cancel_vda_order(drive.robot))

    def end_early(self, drive: Drive, *, partial: bool) -> None:
        """End a VDA order at the end of its base; ``partial`` if its transport order continues from there."""
        self._shorten_route(drive)
        shorter = drive.ending_early(partial=partial)
        if shorter is not drive:
            self.send_update(shorter)

    def drop_relocation(self, order_id: str) -> None:
        """Give up making room with a VDA order, because a peripheral device on its route has failed."""
        for drive in [drive for drive in self._drives.with_routes() if drive.order_id == order_id]:
            if drive.is_sent:
                self.end_early(drive, partial=False)
                return
            vehicle = self._registry.discover(drive.robot)
            self._drives.drop(drive)
            self._traffic.revoke_route(vehicle.name)
            self.mobility.relocation_failed(vehicle)
            self._state.drive_due = True

    def request_routes_again(self, is_unsuitable: Callable[[Drive], bool]) -> None:
        """Request routes again for those unsent VDA orders for which ``is_unsuitable`` returns True."""
        for drive in filter(is_unsuitable, tuple(self._drives.granted.values())):
            self._request_again(drive)

    def pass_node(self, robot: RobotKey, order_id: str, sequence_id: int) -> None:
        """Free the resources behind a robot that has passed a node."""
        drive = self._drives.with_id(robot, order_id)
        if drive and (vehicle := self._vehicle_under_way(drive)):
            # VDA 5050 3.0, 6.1.1: nodes have the even sequence IDs, the edges between them the odd ones.
            reached = sequence_id // 2
            self._state.drive_due |= self._traffic.note_arrival(vehicle.name, reached)
            self._peripherals.request_after_movement(vehicle, drive, reached)

    def extend_base(self, robot: RobotKey, order_id: str) -> None:
        """Extend the base of a robot that requests it (newBaseRequest), if traffic control grants more."""
        drive = self._drives.with_id(robot, order_id)
        if drive and self._may_release and (vehicle := self._vehicle_under_way(drive)):
            self._allocate_and_send(vehicle, more=self._context.settings.release_ahead or 1)

    def ahead_of(self, drive: Drive) -> tuple[str, ...]:
        """Return the next path and point on a robot's route; empty at its end."""
        vehicle = self._vehicle_under_way(drive)
        route = self._traffic.route_of(vehicle.name) if vehicle else None
        return drive.ahead(route.reached) if route else ()

    def note_stopped(self) -> None:
        """Tell traffic control which robots under way are stopped: others must not queue behind them."""
        stopped = filter(self.mobility.is_stopped, self._drives.sent.values())
        names = [self._registry.discover(drive.robot).name for drive in stopped]
        self._state.drive_due |= self._traffic.note_stopped(names)

    def finish_drive(self, drive: Drive) -> None:
        """End a finished VDA order: its robot is at rest at the end of the route."""
        vehicle = self._registry.discover(drive.robot)
        self._peripherals.request_after_movement(vehicle, drive, len(drive.way), finished=True)
        self._drives.end(drive)
        if self._traffic.route_of(vehicle.name):
            self._traffic.finish_route(vehicle.name)
            self.positions.store_held(vehicle)
            self._come_to_rest(vehicle)

    def break_off(self, drive: Drive, event: object) -> None:
        """End a VDA order early: its robot keeps what it holds until it is seen standing."""
        self._drives.end(drive)
        vehicle = self._registry.discover(drive.robot)
        if drive.relocation:
            self.mobility.relocation_failed(vehicle)
        if self._traffic.route_of(vehicle.name):
            self._traffic.break_off(vehicle.name)
            self.positions.store_held(vehicle)
            # A failed VDA order that the robot was not known to have may still reach it: its earlier states,
            # in which it stands, do not count.
            self._come_to_rest(vehicle, doubt=isinstance(event, VdaOrderFailed) and not drive.accepted)

    @property
    def _may_release(self) -> bool:
        """Whether any robot may be sent an order or more base."""
        return self._gate.is_open and self.stops.all_robots is None

    def let_drive(self) -> Iterator[FleetVehicle | Stuck]:
        """Grant routes and extend bases; yield vehicles that are stuck or have a new wait reason."""
        self._state.drive_due = False
        if self._may_release:
            under_way = [name for name, _ in self._traffic.routes_to_extend()]
            granted = (self._registry.discover(robot).name for robot in self._drives.granted)
            at_start = filter(self._traffic.route_of, (*granted, *self._peripherals.waiting))
            for name in dict.fromkeys([*under_way, *at_start]):
                self._allocate_and_send(self._vehicle_named(name))
            self.request_routes_again(
                lambda drive: self._traffic.is_blocked(self._registry.discover(drive.robot).name)
            )
            # Traffic control asks about the same vehicles for each request, and only its own decisions change
            # the answers meanwhile: a vehicle that it has just sent away has a route.
            self._can_move.cache_clear()
            self._is_lost.cache_clear()
            for decision in self._traffic.decide(
                lambda name: not self._traffic.route_of(name) and self._can_move(name), self._is_lost
            ):
                if isinstance(decision, MoreClaimed):
                    self._allocate_and_send(self._vehicle_named(decision.vehicle))
                elif isinstance(decision, EarlyEnd):
                    self._end_drive_at_base(decision.vehicle)
                else:
                    yield from self._begin_drive(decision)
            # Routes blocked by robots that will not make room end at their bases: their vehicles are then at
            # rest, too, and request new routes around those robots, or swap positions with them.
            for name in tuple(self._traffic.stuck_vehicles(self.mobility.can_move, self.mobility.is_lost)):
                self._end_drive_at_base(name)
            # Only after the grants it is known which jobs no route needs any more.
            for name in [name for name in self._peripherals.waiting if not self._traffic.route_of(name)]:
                del self._peripherals.waiting[name]
            self._peripherals.publish_users()
            self._peripherals.withdraw_unneeded()
            self._peripherals.send_next_jobs()
        yield from self._update_wait_reasons()

    def _update_wait_reasons(self) -> Iterator[FleetVehicle]:
        """Yield the vehicles that now wait for something else, or no longer wait."""
        unsent = {self._registry.discover(robot).name for robot in self._drives.unsent}
        due = unsent.union(self._peripherals.waiting)
        for name in self._traffic.waiting_vehicles.union(due, self._wait_reasons):
            vehicle = self._vehicle_named(name)
            reason = self.wait_reason(vehicle) if name in due else self.mobility.why_it_waits(name)
            if reason != self._wait_reasons.pop(name, None):
                yield vehicle
            if reason:
                self._wait_reasons[name] = reason

    def _request_again(self, drive: Drive) -> None:
        """Withdraw a route of which nothing was sent, and request it again; a relocation is dropped."""
        self._drives.drop(drive)
        if not drive.relocation:
            self._drives.put(drive.requested_again())
        self._traffic.revoke_route(self._registry.discover(drive.robot).name, again=True)
        self._state.drive_due = True

    def _end_drive_at_base(self, name: str) -> None:
        """End the route of a waiting vehicle at the end of its base, so that it requests a new one."""
        robot = self._vehicle_named(name).key
        drive = self._drives.sent.get(robot)
        if granted := self._drives.granted.get(robot):
            self._request_again(granted)
        elif drive and not drive.cancelled and not drive.all_released:
            log.info("vehicle rerouted", vehicle=name, reason=str(self._traffic.refusal_of(name) or ""))
            self.end_early(drive, partial=True)

    def wait_reason(self, vehicle: FleetVehicle) -> Reason | None:
        """Return what a vehicle waits for with its order; None if it does not wait."""
        drive = self._drives.sent.get(vehicle.key)
        if drive and drive.relocation:
            return Reason(R.MAKES_ROOM_FIRST)
        # What nothing else can end comes first: with a stop, it does not matter that others are in the way.
        if reason := self._gate.wait_reason or self.stops.why_stopped(vehicle):
            return reason
        if vehicle.name in self._pauses:
            return self._pauses.why_paused(vehicle)
        if job := self._peripherals.job_awaited_by(vehicle.name):
            return self._peripherals.wait_reason(job)
        if self._drives.unsent_of_order(vehicle.key):
            return self.mobility.why_it_stays(vehicle)
        waits_for_base = drive is not None and not drive.all_released
        misplaced = self.mobility.why_misplaced(vehicle) if waits_for_base else None
        return misplaced or self.mobility.why_it_waits(vehicle.name)

    def traffic_wait(self, vehicle: FleetVehicle) -> TrafficWait | None:
        """Return which vehicles a vehicle waits for, where and why; None if it does not wait."""
        reason = self.wait_reason(vehicle) or self._pauses.why_held(vehicle)
        refusal = self._traffic.refusal_of(vehicle.name)
        if job := self._peripherals.job_awaited_by(vehicle.name):
            return TrafficWait(at=job.status.location, **explained(reason))
        if refusal is None:
            if reason is not None and reason.code is R.PATH_LOCKED:
                return TrafficWait(at=str(reason.values["path"]), cause=WaitCause.LOCKED, **explained(reason))
            return TrafficWait(**explained(reason)) if reason else None
        return TrafficWait(
            vehicles=refusal.vehicles,
            at=refusal.resource,
            cause=CAUSES[refusal.reason],
            turn_back=refusal.turn_back_mm / MM_PER_M if refusal.turn_back_mm else None,
            **explained(reason or Reason(R.IT, refusal.in_words())),
        )

    def _vehicle_named(self, name: str) -> FleetVehicle:
        vehicle = self._registry.named(name)
        assert vehicle, "vehicles never leave the registry"  # noqa: S101 - for the type
        return vehicle

    def _begin_drive(self, granted: RouteGrant | Relocation | RouteRejection) -> Iterator[Stuck]:
        vehicle = self._vehicle_named(granted.vehicle)
        if isinstance(granted, RouteRejection):
            self._drives.requested.pop(vehicle.key, None)
            yield Stuck(vehicle, reason_of(granted.error))
            return
        # The route begins where the vehicle stood when it was requested: it may have been moved since.
        try:
            standing = self._planner.standing(vehicle, self._context.view(vehicle))
        except NotLocatedError:
            standing = None
        if standing is None or not self._traffic.stands_at(
            vehicle.name, standing.point, on_point=standing.on_point
        ):
            self._traffic.revoke_route(vehicle.name, again=True)
            self._come_to_rest(vehicle)
            self._state.drive_due = False  # until a new state or the next check
            return
        try:
            self._drives.put(self._granted_drive(granted, vehicle, standing))
        except ValueError as error:
            self._traffic.revoke_route(vehicle.name)
            yield Stuck(vehicle, Reason(R.CANNOT_BUILD, str(error)))
            return
        self._allocate_and_send(vehicle)

    def _granted_drive(
        self, granted: RouteGrant | Relocation, vehicle: FleetVehicle, standing: Standing
    ) -> Drive:
        """Return the drive along a route that traffic control has granted just now."""
        allocated = self._traffic.route_of(vehicle.name)
        assert allocated, "granted just now"  # noqa: S101 - for the type
        if isinstance(granted, Relocation):
            vda_order = self._planner.relocation(vehicle, standing, granted.route)
            log.info("vehicle makes room", vehicle=vehicle.name, goal=granted.route.destination)
            return Drive.making_room(vehicle.key, vda_order, allocated.way)
        drive, order = self._drives.requested[vehicle.key], self._state.order_of(vehicle.key)
        assert order, "its drive is requested"  # noqa: S101 - for the type
        vda_order = self._planner.vda_order(
            order, vehicle, standing, granted.route, retriable=drive.retriable
        )
        return drive.granted(vda_order, allocated.way)

    def _allocate_and_send(self, vehicle: FleetVehicle, *, more: int = 0) -> None:
        """Allocate what the robot needs, or ``more`` nodes, and send the order or its update."""
        name = vehicle.name
        granted, sent = self._drives.granted.get(vehicle.key), self._drives.sent.get(vehicle.key)
        gate: Gate = CLOSED
        if not (self.stops.why_stopped(vehicle) or self.mobility.why_misplaced(vehicle)):
            gate = self._peripherals.gate_for(vehicle, granted or sent)
        further = self._allocate_ahead(vehicle, more, gate)
        route = self._traffic.route_of(name)
        assert route, "requested by the caller"  # noqa: S101 - for the type
        if granted and (
            route.released
            # An order at the vehicle's own position has a route without sets: only devices decide on it.
            or (not route.way and gate.may_allocate(NOWHERE) and gate.may_release(NOWHERE))
        ):
            drive = granted.released(route).changed(state=DriveState.SENT)
            self._drives.put(drive)
            self._state.vehicle_changed(name)
            self._state.after_commit(partial(self._send_order, drive))
        elif further and sent and not granted:
            drive = sent.released(route).updated()
            self._drives.put(drive)
            fleet = self._context.fleet
            self._state.after_commit(
                lambda: fleet.release_base(drive.robot, drive.order_id, drive.released_to)
            )

    def _allocate_ahead(self, vehicle: FleetVehicle, more: int, gate: Gate) -> bool:
        """Allocate as far ahead as the settings require; ``more``: at least this many additional nodes."""
        name, settings = vehicle.name, self._context.settings
        ahead = more and self._traffic.scheduler.occupant(name).ahead + more
        limits = vehicle.model.base_limits if vehicle.model else (None, None)
        if settings.release_ahead or not settings.release_seconds:
            nodes = settings.release_ahead and (ahead or settings.release_ahead)
            return self._traffic.allocate(name, nodes, gate=gate, limits=limits)
        factsheet = self._context.view(vehicle).factsheet
        robot_speed = factsheet.physical_parameters.maximum_speed * MM_PER_M if factsheet else 0.0
        # A default of the plant model is not a statement about the vehicle.
        stated = vehicle.model and "max_velocity_mm_s" in vehicle.model.model_fields_set
        model_speed = vehicle.model.max_velocity_mm_s if vehicle.model and stated else 0
        speed = min((speed for speed in (robot_speed, model_speed) if speed > 0), default=UNKNOWN_SPEED_MM_S)
        length_mm = settings.release_seconds * speed
        return self._traffic.allocate(name, ahead, length_mm, gate, limits=limits)

    def send_update(self, drive: Drive) -> None:
        """Send a robot the update that changes the plan of its VDA order, after the commit."""
        self._drives.put(drive)
        self._state.after_commit(
            lambda: self._context.fleet.extend_vda_order(drive.robot, drive.as_released())
        )

    def _shorten_route(self, drive: Drive) -> None:
        if vehicle := self._vehicle_under_way(drive):
            self._traffic.shorten_route(vehicle.name)
            self._state.drive_due = True

    def _send_order(self, drive: Drive) -> FleetOutput | None:
        try:
            self._context.fleet.start_vda_order(drive.robot, drive.as_released())
        except RobotBusyError as error:
            name = drive.order_id
            return VdaOrderFailed(drive.robot, name, reason_of(error), kind=FailureKind.REFUSED)
        return None

    def _vehicle_under_way(self, drive: Drive) -> FleetVehicle | None:
        vehicle = self._registry.of(drive.robot)
        return vehicle if vehicle and self._traffic.route_of(vehicle.name) else None

    def _come_to_rest(self, vehicle: FleetVehicle, *, doubt: bool = False) -> None:
        self.positions.forget_sighting(vehicle, doubt=doubt)
        if doubt:
            ask = without_parameters(STATE_REQUEST, unique_id())
            self._state.after_commit(lambda: self._context.fleet.instant_action(vehicle.key, ask))
        self.positions.update_held(vehicle)
        self._state.drive_due = True
